//! The receiver's acceleration by the velocities of the last epochs.

use std::collections::VecDeque;

use gnss_nav::filter::Covariance;
use gnss_nav::{GpsTime, NavState};
use nalgebra::Vector3;

/// Time over which the acceleration is a mean, s: long enough that noise of velocities does not matter
/// over the age of a measurement.
const SPAN_S: f64 = 0.2;
/// An acceleration below two deviations of its noise is none: fed back, noise would grow.
const SIGNIFICANT_SIGMAS2: f64 = 4.0;
/// One that is known to no better than this, 1 g, is none either, (m/s^2)^2: what a start says of its first velocities may
/// be too little, and a prediction by a false acceleration makes velocities that bear it out.
const WORST_VARIANCE_M2_S4: f64 = 100.0;

/// Velocities of the last epochs.
#[derive(Debug, Clone, Default)]
pub(super) struct Velocities(VecDeque<Known>);

/// A velocity and how well it was known at the time.
#[derive(Debug, Clone, Copy)]
struct Known {
    time: GpsTime,
    /// ECEF, m/s.
    velocity_mps: Vector3<f64>,
    /// Of its three coordinates in sum, (m/s)^2.
    variance_m2_s2: f64,
}

impl Velocities {
    /// Keeps the velocity of an epoch.
    pub(super) fn remember(&mut self, state: &NavState, covariance: &Covariance) {
        self.0.push_back(Known {
            time: state.time,
            velocity_mps: state.velocity_ecef_mps,
            variance_m2_s2: [1, 3, 5].iter().map(|i| covariance[(*i, *i)]).sum(),
        });
        self.0.retain(|known| state.time - known.time <= SPAN_S);
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Mean acceleration of the receiver, ECEF, m/s^2, as far as it stands out of the noise of the velocities;
    /// none where the last epoch was not `measured`.
    pub(super) fn mean_acceleration_mps2(&self, measured: bool) -> Vector3<f64> {
        let (Some(before), Some(after)) = (self.0.front(), self.0.back()) else {
            return Vector3::zeros();
        };
        let span_s = after.time - before.time;
        if !measured || span_s < SPAN_S / 2.0 {
            return Vector3::zeros();
        }
        let mean = (after.velocity_mps - before.velocity_mps) / span_s;
        let noise = (before.variance_m2_s2 + after.variance_m2_s2) / (span_s * span_s);
        if noise > WORST_VARIANCE_M2_S4 {
            return Vector3::zeros();
        }
        mean * (1.0 - SIGNIFICANT_SIGMAS2 * noise / mean.norm_squared()).max(0.0)
    }
}

/// What an acceleration of the receiver makes of the range rate of a satellite within `age_s`, m/s; positions and
/// acceleration ECEF.
pub(super) fn change_of_rate_mps(
    acceleration_mps2: &Vector3<f64>,
    satellite_m: &Vector3<f64>,
    receiver_m: &Vector3<f64>,
    age_s: f64,
) -> f64 {
    -(satellite_m - receiver_m)
        .normalize()
        .dot(acceleration_mps2)
        * age_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The acceleration by 0.2 s of a velocity that grows by `step_mps` an epoch, its first known to `first_mps` in each
    /// direction.
    fn found(step_mps: f64, first_mps: f64) -> f64 {
        let mut velocities = Velocities::default();
        for k in 0..=10 {
            let state = NavState {
                time: GpsTime::new(2507, 0.02 * f64::from(k)),
                position_ecef_m: Vector3::zeros(),
                velocity_ecef_mps: Vector3::new(step_mps * f64::from(k), 0.0, 0.0),
                clock_bias_m: 0.0,
                clock_drift_mps: 0.0,
            };
            let sigma_mps = if k == 0 { first_mps } else { 0.1 };
            velocities.remember(&state, &(Covariance::identity() * sigma_mps * sigma_mps));
        }
        velocities.mean_acceleration_mps2(true).x
    }

    #[test]
    fn a_velocity_found_only_now_is_no_acceleration() {
        // 50 m/s^2 less the part that is noise.
        let sure = found(1.0, 0.1);
        assert!((sure - 50.0).abs() < 0.2, "{sure}");
        assert_eq!(found(1.0, 7.0), 0.0);
        // However large it is: what is claimed of the first may be too little.
        assert_eq!(found(5.0, 2.0), 0.0);
    }
}
