//! Both filters against a dense reference, an independent program, and statistics.

mod consistency;
mod equivalence;
mod fault_logic;
mod given_others;
mod golden;
mod jacobian;
mod reference;
mod refusals;
mod updates;

use nalgebra::{Cholesky, SVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::correction::{Correct, Corrected};
use super::covariance::{Blocks, Covariance, STATES};
use super::row::{Observable, Row};
use super::{Ekf, FilterSettings, Gate};
use crate::NavState;
use crate::made_up_sky::{self, normal};
use crate::measurement::ErrorModel;

/// States in the order of the papers.
type States = SVector<f64, STATES>;

/// Settings for made-up measurements: their noise is all there is, and nothing is skipped.
fn ungated() -> FilterSettings {
    let mut settings = FilterSettings {
        gate: Gate::Off,
        ..FilterSettings::default()
    };
    settings.model.errors = ErrorModel::TRACKING_NOISE_ONLY;
    settings
}

/// Of a filter that has run for a while: 5 m and 0.5 m/s.
fn settled() -> Covariance {
    Covariance::from_diagonal(&States::from_fn(
        |i, _| if i % 2 == 0 { 25.0 } else { 0.25 },
    ))
}

fn start<Way>(state: NavState, settings: FilterSettings) -> Ekf<Way> {
    Ekf::new(state, settled(), settings).unwrap()
}

/// A vector of independent numbers of mean 0 and variance 1.
fn normals(rng: &mut ChaCha8Rng) -> States {
    States::from_fn(|_, _| normal(rng))
}

/// An error drawn from `covariance`.
fn draw(covariance: &Covariance, rng: &mut ChaCha8Rng) -> States {
    Cholesky::new(*covariance).unwrap().l() * normals(rng)
}

/// `state` displaced by `error`.
fn displaced(state: &NavState, error: &States) -> NavState {
    let mut there = *state;
    for axis in 0..3 {
        there.position_ecef_m[axis] += error[2 * axis];
        there.velocity_ecef_mps[axis] += error[2 * axis + 1];
    }
    there.clock_bias_m += error[6];
    there.clock_drift_mps += error[7];
    there
}

/// A row with its zeros.
fn dense(row: &Row) -> States {
    States::from_fn(|i, _| row.element(i))
}

/// Error and covariance, in the order of the papers, by one of the ways.
fn correct<Way: Correct>(p: &Covariance, rows: &[Row]) -> (States, Covariance, f64) {
    let corrected = Way::correct(&Blocks::from_interleaved(p), rows.iter().copied());
    let Corrected {
        error,
        covariance,
        normalised_squared,
        count,
    } = corrected.unwrap();
    assert_eq!(count, rows.len());
    let halves = [error.offset, error.rate];
    let error = States::from_fn(|i, _| halves[i % 2][i / 2]);
    (error, covariance.interleaved(), normalised_squared)
}

/// A covariance with correlations, scaled as one of a filter is.
fn random_covariance(rng: &mut ChaCha8Rng) -> Covariance {
    let root = Covariance::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let scale = States::from_fn(|i, _| if i % 2 == 0 { 10.0 } else { 0.5 });
    let scale = Covariance::from_diagonal(&scale);
    let p = scale * (root * root.transpose() + Covariance::identity() * 0.1) * scale;
    (p + p.transpose()) * 0.5
}

/// Pseudorange and range rate of `satellites` in random directions.
fn random_rows(satellites: usize, rng: &mut ChaCha8Rng) -> Vec<Row> {
    (0..satellites)
        .flat_map(|_| {
            let direction = nalgebra::Vector3::from_fn(|_, _| normal(rng)).normalize();
            let gradient = direction.push(1.0);
            [
                Row {
                    observable: Observable::Pseudorange,
                    gradient,
                    residual: 10.0 * normal(rng),
                    variance: rng.random_range(1.0..100.0),
                },
                Row {
                    observable: Observable::RangeRate,
                    gradient,
                    residual: 0.5 * normal(rng),
                    variance: rng.random_range(1e-3..0.1),
                },
            ]
        })
        .collect()
}

/// Largest difference of two covariances in units of the deviations of `b`.
fn covariance_difference(a: &Covariance, b: &Covariance) -> f64 {
    let scale = |i: usize, j: usize| (b[(i, i)] * b[(j, j)]).sqrt();
    (0..STATES)
        .flat_map(|i| (0..STATES).map(move |j| (i, j)))
        .map(|(i, j)| ((a[(i, j)] - b[(i, j)]) / scale(i, j)).abs())
        .fold(0.0, f64::max)
}

/// Largest difference of two states over their size, no less than the deviations of `covariance`.
fn state_difference(a: &States, b: &States, covariance: &Covariance) -> f64 {
    (0..STATES)
        .map(|i| (a[i] - b[i]).abs() / b[i].abs().max(covariance[(i, i)].sqrt()))
        .fold(0.0, f64::max)
}
