//! The receiver's clock as a filter of eight states has to see it.

use gnss_nav::dynamics::ClockNoise;
use gnss_signal::tracking::FrequencyPairs;

/// `clock` as seen once every `interval_s` through Dopplers of `pairs` over `measure_s` each, s.
///
/// White frequency noise S_f does not stay out of a mean frequency, the same for all satellites: from one
/// epoch to the next it changes by 8/3 S_f / T of halves, by 2 S_f / T (1 - measure / (2 T)) of successive
/// sums (T the interval; variances). A filter with one state for the drift knows that noise in the clock's
/// bias alone, and takes it for contradictions of all satellites at once. As a walk of the drift it is told
/// the truth about an interval, and too much about longer gaps.
#[must_use]
pub fn seen_by_dopplers(
    clock: ClockNoise,
    pairs: FrequencyPairs,
    measure_s: f64,
    interval_s: f64,
) -> ClockNoise {
    let factor = match pairs {
        FrequencyPairs::Halves => 8.0 / 3.0,
        FrequencyPairs::Successive => 2.0 - measure_s / interval_s,
    };
    let change_m2_s2 = factor * clock.white_m2_per_s / interval_s;
    ClockNoise {
        random_walk_m2_per_s3: clock.random_walk_m2_per_s3 + change_m2_s2 / interval_s,
        ..clock
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Mean square of the change of the measured drift from epoch to epoch, of white frequency noise of
    /// unit density: clock steps of a millisecond, averaged as sums average phases.
    fn simulated(pairs: FrequencyPairs, measure_ms: usize, interval_ms: usize) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut bias = 0.0;
        let steps = 2_000 * interval_ms;
        let biases: Vec<f64> = (0..steps)
            .map(|_| {
                let step: f64 = StandardNormal.sample(&mut random);
                bias += step * 1e-3f64.sqrt();
                bias
            })
            .collect();
        let sums_ms = match pairs {
            FrequencyPairs::Halves => measure_ms / 2,
            FrequencyPairs::Successive => measure_ms,
        };
        let mean = |k: usize| biases[k..k + sums_ms].iter().sum::<f64>() / sums_ms as f64;
        let drift = |k: usize| (mean(k + sums_ms) - mean(k)) / (1e-3 * sums_ms as f64);
        let epoch = |begin: usize| {
            let starts = (begin..begin + interval_ms).step_by(measure_ms);
            starts.map(drift).sum::<f64>() / (interval_ms / measure_ms) as f64
        };
        let begins = (0..steps - 2 * interval_ms - sums_ms).step_by(interval_ms);
        let squares = begins.map(|k| (epoch(k + interval_ms) - epoch(k)).powi(2));
        squares.sum::<f64>() / 1_998.0
    }

    #[test]
    fn the_drift_walks_as_mean_frequencies_change() {
        let clock = ClockNoise {
            white_m2_per_s: 1.0,
            random_walk_m2_per_s3: 0.5,
        };
        for (pairs, measure_ms, interval_ms) in [
            (FrequencyPairs::Halves, 20, 20),
            (FrequencyPairs::Halves, 20, 100),
            (FrequencyPairs::Successive, 10, 10),
            (FrequencyPairs::Successive, 10, 100),
        ] {
            let interval_s = 1e-3 * interval_ms as f64;
            let seen = seen_by_dopplers(clock, pairs, 1e-3 * measure_ms as f64, interval_s);
            let ours = (seen.random_walk_m2_per_s3 - 0.5) * interval_s;
            let ratio = ours / simulated(pairs, measure_ms, interval_ms);
            // 2000 correlated changes: 5 %; sums of ten steps of a millisecond: 1 %.
            assert!(
                (0.85..1.15).contains(&ratio),
                "{pairs:?} {interval_ms}: {ratio}"
            );
        }
    }
}
