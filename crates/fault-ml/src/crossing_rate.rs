//! How often a moving sum of squared normal numbers crosses a level from below.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF};

/// Nodes of the quadrature; with twice as many the rate moves by less than 3e-6 of itself for
/// windows up to 3600 epochs.
const NODES: usize = 1_000;

/// A sum over a window of epochs, each adding a chi-square variable, all independent.
#[derive(Debug, Clone)]
pub(crate) struct MovingSum {
    /// What two successive windows share.
    shared: ChiSquared,
    /// What an epoch adds.
    epoch: ChiSquared,
    mean: f64,
}

impl MovingSum {
    /// Of `window` epochs (at least 2) with `freedom` degrees of freedom each (at least 1); `None`
    /// for fewer.
    pub(crate) fn new(window: usize, freedom: usize) -> Option<Self> {
        let shared = window.checked_sub(1)? * freedom;
        Some(Self {
            shared: ChiSquared::new(shared as f64).ok()?,
            epoch: ChiSquared::new(freedom as f64).ok()?,
            mean: (window * freedom) as f64,
        })
    }

    /// Probability that the sum is above `level` at an epoch and was not at the one before.
    ///
    /// With A what both windows share, x what enters and y what leaves: A + x > level >= A + y, that
    /// is the integral of p(A) Q(level - A) (1 - Q(level - A)) over 0 < A < level, Q(v) = P(x > v).
    /// A = level cos^2 and level - A = level sin^2 of the variable of integration take away the
    /// roots at both ends.
    pub(crate) fn crossing_probability(&self, level: f64) -> f64 {
        let step = std::f64::consts::FRAC_PI_2 / NODES as f64;
        (0..NODES)
            .map(|k| {
                let (sin, cos) = ((k as f64 + 0.5) * step).sin_cos();
                let (shared, rest) = (level * cos * cos, level * sin * sin);
                let enters = self.epoch.sf(rest);
                let jump = enters * (1.0 - enters);
                self.shared.pdf(shared) * jump * 2.0 * level * sin * cos * step
            })
            .sum()
    }

    /// Level above the mean that is crossed with `probability` per epoch; `None` where even the
    /// mean is crossed less often, or none is that rare.
    pub(crate) fn level(&self, probability: f64) -> Option<f64> {
        // Above zero where crossings are more frequent; nearly straight far out.
        let excess = |level| (self.crossing_probability(level) / probability).ln();
        let at = |level| (level, excess(level));
        let (mut low, mut high) = (at(self.mean), at(2.0 * self.mean + 100.0));
        if !(low.1 >= 0.0 && high.1 < 0.0) {
            return None;
        }
        // False position; an end that stays twice counts half (the Illinois rule).
        let mut kept_low = None;
        while high.0 - low.0 > 1e-12 * high.0 {
            let straight = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
            let inside = straight.is_finite() && low.0 < straight && straight < high.0;
            let next = at(if inside {
                straight
            } else {
                0.5 * (low.0 + high.0)
            });
            if next.1.abs() < 1e-9 {
                return Some(next.0);
            }
            let keeps_low = next.1 < 0.0;
            let again = kept_low == Some(keeps_low);
            if keeps_low {
                high = next;
                low.1 *= if again { 0.5 } else { 1.0 };
            } else {
                low = next;
                high.1 *= if again { 0.5 } else { 1.0 };
            }
            kept_low = Some(keeps_low);
        }
        Some(high.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_epochs_of_two_degrees_have_a_closed_form() {
        let sum = MovingSum::new(2, 2).unwrap();
        for level in [4.0, 10.0, 40.0] {
            // The integral of exp(-a/2)/2 exp(-v/2) (1 - exp(-v/2)), v = level - a.
            let e = f64::exp(-level / 2.0);
            let exact = 0.5 * e * (level - 2.0 * (1.0 - e));
            let ratio = sum.crossing_probability(level) / exact;
            assert!((ratio - 1.0).abs() < 1e-6, "{level}: {ratio}");
        }
    }

    #[test]
    fn a_level_has_its_probability() {
        for (window, freedom) in [(2, 1), (30, 1), (30, 2), (1_000, 2)] {
            let sum = MovingSum::new(window, freedom).unwrap();
            for probability in [1e-3, 1e-7, 1e-10] {
                let level = sum.level(probability).unwrap();
                let found = sum.crossing_probability(level);
                assert!(
                    (found / probability - 1.0).abs() < 1e-6,
                    "{window} {freedom}"
                );
            }
        }
        let sum = MovingSum::new(30, 1).unwrap();
        assert_eq!(sum.level(0.9), None);
        assert_eq!(sum.level(0.0), None);
        assert!(MovingSum::new(0, 1).is_none() && MovingSum::new(1, 1).is_none());
    }
}
