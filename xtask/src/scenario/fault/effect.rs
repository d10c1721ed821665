//! What a fault does to the rays of a satellite.

use std::fmt;

use anyhow::{Result, ensure};
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use serde::Deserialize;

use super::Span;

/// Length of a chip of the C/A code, m.
const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / 1.023e6;

/// A reflection, relative to the direct signal.
///
/// Its carrier is that of the direct signal plus `phase_deg`, turning by `fading_hz` from the
/// onset on (`Zhang2014`, equation 2): the delay moves the code alone.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RaySpec {
    /// Amplitude over that of the direct signal.
    pub amplitude: f64,
    /// Delay of the code, chips.
    pub delay_chips: f64,
    /// Phase at the onset, degrees.
    #[serde(default)]
    pub phase_deg: f64,
    /// Fading frequency, Hz.
    #[serde(default)]
    pub fading_hz: f64,
}

impl RaySpec {
    pub(super) fn check(&self) -> Result<()> {
        let possible = (0.0..=10.0).contains(&self.amplitude)
            && (0.0..=1000.0).contains(&self.delay_chips)
            && self.phase_deg.is_finite()
            && self.fading_hz.abs() <= 1e3;
        ensure!(
            possible,
            "ray is {self}: expected an amplitude of 0 to 10, a delay of 0 to 1000 chips, at most 1 kHz"
        );
        Ok(())
    }

    /// Delay of the code, m.
    #[must_use]
    pub fn delay_m(&self) -> f64 {
        self.delay_chips * CHIP_M
    }

    /// Phase `since_s` after the onset, cycles.
    #[must_use]
    pub fn phase_cycles(&self, since_s: f64) -> f64 {
        self.phase_deg / 360.0 + self.fading_hz * since_s
    }
}

impl fmt::Display for RaySpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "amplitude={} delay_chips={} phase_deg={} fading_hz={}",
            self.amplitude, self.delay_chips, self.phase_deg, self.fading_hz
        )
    }
}

/// A change of what arrives of a satellite, for a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// When.
    pub span: Span,
    /// What.
    pub influence: Influence,
}

/// What changes.
#[derive(Debug, Clone, PartialEq)]
pub enum Influence {
    /// Nothing arrives.
    Blocked,
    /// Less power arrives.
    Loss {
        /// By how much, dB.
        db: f64,
    },
    /// Reflections arrive beside the direct signal.
    Reflections(Vec<RaySpec>),
    /// Reflections arrive in place of the direct signal.
    OnlyReflections(Vec<RaySpec>),
    /// Code and carrier come later.
    Step {
        /// By how much, m.
        size_m: f64,
    },
    /// Code and carrier come later and later.
    Ramp {
        /// How fast, m/s.
        rate_mps: f64,
    },
}

impl Effect {
    /// By how much code and carrier are late at `elapsed_s`, within the stretch of `within_s`, m.
    #[must_use]
    pub fn delay_m(&self, elapsed_s: f64, within_s: f64) -> f64 {
        match self.influence {
            Influence::Step { size_m } if self.span.contains(within_s) => size_m,
            Influence::Ramp { rate_mps } if within_s >= self.span.begin_s => {
                let until_s = self
                    .span
                    .end_s
                    .map_or(elapsed_s, |end_s| elapsed_s.min(end_s));
                rate_mps * (until_s - self.span.begin_s).max(0.0)
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(influence: Influence) -> Effect {
        Effect {
            span: Span {
                begin_s: 2.0,
                end_s: Some(4.0),
                ramp_s: 0.0,
            },
            influence,
        }
    }

    #[test]
    fn a_step_ends_and_a_ramp_stays() {
        let step = effect(Influence::Step { size_m: 20.0 });
        assert_eq!(step.delay_m(2.0, 1.9), 0.0);
        assert_eq!(step.delay_m(2.0, 2.1), 20.0);
        assert_eq!(step.delay_m(4.0, 4.1), 0.0);
        let ramp = effect(Influence::Ramp { rate_mps: 3.0 });
        assert_eq!(ramp.delay_m(3.0, 3.0), 3.0);
        assert_eq!(ramp.delay_m(9.0, 9.0), 6.0);
        assert_eq!(ramp.delay_m(2.0, 1.0), 0.0);
    }
}
