//! From pseudoranges in the earth-fixed frame to sights about a reference point.

use crate::classical::LeastSquaresFit;
use crate::error::within;
use crate::{MonitorError, STATES, SatelliteMeasurement, Sight};

/// Largest satellite coordinate or pseudorange, m: beyond every navigation satellite.
const FARTHEST_M: f64 = 1e9;
/// Gauss-Newton converges from the centre of the earth in five or six steps.
const MOST_ITERATIONS: usize = 20;
/// A step this short ends the search, m.
const CONVERGED_M: f64 = 1e-4;

/// Farthest an estimate may be from the reference before that follows, m: the linear model still
/// holds to 0.1 mm there.
const FARTHEST_STATE_M: f64 = 50.0;

/// Where sights are taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// Position in the ECEF frame, m.
    pub position_ecef_m: [f64; 3],
    /// c times the receiver's clock bias, m.
    pub clock_m: f64,
}

impl Reference {
    /// The centre of the earth.
    const CENTRE: Self = Self {
        position_ecef_m: [0.0; 3],
        clock_m: 0.0,
    };

    /// The point at `state_m` about this one.
    #[must_use]
    pub fn moved(&self, state_m: &[f64; STATES]) -> Self {
        Self {
            position_ecef_m: std::array::from_fn(|d| self.position_ecef_m[d] + state_m[d]),
            clock_m: self.clock_m + state_m[3],
        }
    }

    /// Moves the point by `offset_ecef_m`, m.
    pub(crate) fn displace(&mut self, offset_ecef_m: &[f64; 3]) {
        for (own, offset) in self.position_ecef_m.iter_mut().zip(offset_ecef_m) {
            *own += offset;
        }
    }

    /// Moves the point to the position of `state_m` once that is far away; returns what states about
    /// it then shift by.
    pub(crate) fn follow_position(&mut self, state_m: &[f64; STATES]) -> Option<[f64; STATES]> {
        let [x, y, z, _] = *state_m;
        if (x * x + y * y + z * z).sqrt() <= FARTHEST_STATE_M {
            return None;
        }
        self.displace(&[x, y, z]);
        Some([-x, -y, -z, 0.0])
    }

    /// Takes in the clock of an epoch: the median of what `used` leave unexplained at `state_m`, which one
    /// fault moves little, so that a drift or jump common to all is gone.
    pub(crate) fn follow_clock<'a>(
        &mut self,
        used: impl Iterator<Item = &'a SatelliteMeasurement>,
        state_m: &[f64; STATES],
    ) {
        let mut sorted_m: Vec<f64> = used
            .map(|m| self.sight(m).residual_about(state_m))
            .collect();
        sorted_m.sort_by(f64::total_cmp);
        let middle = sorted_m.len() / 2;
        if let Some(upper) = sorted_m.get(middle) {
            let lower = sorted_m[sorted_m.len() - 1 - middle];
            self.clock_m += 0.5 * (lower + upper);
        }
    }

    /// The sight of one satellite; the design row is minus the line of sight, then one. Linear
    /// within |x|^2 / (2 range): 0.3 mm at 100 m.
    #[must_use]
    pub fn sight(&self, measurement: &SatelliteMeasurement) -> Sight {
        let satellite = measurement.position_ecef_m;
        let path: [f64; 3] = std::array::from_fn(|d| satellite[d] - self.position_ecef_m[d]);
        let range_m = path.iter().map(|p| p * p).sum::<f64>().sqrt();
        let [x, y, z] = path.map(|p| -p / range_m);
        Sight {
            id: measurement.id,
            design: [x, y, z, 1.0],
            residual_m: measurement.pseudorange_m - range_m - self.clock_m,
            sigma_m: measurement.variance_m2.sqrt(),
        }
    }

    /// Least-squares position and clock of one epoch; `None` where the satellites do not fix it.
    #[must_use]
    pub fn solve(measurements: &[SatelliteMeasurement]) -> Option<Self> {
        let mut reference = Self::CENTRE;
        for _ in 0..MOST_ITERATIONS {
            let sights: Vec<_> = measurements.iter().map(|m| reference.sight(m)).collect();
            let step = LeastSquaresFit::new(&sights)?.state_m;
            if !step.iter().all(|s| s.abs() < FARTHEST_M) {
                return None;
            }
            reference = reference.moved(&step);
            if step.iter().all(|s| s.abs() < CONVERGED_M) {
                return Some(reference);
            }
        }
        None
    }
}

/// Refuses measurements no monitor can work with.
pub(crate) fn check_measurements(
    measurements: &[SatelliteMeasurement],
) -> Result<(), MonitorError> {
    for (index, measurement) in measurements.iter().enumerate() {
        let place = measurement.position_ecef_m.into_iter();
        for number in place.chain([measurement.pseudorange_m]) {
            let name = "satellite position or pseudorange (m)";
            within(
                name,
                number,
                (-FARTHEST_M, FARTHEST_M),
                "at most 1e9 either way",
            )?;
        }
        within(
            "variance (m^2)",
            measurement.variance_m2,
            (1e-6, 1e12),
            "1e-6 to 1e12",
        )?;
        if measurements[..index].iter().any(|m| m.id == measurement.id) {
            return Err(MonitorError::Repeated { id: measurement.id });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_sky::{CLOCK_M, PLACE_M, measurements};

    #[test]
    fn the_centre_of_the_earth_is_far_enough_to_start_from() {
        let found = Reference::solve(&measurements(9, |_| 0.0)).unwrap();
        for (found, put) in found.position_ecef_m.iter().zip(PLACE_M) {
            // The last step is below 1e-4 m and convergence is quadratic; range rounding is 4e-9.
            assert!((found - put).abs() < 1e-6);
        }
        assert!((found.clock_m - CLOCK_M).abs() < 1e-6);
        assert_eq!(Reference::solve(&measurements(3, |_| 0.0)), None);
    }

    #[test]
    fn sights_about_the_truth_have_no_residual() {
        let truth = Reference {
            position_ecef_m: PLACE_M,
            clock_m: CLOCK_M,
        };
        let about = truth.moved(&[30.0, -40.0, 50.0, 12.0]);
        for measurement in measurements(9, |_| 0.0) {
            assert!(truth.sight(&measurement).residual_m.abs() < 1e-7);
            let sight = about.sight(&measurement);
            // The second-order term at 71 m over 2e7 m is 0.12 mm.
            let left = sight.residual_about(&[-30.0, 40.0, -50.0, -12.0]);
            assert!(left.abs() < 1.3e-4, "{left}");
        }
    }

    #[test]
    fn impossible_measurements_are_named() {
        let mut measurements = measurements(6, |_| 0.0);
        assert_eq!(check_measurements(&measurements), Ok(()));
        measurements[2].variance_m2 = 0.0;
        let message = check_measurements(&measurements).unwrap_err().to_string();
        assert!(message.starts_with("variance (m^2) is 0"), "{message}");
        measurements[2].variance_m2 = 9.0;
        measurements[3].pseudorange_m = f64::INFINITY;
        assert!(check_measurements(&measurements).is_err());
    }
}
