//! What goes wrong: faults of a scenario file.

mod effect;
mod interference;
mod span;
mod spec;
mod target;

use anyhow::{Result, ensure};
use gnss_nav::SatelliteId;

use super::antenna::{Gap, Interference};
pub use effect::{Effect, Influence, RaySpec};
pub use span::Span;
pub use spec::FaultSpec;
pub use target::Target;

/// A fault as it is told in faults.csv.
#[derive(Debug, Clone, PartialEq)]
pub struct Account {
    /// Its kind, as in the scenario file.
    pub kind: &'static str,
    /// Satellites that it befalls; none: all reception.
    pub satellites: Vec<SatelliteId>,
    /// When.
    pub span: Span,
    /// How much.
    pub detail: String,
}

impl FaultSpec {
    /// Its kind, as in the scenario file.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Blocked { .. } => "blocked",
            Self::Attenuated { .. } => "attenuated",
            Self::Multipath { .. } => "multipath",
            Self::ReflectionOnly { .. } => "reflection_only",
            Self::Step { .. } => "step",
            Self::Ramp { .. } => "ramp",
            Self::ClockJump { .. } => "clock_jump",
            Self::WrongEphemeris { .. } => "wrong_ephemeris",
            Self::BitErrors { .. } => "bit_errors",
            Self::Tone { .. } => "tone",
            Self::Chirp { .. } => "chirp",
            Self::Broadband { .. } => "broadband",
            Self::Counterfeit { .. } => "counterfeit",
            Self::DroppedSamples { .. } => "dropped_samples",
            Self::Outage { .. } => "outage",
        }
    }

    /// Onset, end and ramp.
    #[must_use]
    pub const fn span(&self) -> Span {
        match *self {
            Self::Attenuated {
                begin_s,
                end_s,
                ramp_s,
                ..
            }
            | Self::Multipath {
                begin_s,
                end_s,
                ramp_s,
                ..
            }
            | Self::Counterfeit {
                begin_s,
                end_s,
                ramp_s,
                ..
            } => Span {
                begin_s,
                end_s,
                ramp_s,
            },
            Self::Blocked { begin_s, end_s, .. }
            | Self::ReflectionOnly { begin_s, end_s, .. }
            | Self::Step { begin_s, end_s, .. }
            | Self::Ramp { begin_s, end_s, .. }
            | Self::BitErrors { begin_s, end_s, .. }
            | Self::Tone { begin_s, end_s, .. }
            | Self::Chirp { begin_s, end_s, .. }
            | Self::Broadband { begin_s, end_s, .. }
            | Self::Outage { begin_s, end_s } => Span {
                begin_s,
                end_s,
                ramp_s: 0.0,
            },
            Self::ClockJump { begin_s, .. } | Self::WrongEphemeris { begin_s, .. } => Span {
                begin_s,
                end_s: None,
                ramp_s: 0.0,
            },
            Self::DroppedSamples {
                begin_s,
                duration_s,
            } => Span {
                begin_s,
                end_s: Some(begin_s + duration_s),
                ramp_s: 0.0,
            },
        }
    }

    /// The satellites it befalls, where it is not all reception.
    ///
    /// # Errors
    /// As [`Target::satellites`].
    pub fn satellites(&self, heard: &[SatelliteId]) -> Result<Vec<SatelliteId>> {
        match self {
            Self::Blocked { sat, .. }
            | Self::Attenuated { sat, .. }
            | Self::Multipath { sat, .. }
            | Self::ReflectionOnly { sat, .. }
            | Self::Step { sat, .. }
            | Self::Ramp { sat, .. }
            | Self::WrongEphemeris { sat, .. }
            | Self::BitErrors { sat, .. }
            | Self::Counterfeit { sat, .. } => sat.satellites(heard),
            Self::Outage { .. } => Ok(heard.to_vec()),
            _ => Ok(Vec::new()),
        }
    }

    /// Checks its numbers.
    ///
    /// # Errors
    /// Names the one that is impossible.
    pub fn check(&self) -> Result<()> {
        self.span().check()?;
        let within = |name: &str, value: f64, low: f64, high: f64| {
            ensure!(
                (low..=high).contains(&value),
                "{name} is {value}: expected {low} to {high}"
            );
            Ok(())
        };
        match self {
            Self::Attenuated { loss_db, .. } => within("loss_db", *loss_db, -30.0, 100.0),
            Self::Multipath { ray, .. } | Self::ReflectionOnly { ray, .. } => {
                ensure!(!ray.is_empty(), "ray: expected at least one");
                ray.iter().try_for_each(RaySpec::check)
            }
            Self::Step { size_m, .. } => within("size_m", *size_m, -1e6, 1e6),
            Self::Ramp { rate_mps, .. } => within("rate_mps", *rate_mps, -1e4, 1e4),
            Self::ClockJump { size_s, .. } => within("size_s", *size_s, -1.0, 1.0),
            Self::WrongEphemeris {
                along_m,
                radial_m,
                clock_m,
                ..
            } => {
                within("along_m", *along_m, -1e6, 1e6)?;
                within("radial_m", *radial_m, -1e6, 1e6)?;
                within("clock_m", *clock_m, -1e5, 1e5)
            }
            Self::BitErrors { probability, .. } => within("probability", *probability, 0.0, 1.0),
            Self::Counterfeit {
                power_db,
                hold_s,
                lift_mps,
                drag_enu_mps,
                ..
            } => {
                within("power_db", *power_db, -50.0, 50.0)?;
                within("hold_s", *hold_s, 0.0, 1e6)?;
                within("lift_mps", *lift_mps, -1e3, 1e3)?;
                drag_enu_mps
                    .iter()
                    .try_for_each(|v| within("drag_enu_mps", *v, -1e3, 1e3))
            }
            Self::DroppedSamples { duration_s, .. } => within("duration_s", *duration_s, 0.0, 1e3),
            _ => Ok(()),
        }
    }

    /// What it does to the rays of a satellite that it befalls.
    #[must_use]
    pub fn effect(&self) -> Option<Effect> {
        let influence = match self {
            Self::Blocked { .. } | Self::Outage { .. } => Influence::Blocked,
            Self::Attenuated { loss_db, .. } => Influence::Loss { db: *loss_db },
            Self::Multipath { ray, .. } => Influence::Reflections(ray.clone()),
            Self::ReflectionOnly { ray, .. } => Influence::OnlyReflections(ray.clone()),
            Self::Step { size_m, .. } => Influence::Step { size_m: *size_m },
            Self::Ramp { rate_mps, .. } => Influence::Ramp {
                rate_mps: *rate_mps,
            },
            _ => return None,
        };
        Some(Effect {
            span: self.span(),
            influence,
        })
    }

    /// The interference that it is, if it is one.
    ///
    /// # Errors
    /// Names a value that is impossible.
    pub fn interference(&self, duration_s: f64) -> Result<Option<Interference>> {
        interference::of(self, duration_s)
    }

    /// The samples that it takes, if it does.
    #[must_use]
    pub const fn gap(&self) -> Option<Gap> {
        match *self {
            Self::DroppedSamples {
                begin_s,
                duration_s,
            } => Some(Gap {
                begin_s,
                duration_s,
            }),
            _ => None,
        }
    }

    /// The jump of the receiver's clock (instant, size in s) that it is, if it is one.
    #[must_use]
    pub const fn clock_jump_s(&self) -> Option<(f64, f64)> {
        match *self {
            Self::ClockJump { begin_s, size_s } => Some((begin_s, size_s)),
            _ => None,
        }
    }

    /// For faults.csv.
    ///
    /// # Errors
    /// As [`Target::satellites`].
    pub fn account(&self, heard: &[SatelliteId]) -> Result<Account> {
        Ok(Account {
            kind: self.kind(),
            satellites: self.satellites(heard)?,
            span: self.span(),
            detail: self.detail(),
        })
    }

    fn detail(&self) -> String {
        match self {
            Self::Attenuated { loss_db, .. } => format!("loss_db={loss_db}"),
            Self::Multipath { ray, .. } | Self::ReflectionOnly { ray, .. } => {
                let all: Vec<String> = ray.iter().map(ToString::to_string).collect();
                all.join(" + ")
            }
            Self::Step { size_m, .. } => format!("size_m={size_m}"),
            Self::Ramp { rate_mps, .. } => format!("rate_mps={rate_mps}"),
            Self::ClockJump { size_s, .. } => format!("size_s={size_s}"),
            Self::WrongEphemeris {
                along_m,
                radial_m,
                clock_m,
                ..
            } => {
                format!("along_m={along_m} radial_m={radial_m} clock_m={clock_m}")
            }
            Self::BitErrors { probability, .. } => format!("probability={probability}"),
            Self::Tone {
                level_dbhz,
                offset_hz,
                ..
            } => {
                format!("level_dbhz={level_dbhz} offset_hz={offset_hz}")
            }
            Self::Chirp {
                level_dbhz,
                from_hz,
                to_hz,
                period_s,
                ..
            } => format!(
                "level_dbhz={level_dbhz} from_hz={from_hz} to_hz={to_hz} period_s={period_s}"
            ),
            Self::Broadband {
                level_dbhz,
                width_hz,
                ..
            } => {
                format!("level_dbhz={level_dbhz} width_hz={width_hz}")
            }
            Self::Counterfeit {
                power_db,
                hold_s,
                lift_mps,
                drag_enu_mps: [e, n, u],
                ..
            } => format!(
                "power_db={power_db} hold_s={hold_s} lift_mps={lift_mps} drag_enu_mps={e} {n} {u}"
            ),
            Self::DroppedSamples { duration_s, .. } => format!("duration_s={duration_s}"),
            Self::Blocked { .. } | Self::Outage { .. } => String::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> Result<FaultSpec> {
        Ok(toml::from_str(text)?)
    }

    #[test]
    fn kinds_are_read_and_unknown_keys_refused() {
        let step = fault("kind = 'step'\nsat = 'G07'\nbegin_s = 3\nsize_m = 20\n").unwrap();
        assert_eq!((step.kind(), step.span().begin_s), ("step", 3.0));
        let message = |text| fault(text).unwrap_err().to_string();
        assert!(message("kind = 'step'\nsat = 'G07'\nbegin_s = 3\nsize = 20\n").contains("`size`"));
        assert!(message("kind = 'stp'\nbegin_s = 3\n").contains("`stp`"));
    }

    #[test]
    fn satellites_must_be_heard() {
        let heard = [SatelliteId::gps(7), SatelliteId::gps(11)];
        let one = |name: &str| Target::One(name.to_owned());
        assert_eq!(one("all").satellites(&heard).unwrap(), heard);
        assert_eq!(one("G11").satellites(&heard).unwrap(), heard[1..]);
        let error = one("G05").satellites(&heard).unwrap_err().to_string();
        assert_eq!(error, "sat is \"G05\": expected \"all\" or one of G07 G11");
    }

    #[test]
    fn impossible_numbers_are_named() {
        let text = "kind = 'bit_errors'\nsat = 'all'\nbegin_s = 3\nprobability = 2\n";
        let error = fault(text).unwrap().check().unwrap_err().to_string();
        assert_eq!(error, "probability is 2: expected 0 to 1");
        let text = "kind = 'outage'\nbegin_s = 3\nend_s = 2\n";
        let error = fault(text).unwrap().check().unwrap_err().to_string();
        assert_eq!(error, "end_s is 2: expected more than begin_s, 3");
    }
}
