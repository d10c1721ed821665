//! Detection threshold for a stated probability of a false alarm.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::SignalError;

/// Thresholds of one search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Thresholds {
    /// Of the non-coherent sum.
    pub(super) sum: f64,
    /// Of a single power.
    pub(super) single: f64,
}

/// Thresholds of non-coherent sums and of a single one; see [`threshold`].
pub(super) fn thresholds(
    sums: u32,
    cells: f64,
    false_alarm_probability: f64,
) -> Result<Thresholds, SignalError> {
    Ok(Thresholds {
        sum: threshold(sums, cells, false_alarm_probability)?,
        single: threshold(1, cells, false_alarm_probability)?,
    })
}

/// Threshold of a non-coherent sum of `sums` powers, divided by its mean under noise, which one of
/// `cells` independent cells of white noise exceeds with `false_alarm_probability`: the sum is
/// chi-square with 2 `sums` degrees of freedom.
fn threshold(sums: u32, cells: f64, false_alarm_probability: f64) -> Result<f64, SignalError> {
    let degrees = 2.0 * f64::from(sums);
    let distribution = ChiSquared::new(degrees).map_err(|_| SignalError::Parameter {
        name: "non-coherent sums",
        value: sums.to_string(),
        expected: "at least 1",
    })?;
    // 1 - (1 - p)^(1/cells) without cancellation.
    let cell_probability = -((-false_alarm_probability).ln_1p() / cells).exp_m1();
    let (mut low, mut high) = (0.0, 2.0 * degrees + 1e3);
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if distribution.sf(middle) > cell_probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(high / degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sum_has_the_exponential_threshold() {
        // One power of complex noise is exponential: P(x > t) = exp(-t).
        let found = threshold(1, 1e6, 1e-3).unwrap();
        let exact = -(-(-1e-3_f64).ln_1p() / 1e6).ln();
        // exp_m1 of 1e-9 differs from its argument by 5e-10 of it.
        assert!((found - exact).abs() < 1e-6, "{found} {exact}");
    }

    #[test]
    fn more_sums_need_less_of_their_mean_and_more_cells_more() {
        let few = threshold(4, 1e6, 1e-3).unwrap();
        let many = threshold(100, 1e6, 1e-3).unwrap();
        assert!(many < few && many > 1.0);
        assert!(threshold(4, 1e8, 1e-3).unwrap() > few);
    }
}
