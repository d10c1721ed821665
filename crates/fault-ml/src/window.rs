//! Sums of log-likelihood ratios over every window that ends now.

/// Increments of the last epochs, and the largest sum of those that end with the newest:
/// S(k) = max over k - U < j <= k of s(j) + ... + s(k), Wang2016 (11) and (12).
#[derive(Debug, Clone, PartialEq)]
pub struct CumulativeRatio {
    /// Newest last; a ring once full.
    increments: Vec<f64>,
    longest: usize,
    newest: usize,
}

impl CumulativeRatio {
    /// Nothing seen yet; windows reach back `longest` epochs at most, at least one.
    #[must_use]
    pub fn new(longest: usize) -> Self {
        let longest = longest.max(1);
        Self {
            increments: Vec::with_capacity(longest),
            longest,
            newest: 0,
        }
    }

    /// Takes the increment of the next epoch.
    pub fn push(&mut self, increment: f64) {
        if self.increments.len() < self.longest {
            self.newest = self.increments.len();
            self.increments.push(increment);
        } else {
            self.newest = (self.newest + 1) % self.longest;
            self.increments[self.newest] = increment;
        }
    }

    /// max over j of the sum from j to now, of the last `longest` epochs; minus infinity at first.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let (older, newer) = self
            .increments
            .split_at((self.newest + 1).min(self.increments.len()));
        let backwards = older.iter().rev().chain(newer.iter().rev());
        let start = (0.0, f64::NEG_INFINITY);
        let (_, largest) = backwards.fold(start, |(sum, largest), increment| {
            let sum: f64 = sum + increment;
            (sum, f64::max(largest, sum))
        });
        largest
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.increments.clear();
        self.newest = 0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_largest_sum_is_that_of_all_starts(
            increments in prop::collection::vec(-5.0..5.0f64, 1..40), longest in 1usize..12
        ) {
            let mut ratio = CumulativeRatio::new(longest);
            prop_assert_eq!(ratio.largest(), f64::NEG_INFINITY);
            for k in 0..increments.len() {
                ratio.push(increments[k]);
                let first = (k + 1).saturating_sub(longest);
                let sum = |j: usize| increments[j..=k].iter().sum::<f64>();
                let expected = (first..=k).map(sum).fold(f64::NEG_INFINITY, f64::max);
                // Sums in another order: 40 roundings of numbers below 200.
                prop_assert!((ratio.largest() - expected).abs() < 1e-11);
            }
            ratio.clear();
            prop_assert_eq!(ratio.largest(), f64::NEG_INFINITY);
        }
    }
}
