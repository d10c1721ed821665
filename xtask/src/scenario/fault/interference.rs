//! Interfering signals of a scenario file.

use std::fmt;

use anyhow::{Result, ensure};
use serde::Deserialize;

use super::FaultSpec;
use crate::scenario::antenna::{Interference, Pulses, Waveform};
use crate::scenario::profile::Profile;

/// A level: one, or points (elapsed s, dB-Hz) with straight lines between.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Level {
    /// The same throughout.
    Constant(f64),
    /// Changing.
    Points(Vec<(f64, f64)>),
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant(level) => write!(f, "{level}"),
            Self::Points(points) => {
                let all: Vec<String> = points.iter().map(|(t, l)| format!("{l}@{t}")).collect();
                f.write_str(&all.join(" "))
            }
        }
    }
}

impl Level {
    /// The level from `begin_s` to `end_s`.
    fn profile(&self, begin_s: f64, end_s: f64) -> Result<Profile> {
        let whole = match self {
            Self::Constant(level) => Profile::constant(*level),
            Self::Points(points) => Profile::new(points.clone())?,
        };
        let inner = match self {
            Self::Points(points) => &points[..],
            Self::Constant(_) => &[],
        };
        let mut points = vec![(begin_s, whole.at(begin_s))];
        points.extend(inner.iter().filter(|(t, _)| *t > begin_s && *t < end_s));
        points.push((end_s, whole.at(end_s)));
        ensure!(
            points
                .iter()
                .all(|(_, level)| (-50.0..=150.0).contains(level)),
            "level_dbhz is {self}: expected -50 to 150"
        );
        Profile::new(points)
    }
}

/// Pulses of a scenario file.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PulseSpec {
    /// From one to the next, s.
    period_s: f64,
    /// Part of it that is on.
    duty: f64,
}

impl PulseSpec {
    fn pulses(&self) -> Result<Pulses> {
        ensure!(
            (1e-6..=1e3).contains(&self.period_s) && self.duty > 0.0 && self.duty <= 1.0,
            "{self:?}: expected a period of 1e-6 to 1e3 s and a duty above 0, at most 1"
        );
        Ok(Pulses {
            period_s: self.period_s,
            duty: self.duty,
        })
    }
}

/// The interference that `fault` is, over a scenario of `duration_s`.
pub(super) fn of(fault: &FaultSpec, duration_s: f64) -> Result<Option<Interference>> {
    let (waveform, level, pulses) = match fault {
        FaultSpec::Tone {
            offset_hz,
            level_dbhz,
            pulses,
            ..
        } => (
            Waveform::Tone {
                offset_hz: *offset_hz,
            },
            level_dbhz,
            pulses,
        ),
        FaultSpec::Chirp {
            from_hz,
            to_hz,
            period_s,
            level_dbhz,
            pulses,
            ..
        } => {
            ensure!(
                (1e-6..=1e3).contains(period_s),
                "period_s is {period_s}: expected 1e-6 to 1e3"
            );
            let waveform = Waveform::Chirp {
                from_hz: *from_hz,
                to_hz: *to_hz,
                period_s: *period_s,
            };
            (waveform, level_dbhz, pulses)
        }
        FaultSpec::Broadband {
            width_hz,
            level_dbhz,
            pulses,
            ..
        } => {
            ensure!(
                (1e3..=1e9).contains(width_hz),
                "width_hz is {width_hz}: expected 1e3 to 1e9"
            );
            (
                Waveform::Broadband {
                    width_hz: *width_hz,
                },
                level_dbhz,
                pulses,
            )
        }
        _ => return Ok(None),
    };
    let span = fault.span();
    Ok(Some(Interference {
        waveform,
        level_dbhz: level.profile(span.begin_s, span.end_s.unwrap_or(duration_s + 1.0))?,
        pulses: pulses.as_ref().map(PulseSpec::pulses).transpose()?,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_cut_to_their_span() {
        let level = Level::Points(vec![(0.0, 40.0), (10.0, 50.0), (20.0, 50.0)]);
        let profile = level.profile(5.0, 15.0).unwrap();
        assert_eq!(profile.span_s(), (5.0, 15.0));
        assert_eq!(
            (profile.at(5.0), profile.at(7.5), profile.at(12.0)),
            (45.0, 47.5, 50.0)
        );
        assert!(Level::Constant(500.0).profile(0.0, 1.0).is_err());
    }
}
