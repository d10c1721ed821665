//! One epoch as every integrity monitor of this crate takes it: lines of sight and residuals.

use crate::MonitorError;
use crate::error::within;

/// States estimated from a snapshot: three of position, then c times the clock bias, all in m.
pub const STATES: usize = 4;

/// Largest residual a monitor works with, m: its square is still far from overflow.
const LARGEST_RESIDUAL_M: f64 = 1e9;

/// What one satellite contributes, linear about a reference point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Whose, by any number the caller likes.
    pub id: u32,
    /// Derivative of the pseudorange by the state: minus the unit vector from the receiver to the
    /// satellite, in any frame of the caller's, then 1 for the clock.
    pub design: [f64; STATES],
    /// Measured pseudorange minus the one predicted at the reference point, m.
    pub residual_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
}

impl Sight {
    /// Residual about `state` (offset from the reference point, m) instead of the reference, m.
    #[must_use]
    pub fn residual_about(&self, state: &[f64; STATES]) -> f64 {
        let [a, b, c, d] = self.design;
        self.residual_m - (a * state[0] + b * state[1] + c * state[2] + d * state[3])
    }

    /// Refuses what no monitor can work with.
    fn check(&self) -> Result<(), MonitorError> {
        for design in self.design {
            within("design row", design, (-2.0, 2.0), "a unit vector and 1")?;
        }
        let limits = (-LARGEST_RESIDUAL_M, LARGEST_RESIDUAL_M);
        within(
            "residual (m)",
            self.residual_m,
            limits,
            "at most 1e9 either way",
        )?;
        within(
            "standard deviation (m)",
            self.sigma_m,
            (1e-3, 1e6),
            "0.001 to 1e6",
        )
    }
}

/// Checks the sights of one epoch: usable numbers, and each satellite once.
///
/// # Errors
/// [`MonitorError::Value`] naming the first number that cannot be used,
/// [`MonitorError::Repeated`] for a satellite that occurs twice.
pub fn check_sights(sights: &[Sight]) -> Result<(), MonitorError> {
    for (index, sight) in sights.iter().enumerate() {
        sight.check()?;
        if sights[..index].iter().any(|other| other.id == sight.id) {
            return Err(MonitorError::Repeated { id: sight.id });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Sight = Sight {
        id: 4,
        design: [0.6, -0.8, 0.0, 1.0],
        residual_m: 5.0,
        sigma_m: 3.0,
    };

    #[test]
    fn a_residual_moves_with_the_state() {
        // 5 - (0.6 * 1 - 0.8 * 2 + 3) = 3, exact up to rounding.
        let moved = GOOD.residual_about(&[1.0, 2.0, 9.0, 3.0]);
        assert!((moved - 3.0).abs() < 1e-15, "{moved}");
    }

    #[test]
    fn what_cannot_be_used_is_named() {
        assert_eq!(check_sights(&[GOOD]), Ok(()));
        assert_eq!(
            check_sights(&[GOOD, GOOD]),
            Err(MonitorError::Repeated { id: 4 })
        );
        let message = |sight| check_sights(&[sight]).unwrap_err().to_string();
        let residual_m = f64::NAN;
        assert!(message(Sight { residual_m, ..GOOD }).starts_with("residual (m) is NaN"));
        let sigma_m = 0.0;
        assert!(message(Sight { sigma_m, ..GOOD }).starts_with("standard deviation (m) is 0"));
        let design = [f64::INFINITY, 0.0, 0.0, 1.0];
        assert!(message(Sight { design, ..GOOD }).starts_with("design row is inf"));
    }
}
