//! The path of a signal from a satellite at transmission to a receiver at reception.

use nalgebra::Vector3;

use crate::SatelliteState;
use crate::constants::{EARTH_RATE_RAD_S, SPEED_OF_LIGHT_MPS};

/// Line of sight in the ECEF frame of the instant of reception.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineOfSight {
    /// Geometric range, m.
    pub range_m: f64,
    /// Unit vector from receiver to satellite.
    pub unit_ecef: Vector3<f64>,
    /// Satellite at transmission, in the frame of reception, m.
    pub satellite_position_ecef_m: Vector3<f64>,
    /// Its ECEF velocity at transmission, turned into the frame of reception, m/s.
    pub satellite_velocity_ecef_mps: Vector3<f64>,
}

impl LineOfSight {
    /// From a receiver at `receiver_ecef_m` (frame of reception) to the satellite whose state at
    /// transmission (frame of transmission) is `satellite`.
    ///
    /// The earth turns by 5.3 microradians under the signal: the satellite is rotated by exactly
    /// the angle of the travel time, which replaces the first-order Sagnac correction.
    #[must_use]
    pub fn new(satellite: &SatelliteState, receiver_ecef_m: &Vector3<f64>) -> Self {
        // Each pass shrinks the error (140 m at first) by the speed of the frame over c, 1e-6.
        let nearly_m = (satellite.position_ecef_m - receiver_ecef_m).norm();
        let nearly = FrameTurn::during(nearly_m).of(&satellite.position_ecef_m);
        let turn = FrameTurn::during((nearly - receiver_ecef_m).norm());
        let position = turn.of(&satellite.position_ecef_m);
        let range_m = (position - receiver_ecef_m).norm();
        Self {
            range_m,
            unit_ecef: (position - receiver_ecef_m) / range_m,
            satellite_position_ecef_m: position,
            satellite_velocity_ecef_mps: turn.of(&satellite.velocity_ecef_mps),
        }
    }

    /// Rate of the range, m/s, seen by a receiver moving at `receiver_ecef_mps`.
    ///
    /// e . (v_sv - v) / (1 + e . V_sv / c) with the satellite velocity in the frame of reception
    /// and V_sv the same in inertial space. Rotating the velocity with the position accounts for
    /// the Sagnac rate exactly, because what remains of it is normal to e; the denominator is the
    /// change of the travel time during reception (2 mm/s at most).
    #[must_use]
    pub fn range_rate_mps(&self, receiver_ecef_mps: &Vector3<f64>) -> f64 {
        self.unit_ecef
            .dot(&(self.satellite_velocity_ecef_mps - receiver_ecef_mps))
            / self.time_scale()
    }

    /// Derivative of the range rate by the receiver's velocity: -e, scaled.
    pub(crate) fn range_rate_gradient(&self) -> Vector3<f64> {
        -self.unit_ecef / self.time_scale()
    }

    fn time_scale(&self) -> f64 {
        let inertial_mps = self.satellite_velocity_ecef_mps
            + Vector3::z().cross(&self.satellite_position_ecef_m) * EARTH_RATE_RAD_S;
        1.0 + self.unit_ecef.dot(&inertial_mps) / SPEED_OF_LIGHT_MPS
    }
}

/// How far the frame turns between transmission and reception.
struct FrameTurn {
    sin: f64,
    cos: f64,
}

impl FrameTurn {
    /// While a signal travels `range_m`.
    fn during(range_m: f64) -> Self {
        let (sin, cos) = (EARTH_RATE_RAD_S * range_m / SPEED_OF_LIGHT_MPS).sin_cos();
        Self { sin, cos }
    }

    /// A vector in the frame of transmission, expressed in that of reception.
    fn of(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.cos * vector.x + self.sin * vector.y,
            self.cos * vector.y - self.sin * vector.x,
            vector.z,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn satellite() -> SatelliteState {
        SatelliteState {
            position_ecef_m: Vector3::new(1.5e7, -1.2e7, 1.8e7),
            velocity_ecef_mps: Vector3::new(2_100.0, 1_400.0, -900.0),
            clock_bias_s: 0.0,
            clock_drift: 0.0,
        }
    }

    #[test]
    fn sagnac_agrees_with_the_first_order_formula() {
        let receiver = Vector3::new(4.0e6, -3.0e6, 3.9e6);
        let s = satellite();
        let geometric = (s.position_ecef_m - receiver).norm();
        let first_order = EARTH_RATE_RAD_S / SPEED_OF_LIGHT_MPS
            * (s.position_ecef_m.x * receiver.y - s.position_ecef_m.y * receiver.x);
        let exact = LineOfSight::new(&s, &receiver).range_m - geometric;
        // The second order is (omega tau)^2 r / 2, 1e-4 m.
        assert!((exact - first_order).abs() < 1e-3, "{exact} {first_order}");
    }

    #[test]
    fn range_rate_is_the_derivative_of_the_range() {
        let (receiver, velocity) = (
            Vector3::new(4.0e6, -3.0e6, 3.9e6),
            Vector3::new(200.0, -40.0, 90.0),
        );
        // Range as a function of the time of reception: the satellite moves on a straight line
        // in ECEF for the few milliseconds of the difference.
        let range_at = |t: f64| {
            let mut range = LineOfSight::new(&satellite(), &receiver).range_m;
            for _ in 0..5 {
                let mut s = satellite();
                let transmitted = t - range / SPEED_OF_LIGHT_MPS + 0.08;
                s.position_ecef_m += s.velocity_ecef_mps * transmitted;
                range = LineOfSight::new(&s, &(receiver + velocity * t)).range_m;
            }
            range
        };
        let numeric = (range_at(0.5) - range_at(-0.5)) / 1.0;
        let mut s = satellite();
        let range = range_at(0.0);
        s.position_ecef_m += s.velocity_ecef_mps * (0.08 - range / SPEED_OF_LIGHT_MPS);
        let analytic = LineOfSight::new(&s, &receiver).range_rate_mps(&velocity);
        // Rounding of a 2e7 m range, 4e-9 m, and curvature of the path, third derivative 1e-6.
        assert!((numeric - analytic).abs() < 1e-5, "{numeric} {analytic}");
    }
}
