//! Accuracy in which both kinds weigh the same.

use super::Share;

/// Sensitivity and specificity, and their mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BalancedAccuracy {
    /// Faulty steps found faulty.
    pub sensitivity: Share,
    /// Healthy steps found healthy.
    pub specificity: Share,
}

impl BalancedAccuracy {
    /// Of decisions, each with the truth: (found faulty, is faulty).
    #[must_use]
    pub fn of(decisions: impl Iterator<Item = (bool, bool)>) -> Self {
        let mut counts = [[0; 2]; 2];
        for (found, truth) in decisions {
            counts[usize::from(truth)][usize::from(found)] += 1;
        }
        let [[right, false_alarms], [missed, detected]] = counts;
        Self {
            sensitivity: Share::of(detected, detected + missed),
            specificity: Share::of(right, right + false_alarms),
        }
    }

    /// Mean of sensitivity and specificity.
    #[must_use]
    pub const fn value(&self) -> f64 {
        0.5 * (self.sensitivity.value + self.specificity.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_weigh_the_same_whatever_their_number() {
        // 1 of 2 faulty found, 6 of 8 healthy left alone.
        let faulty = [(true, true), (false, true)];
        let healthy = [true, true, false, false, false, false, false, false].map(|f| (f, false));
        let found = BalancedAccuracy::of(faulty.into_iter().chain(healthy));
        assert_eq!(found.value(), 0.5 * (0.5 + 0.75));
        assert_eq!((found.sensitivity.trials, found.specificity.hits), (2, 6));
    }
}
