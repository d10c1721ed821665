//! What goes wrong: faults of a scenario file.

mod effect;
mod interference;
mod span;

use anyhow::{Result, ensure};
use gnss_nav::SatelliteId;
use serde::Deserialize;

use super::antenna::{Gap, Interference};
pub use effect::{Effect, Influence, RaySpec};
use interference::{Level, PulseSpec};
pub use span::Span;

/// A fault of a scenario file. Times are elapsed seconds; without an end a fault stays.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FaultSpec {
    /// Nothing arrives of a satellite.
    Blocked {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
    },
    /// A satellite arrives weaker.
    Attenuated {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Time in which it grows and vanishes, s.
        #[serde(default)]
        ramp_s: f64,
        /// Loss of power, dB.
        loss_db: f64,
    },
    /// Reflections arrive beside a satellite's direct signal.
    Multipath {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Time in which they grow and vanish, s.
        #[serde(default)]
        ramp_s: f64,
        /// The reflections.
        ray: Vec<RaySpec>,
    },
    /// Reflections arrive in place of a satellite's direct signal.
    ReflectionOnly {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// The reflections.
        ray: Vec<RaySpec>,
    },
    /// Code and carrier of a satellite jump.
    Step {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// By how much the range grows, m.
        size_m: f64,
    },
    /// Code and carrier of a satellite drift away.
    Ramp {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End of the drift, s; the error stays.
        end_s: Option<f64>,
        /// How fast the range grows, m/s.
        rate_mps: f64,
    },
    /// The receiver's clock jumps.
    ClockJump {
        /// When, s.
        begin_s: f64,
        /// By how much, s.
        size_s: f64,
    },
    /// A satellite broadcasts an orbit and clock that it does not fly.
    WrongEphemeris {
        /// Which.
        sat: Target,
        /// When the broadcast changes (to the subframe), s; 0: wrong from the start.
        begin_s: f64,
        /// How far ahead on its orbit it claims to be, m.
        #[serde(default)]
        along_m: f64,
        /// How far out it claims to be, m.
        #[serde(default)]
        radial_m: f64,
        /// How far ahead it claims its clock to be, m.
        #[serde(default)]
        clock_m: f64,
    },
    /// Bits of a satellite's message are wrong.
    BitErrors {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Of each bit.
        probability: f64,
    },
    /// A carrier interferes.
    Tone {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Power over noise density, dB-Hz, or points (s, dB-Hz).
        level_dbhz: Level,
        /// Offset from L1, Hz.
        #[serde(default)]
        offset_hz: f64,
        /// Pulses.
        pulses: Option<PulseSpec>,
    },
    /// A sweeping carrier interferes.
    Chirp {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Power over noise density, dB-Hz, or points (s, dB-Hz).
        level_dbhz: Level,
        /// Offset from L1 where a sweep begins, Hz.
        from_hz: f64,
        /// Offset where it ends, Hz.
        to_hz: f64,
        /// Duration of a sweep, s.
        period_s: f64,
        /// Pulses.
        pulses: Option<PulseSpec>,
    },
    /// Noise interferes.
    Broadband {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Power over noise density, dB-Hz, or points (s, dB-Hz).
        level_dbhz: Level,
        /// Two-sided width, Hz.
        width_hz: f64,
        /// Pulses.
        pulses: Option<PulseSpec>,
    },
    /// Somebody transmits a satellite's signal and leads the receiver away.
    Counterfeit {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Time in which it grows and vanishes, s.
        #[serde(default)]
        ramp_s: f64,
        /// Power over that of the satellite, dB.
        power_db: f64,
        /// Time after the onset during which it stays on the true signal, s.
        #[serde(default)]
        hold_s: f64,
        /// How fast its range grows then, m/s.
        #[serde(default)]
        lift_mps: f64,
        /// How fast it moves the receiver's place then, east, north, up, m/s.
        #[serde(default)]
        drag_enu_mps: [f64; 3],
    },
    /// Samples are lost.
    DroppedSamples {
        /// The first one lost, s.
        begin_s: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Nothing arrives of any satellite.
    Outage {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
    },
}

/// Which satellites a fault befalls.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Target {
    /// `"G07"`, or `"all"`.
    One(String),
    /// `["G07", "G11"]`.
    Several(Vec<String>),
}

impl Target {
    /// The satellites among those `heard`.
    ///
    /// # Errors
    /// Names one that is not heard or no satellite.
    pub fn satellites(&self, heard: &[SatelliteId]) -> Result<Vec<SatelliteId>> {
        let names = match self {
            Self::One(name) if name == "all" => return Ok(heard.to_vec()),
            Self::One(name) => std::slice::from_ref(name),
            Self::Several(names) => names,
        };
        let find = |name: &String| {
            let found = heard.iter().find(|s| s.to_string() == *name).copied();
            let known: Vec<String> = heard.iter().map(ToString::to_string).collect();
            found.ok_or_else(|| {
                anyhow::anyhow!(
                    "sat is {name:?}: expected \"all\" or one of {}",
                    known.join(" ")
                )
            })
        };
        names.iter().map(find).collect()
    }
}

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
