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

/// Velocities of the last epochs, ECEF, m/s.
#[derive(Debug, Clone, Default)]
pub(super) struct Velocities(VecDeque<(GpsTime, Vector3<f64>)>);

impl Velocities {
    /// Keeps the velocity of an epoch.
    pub(super) fn remember(&mut self, state: &NavState) {
        self.0.push_back((state.time, state.velocity_ecef_mps));
        self.0.retain(|(time, _)| state.time - *time <= SPAN_S);
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Mean acceleration of the receiver, ECEF, m/s^2, as far as it stands out of the noise of velocities
    /// with `covariance`; none where the last epoch was not `measured`.
    pub(super) fn mean_acceleration_mps2(
        &self,
        covariance: &Covariance,
        measured: bool,
    ) -> Vector3<f64> {
        let (Some((since, before)), Some((now, after))) = (self.0.front(), self.0.back()) else {
            return Vector3::zeros();
        };
        let span_s = *now - *since;
        if !measured || span_s < SPAN_S / 2.0 {
            return Vector3::zeros();
        }
        let mean = (after - before) / span_s;
        let variance: f64 = [1, 3, 5].iter().map(|i| covariance[(*i, *i)]).sum();
        let noise = 2.0 * variance / (span_s * span_s);
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
