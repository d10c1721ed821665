//! How long a chart runs until it alarms.

use nalgebra::{DMatrix, DVector};

use crate::MonitorError;
use crate::error::within;

/// States each side of the target in the coarser of two chains.
const HALF_STATES: usize = 100;

/// Mean number of steps until a chart of weight `lambda` leaves limits `limit` from its target 0, both
/// constant, by Brook and Evans: the chart as a Markov chain (`Brook1972`).
///
/// The values are independent, with `distribution` function P(T <= x). A chain's error falls with the
/// square of its states: two chains, of 201 and 401, are extrapolated to none. Good to 0.1 % for normal
/// values and weights from 0.02 on.
///
/// # Errors
/// [`MonitorError::Value`] for a weight outside 0 to 1, a limit that is not above zero, or one that is
/// not left at all.
pub fn average_run_length(
    lambda: f64,
    limit: f64,
    distribution: impl Fn(f64) -> f64,
) -> Result<f64, MonitorError> {
    let weights = (f64::MIN_POSITIVE, 1.0);
    within("lambda", lambda, weights, "above 0 and at most 1")?;
    let positive = (f64::MIN_POSITIVE, f64::MAX);
    within("limit", limit, positive, "more than 0, and finite")?;
    let [coarse, fine] = [1, 2].map(|n| of_chain(n * HALF_STATES, lambda, limit, &distribution));
    let length = (4.0 * fine - coarse) / 3.0;
    let left = (1.0, f64::MAX);
    within(
        "average run length",
        length,
        left,
        "a chart that is left at some time",
    )?;
    Ok(length)
}

/// Mean number of steps from the middle of a chain of `half_states` each side; infinite where it is
/// never left.
fn of_chain(
    half_states: usize,
    lambda: f64,
    limit: f64,
    distribution: &impl Fn(f64) -> f64,
) -> f64 {
    let states = 2 * half_states + 1;
    let width = 2.0 * limit / states as f64;
    let centre = |state: usize| (state as f64 - half_states as f64) * width;
    let mut stays = DMatrix::identity(states, states);
    for from in 0..states {
        let held = (1.0 - lambda) * centre(from);
        let below = |edge: f64| distribution((edge - held) / lambda);
        let mut lower = below(centre(0) - width / 2.0);
        for to in 0..states {
            let upper = below(centre(to) + width / 2.0);
            stays[(from, to)] -= upper - lower;
            lower = upper;
        }
    }
    let ones = DVector::from_element(states, 1.0);
    let lengths = stays.lu().solve(&ones);
    lengths.map_or(f64::INFINITY, |l| l[half_states])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::{matrix, text};
    use crate::shape::ChartSettings;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    fn steady_limit(lambda: f64, width: f64) -> f64 {
        let settings = ChartSettings {
            sigma: 1.0,
            lambda,
            width,
            ..ChartSettings::default()
        };
        settings.limit(u32::MAX)
    }

    #[test]
    fn run_lengths_are_those_of_the_reference() {
        let Some(text) = text("golden.json") else {
            return;
        };
        let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
        let rows = matrix(&golden, "/ewma/arl");
        assert!(rows.len() > 5);
        for row in rows {
            let [lambda, width, shift, expected] = row[..] else {
                unreachable!("four columns");
            };
            let limit = steady_limit(lambda, width);
            let normal = Normal::new(shift, 1.0).unwrap();
            // The reference is a chain of 201 states, not extrapolated.
            let chain = of_chain(100, lambda, limit, &|x| normal.cdf(x));
            assert!((chain / expected - 1.0).abs() < 1e-6, "{row:?} {chain}");
        }
    }

    #[test]
    fn run_lengths_are_those_of_the_integral_equation() {
        // Crowder's integral equation by Gauss-Legendre quadrature of 121 nodes, to ten digits.
        for (lambda, width, expected) in [
            (0.1, 2.814, 499.579_550),
            (0.05, 2.615, 499.933_006),
            (0.02, 3.0, 2_889.680_454),
            (0.02, 4.0, 77_471.502_844),
        ] {
            let normal = Normal::standard();
            let limit = steady_limit(lambda, width);
            let found = average_run_length(lambda, limit, |x| normal.cdf(x)).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-3, "{width} {found}");
        }
    }

    #[test]
    fn a_chart_without_memory_waits_for_one_value() {
        // Geometric: 1 / P(|T| > 2).
        let normal = Normal::standard();
        let length = average_run_length(1.0, 2.0, |x| normal.cdf(x)).unwrap();
        assert!((length - 0.5 / normal.sf(2.0)).abs() < 1e-6, "{length}");
    }

    #[test]
    fn values_of_three_steps_are_charted_like_any() {
        // P(-1) = P(1) = 0.1: the chain against a simulation.
        let (lambda, limit) = (0.2, 0.35);
        let steps = |x: f64| {
            0.1 * f64::from(u8::from(x >= -1.0))
                + 0.8 * f64::from(u8::from(x >= 0.0))
                + 0.1 * f64::from(u8::from(x >= 1.0))
        };
        let expected = average_run_length(lambda, limit, steps).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut run = || {
            let (mut mean, mut length) = (0.0, 0u32);
            while f64::abs(mean) <= limit {
                let drawn: f64 = rng.random();
                let value = f64::from(i8::from(drawn > 0.9)) - f64::from(i8::from(drawn < 0.1));
                mean += lambda * (value - mean);
                length += 1;
            }
            f64::from(length)
        };
        let runs = 20_000;
        let mean = (0..runs).map(|_| run()).sum::<f64>() / f64::from(runs);
        // Lengths scatter by as much as their mean: 0.7 % standard error, and 2 % for the states.
        assert!((mean / expected - 1.0).abs() < 0.045, "{mean} {expected}");
    }

    #[test]
    fn impossible_charts_are_refused() {
        let normal = Normal::standard();
        assert!(average_run_length(0.0, 1.0, |x| normal.cdf(x)).is_err());
        assert!(average_run_length(0.1, 0.0, |x| normal.cdf(x)).is_err());
        // Values that never move.
        let still = |x: f64| f64::from(u8::from(x >= 0.0));
        assert!(average_run_length(0.1, 1.0, still).is_err());
    }
}
