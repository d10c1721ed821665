//! Errors added to pseudoranges on request, to see what monitors make of them.

use std::fmt;
use std::str::FromStr;

use gnss_nav::SatelliteId;

/// How an error develops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FaultShape {
    /// There at once, m.
    Step {
        /// Its size, m.
        size_m: f64,
    },
    /// Growing from zero.
    Ramp {
        /// By how much a second, m/s.
        rate_mps: f64,
    },
}

/// An error of one satellite's pseudoranges from some time on.
///
/// Written `G01:15@500` (a step of 15 m) or `G01:0.5@500:ramp` (0.5 m/s), 500 s after the first
/// epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InjectedFault {
    /// Whose pseudoranges.
    pub satellite: SatelliteId,
    /// How the error develops.
    pub shape: FaultShape,
    /// When it begins, s since the first epoch.
    pub onset_s: f64,
}

impl InjectedFault {
    /// The error of `satellite` at `time_s`, m; `None` where this is not its fault, or not yet.
    #[must_use]
    pub fn error_m(&self, satellite: SatelliteId, time_s: f64) -> Option<f64> {
        let since_s = time_s - self.onset_s;
        (satellite == self.satellite && since_s >= 0.0).then_some(match self.shape {
            FaultShape::Step { size_m } => size_m,
            FaultShape::Ramp { rate_mps } => rate_mps * since_s,
        })
    }
}

impl FromStr for InjectedFault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        parse(text).ok_or_else(|| {
            "SAT:METRES@SECONDS for a step or SAT:METRES_A_SECOND@SECONDS:ramp, for instance G01:15@500".to_owned()
        })
    }
}

fn parse(text: &str) -> Option<InjectedFault> {
    let (satellite, rest) = text.split_once(':')?;
    let (amount, onset) = rest.split_once('@')?;
    let number = |text: &str| {
        text.parse()
            .ok()
            .filter(|v: &f64| v.is_finite() && v.abs() <= MOST)
    };
    let amount = number(amount)?;
    let (onset, shape) = match onset.split_once(':') {
        None => (onset, FaultShape::Step { size_m: amount }),
        Some((onset, "ramp")) => (onset, FaultShape::Ramp { rate_mps: amount }),
        Some(_) => return None,
    };
    Some(InjectedFault {
        satellite: satellite.parse().ok()?,
        shape,
        onset_s: number(onset).filter(|s| *s >= 0.0)?,
    })
}

/// Largest number taken, m, m/s or s.
const MOST: f64 = 1e9;

impl fmt::Display for InjectedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.shape {
            FaultShape::Step { size_m } => {
                write!(f, "{}:{size_m}@{}", self.satellite, self.onset_s)
            }
            FaultShape::Ramp { rate_mps } => {
                write!(f, "{}:{rate_mps}@{}:ramp", self.satellite, self.onset_s)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_and_ramps_are_read_and_written_alike() {
        for text in ["G01:15@500", "G32:-0.5@0:ramp"] {
            let fault: InjectedFault = text.parse().unwrap();
            assert_eq!(fault.to_string(), text);
        }
        for text in [
            "",
            "G01",
            "G01:15",
            "15@500",
            "G01:x@500",
            "G99:1@2",
            "G01:nan@3",
            "G01:1@-3",
            "G01:1@3:step",
            "E01:1@3",
            "G01:1@inf",
        ] {
            assert!(text.parse::<InjectedFault>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_ramp_grows_from_its_onset() {
        let fault: InjectedFault = "G07:2@10:ramp".parse().unwrap();
        let g07 = SatelliteId::gps(7);
        assert_eq!(fault.error_m(g07, 9.0), None);
        assert_eq!(fault.error_m(g07, 13.0), Some(6.0));
        assert_eq!(fault.error_m(SatelliteId::gps(8), 13.0), None);
    }
}
