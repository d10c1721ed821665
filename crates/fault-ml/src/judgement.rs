//! A score held against its threshold.

use crate::MonitorError;

/// What a monitor says of what it watches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Health {
    /// The score does not exceed the threshold.
    Healthy,
    /// The score exceeds the threshold.
    Faulty,
    /// Too little seen yet to judge; this passes by itself.
    WarmingUp,
    /// Cannot be judged with what is there.
    Unavailable,
}

/// A score and its threshold; faulty exactly where the score exceeds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    score: f64,
    threshold: f64,
}

impl Judgement {
    /// Holds `score` against `threshold`, in the monitor's own unit.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where either is NaN: such a score would never be faulty.
    pub fn new(score: f64, threshold: f64) -> Result<Self, MonitorError> {
        for (name, value) in [("score", score), ("threshold", threshold)] {
            if value.is_nan() {
                return Err(MonitorError::Value {
                    name,
                    value,
                    expected: "a number",
                });
            }
        }
        Ok(Self { score, threshold })
    }

    /// The score.
    #[must_use]
    pub const fn score(&self) -> f64 {
        self.score
    }

    /// The threshold.
    #[must_use]
    pub const fn threshold(&self) -> f64 {
        self.threshold
    }

    /// [`Health::Faulty`] or [`Health::Healthy`].
    #[must_use]
    pub fn health(&self) -> Health {
        if self.score > self.threshold {
            Health::Faulty
        } else {
            Health::Healthy
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faulty_is_above_the_threshold_and_nothing_else() {
        let health = |score, threshold| Judgement::new(score, threshold).unwrap().health();
        assert_eq!(health(3.0, 2.0), Health::Faulty);
        assert_eq!(health(2.0, 2.0), Health::Healthy);
        assert_eq!(health(2.0_f64.next_up(), 2.0), Health::Faulty);
        assert_eq!(health(f64::NEG_INFINITY, -3.0), Health::Healthy);
        assert_eq!(health(f64::INFINITY, 1e308), Health::Faulty);
    }

    #[test]
    fn what_is_no_number_is_refused_by_name() {
        let error = Judgement::new(f64::NAN, 1.0).unwrap_err();
        assert_eq!(error.to_string(), "score is NaN: expected a number");
        assert!(Judgement::new(1.0, f64::NAN).is_err());
    }
}
