//! Covariance of the eight states, and how it grows from epoch to epoch.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::dynamics::ProcessNoise;

/// Error states, in the order of Jiang2017 (10):
/// x, vx, y, vy, z, vz (ECEF), clock bias, clock drift; m and m/s.
pub const STATES: usize = 8;

/// Covariance of the error states, m^2, m^2/s and m^2/s^2.
pub type Covariance = SMatrix<f64, STATES, STATES>;

/// Error states, m and m/s.
pub(super) type ErrorState = SVector<f64, STATES>;

/// Positions (or velocities) and clock: half of the states.
pub(super) const HALF: usize = STATES / 2;

/// P of `interval_s` later: F P F' + Q, F = four blocks [[1 T], [0 1]] (Jiang2017 (10), (16)).
///
/// Block by block: the products with ones and zeros of F are not made, and what is symmetric
/// stays so to the last bit.
pub(super) fn propagated(
    covariance: &Covariance,
    interval_s: f64,
    noise: &ProcessNoise,
    position_ecef_m: &Vector3<f64>,
) -> Covariance {
    let t = interval_s;
    let mut p = *covariance;
    for i in 0..HALF {
        for j in 0..HALF {
            let (bias_i, rate_i, bias_j, rate_j) = (2 * i, 2 * i + 1, 2 * j, 2 * j + 1);
            let rate = p[(rate_i, rate_j)];
            let mixed = p[(bias_i, rate_j)] + p[(rate_i, bias_j)];
            p[(bias_i, bias_j)] += t * mixed + t * t * rate;
            p[(bias_i, rate_j)] += t * rate;
            p[(rate_i, bias_j)] += t * rate;
        }
    }
    add_noise(&mut p, t, noise, position_ecef_m);
    p
}

/// Adds Q: for a density q driving a rate, [[q T^3 / 3, q T^2 / 2], [q T^2 / 2, q T]].
fn add_noise(p: &mut Covariance, t: f64, noise: &ProcessNoise, position_ecef_m: &Vector3<f64>) {
    let density = noise.acceleration.density_ecef(position_ecef_m);
    for (i, row) in density.iter().enumerate() {
        for (j, &q) in row.iter().enumerate() {
            add_rate_noise(p, i, j, q, t);
        }
    }
    add_rate_noise(p, 3, 3, noise.clock.random_walk_m2_per_s3, t);
    p[(6, 6)] += noise.clock.white_m2_per_s * t;
}

fn add_rate_noise(p: &mut Covariance, i: usize, j: usize, q: f64, t: f64) {
    p[(2 * i, 2 * j)] += q * t * t * t / 3.0;
    p[(2 * i, 2 * j + 1)] += q * t * t / 2.0;
    p[(2 * i + 1, 2 * j)] += q * t * t / 2.0;
    p[(2 * i + 1, 2 * j + 1)] += q * t;
}

/// Whether every variance is finite and not negative.
pub(super) fn has_variances(covariance: &Covariance) -> bool {
    (0..STATES).all(|i| covariance[(i, i)].is_finite() && covariance[(i, i)] >= 0.0)
}
