//! Evidence gathered over the steps of a channel.
//!
//! The log-odds of a step have an end: a model is no surer than the examples it has seen let it be, and a rare
//! enough alarm lies beyond. Their sum has none. The cumulative sum (Page1954) grows as long as a fault lasts and
//! starts anew where nothing speaks for one.

use serde::{Deserialize, Serialize};

/// What of a step's log-odds is evidence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvidenceRule {
    /// They count as far as they exceed this.
    pub offset: f64,
    /// No more than this counts of a step: what is plain but short, as a slip of the carrier, then gathers less than what
    /// lasts.
    pub most: f64,
}

/// The largest sum of log-odds less an offset over all stretches of steps that end now:
/// S(k) = min(z(k), most) - offset + max(0, S(k - 1)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    rule: EvidenceRule,
    largest: f64,
    sum: f64,
}

impl Evidence {
    /// None yet. No more than `largest` is kept, so that it is forgotten in good time once a fault has passed.
    #[must_use]
    pub const fn new(rule: EvidenceRule, largest: f64) -> Self {
        Self {
            rule,
            largest,
            sum: 0.0,
        }
    }

    /// Takes the log-odds of the next step and returns the sum.
    pub fn gather(&mut self, log_odds: f64) -> f64 {
        let counted = log_odds.min(self.rule.most) - self.rule.offset;
        self.sum = (counted + self.sum.max(0.0)).min(self.largest);
        self.sum
    }

    /// Forgets everything.
    pub const fn clear(&mut self) {
        self.sum = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_is_the_largest_sum_that_ends_now(odds in prop::collection::vec(-4.0..4.0f64, 1..30)) {
            let rule = EvidenceRule { offset: 0.5, most: 2.5 };
            let mut evidence = Evidence::new(rule, f64::INFINITY);
            for k in 0..odds.len() {
                let found = evidence.gather(odds[k]);
                let sum = |j: usize| odds[j..=k].iter().map(|z| z.min(2.5) - 0.5).sum::<f64>();
                let expected = (0..=k).map(sum).fold(f64::NEG_INFINITY, f64::max);
                // Sums in another order: 30 roundings of numbers below 200.
                prop_assert!((found - expected).abs() < 1e-11);
            }
            evidence.clear();
            prop_assert_eq!(evidence, Evidence::new(rule, f64::INFINITY));
        }
    }

    #[test]
    fn no_more_is_kept_than_said() {
        let rule = EvidenceRule {
            offset: 1.0,
            most: 9.0,
        };
        let mut evidence = Evidence::new(rule, 6.0);
        let sums = [5.0, 5.0, -2.0, -2.0, -2.0].map(|z| evidence.gather(z));
        assert_eq!(sums, [4.0, 6.0, 3.0, 0.0, -3.0]);
    }
}
