//! What sampling does to chip edges that stand still on the sample grid.
//!
//! An edge at x samples takes effect half way between two samples, at ceil(x) - 1/2. That averages
//! out unless a chip holds a whole number of samples, or a simple fraction of one more: then all
//! edges of an interval lag alike, and the code acts as if shifted by their mean lag. Exact where
//! the grid stands still or turns many times in an interval; in between the mean of the
//! correlation over a part of a turn is taken for that at the mean shift (error below 1/8 sample
//! near the peak).

/// A chip of this many samples, or a part of it with a denominator up to this, can be whole.
const LARGEST_DENOMINATOR: u32 = 4;
/// Turns of the grid from which edges average out.
const AVERAGED_TURNS: f64 = 4.0;

/// How the edges of an interval fall on the sample grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SampleGrid {
    samples_per_chip: f64,
    /// Chips after which the pattern repeats, nearly.
    chips: u32,
    /// Samples by which it drifts over the interval.
    drift: f64,
}

impl SampleGrid {
    /// The grid of `samples` samples of `samples_per_chip`; none where it averages out.
    pub(super) fn new(samples_per_chip: f64, samples: f64) -> Option<Self> {
        let periods = samples / samples_per_chip;
        let drift_over = |chips: u32| {
            let advance = f64::from(chips) * samples_per_chip;
            (advance - advance.round()) * periods / f64::from(chips)
        };
        (1..=LARGEST_DENOMINATOR)
            .map(|chips| (chips, drift_over(chips)))
            .find(|(_, drift)| drift.abs() < AVERAGED_TURNS)
            .map(|(chips, drift)| Self {
                samples_per_chip,
                chips,
                drift,
            })
    }

    /// Chips by which a code with phase `phase_chips` at the first sample acts delayed.
    pub(super) fn lag_chips(&self, phase_chips: f64) -> f64 {
        let first = (phase_chips.floor() + 1.0 - phase_chips) * self.samples_per_chip;
        let total: f64 = (0..self.chips)
            .map(|k| mean_lag_samples(first + f64::from(k) * self.samples_per_chip, self.drift))
            .sum();
        total / f64::from(self.chips) / self.samples_per_chip
    }
}

/// Mean of ceil(x) - 1/2 - x as x runs evenly from `start` to `start + drift`, samples.
fn mean_lag_samples(start: f64, drift: f64) -> f64 {
    if drift.abs() < 1e-6 {
        return start.ceil() - 0.5 - start;
    }
    // Integral of 1/2 - fraction, from a whole number on.
    let integral = |x: f64| {
        let fraction = x - x.floor();
        0.5 * fraction * (1.0 - fraction)
    };
    (integral(start + drift) - integral(start)) / drift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_edges_one_by_one() {
        let rate = 1.023e6;
        for (rate_hz, code_rate_hz, samples) in [
            (4.092e6, rate, 40_920.0),
            (4.092e6, rate + 3.2, 40_920.0),
            (16.368e6, rate - 1.7, 163_680.0),
            (1.5 * rate, rate + 0.4, 15_345.0),
        ] {
            let spc = rate_hz / code_rate_hz;
            let grid = SampleGrid::new(spc, samples).unwrap();
            for phase in [0.01, 0.3, 0.77] {
                let edges = (samples / spc) as u32;
                let sum: f64 = (1..=edges)
                    .map(|k| (f64::from(k) - phase) * spc)
                    .map(|x| x.ceil() - 0.5 - x)
                    .sum();
                let expected = sum / f64::from(edges) / spc;
                // A step of the sum instead of the integral: one edge in ten thousand.
                assert!((grid.lag_chips(phase) - expected).abs() < 2e-4);
            }
        }
    }

    #[test]
    fn other_rates_average_out() {
        for rate_hz in [2.6e6, 4.0e6, 5.0e6, 15.42e6] {
            assert_eq!(SampleGrid::new(rate_hz / 1.023e6, rate_hz * 0.01), None);
        }
    }
}
