//! How the delay of the troposphere changes as a satellite rises or sets and the receiver moves.

use nalgebra::Vector3;

use crate::line_of_sight::LineOfSight;
use crate::measurement::LOWEST_ELEVATION_RAD;

/// Rate of a tropospheric delay, by the motion of satellite and receiver.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DelayRate {
    /// Of a receiver at rest, m/s.
    pub at_rest_mps: f64,
    /// Its derivative by the receiver's velocity, ECEF.
    pub by_velocity: Vector3<f64>,
}

impl DelayRate {
    /// Height over which the delay falls by a factor of e, m: near sea level 8.4 km of the dry part, 2 of the wet one.
    const SCALE_HEIGHT_M: f64 = 7_400.0;

    /// Of a delay of `delay_m` where `up_ecef` points to the zenith: it goes with 1 / (e . up) and with the pressure,
    /// and both line of sight and zenith turn.
    pub(crate) fn new(
        delay_m: f64,
        path: &LineOfSight,
        receiver_ecef_m: &Vector3<f64>,
        up_ecef: &Vector3<f64>,
    ) -> Self {
        let e = path.unit_ecef;
        let sine = e.dot(up_ecef);
        let by_sine_m = -delay_m / sine.max(LOWEST_ELEVATION_RAD.sin());
        // By the motion of the satellite, and by that of the zenith.
        let turns = (up_ecef - sine * e) / path.range_m;
        let tilts = (e - sine * up_ecef) / receiver_ecef_m.norm();
        Self {
            at_rest_mps: by_sine_m * turns.dot(&path.satellite_velocity_ecef_mps),
            by_velocity: by_sine_m * (tilts - turns) - up_ecef * (delay_m / Self::SCALE_HEIGHT_M),
        }
    }

    /// Of a receiver moving at `velocity_ecef_mps`, m/s.
    #[must_use]
    pub fn mps(&self, velocity_ecef_mps: &Vector3<f64>) -> f64 {
        self.at_rest_mps + self.by_velocity.dot(velocity_ecef_mps)
    }
}

/// What the rate of a tropospheric delay may be wrong by, m/s, as much as it is at most for a receiver on the ground:
/// 1 cm/s at 10 degrees, 4 cm/s at 5, without end at the horizon.
pub(crate) fn error_mps(delay_m: f64, elevation_rad: f64) -> f64 {
    /// Fastest rise of a satellite seen from the ground, rad/s.
    const RISE_RAD_S: f64 = 1.4e-4;
    if delay_m == 0.0 {
        return 0.0;
    }
    // Delays go with 1 / sin.
    RISE_RAD_S * delay_m / elevation_rad.tan()
}
