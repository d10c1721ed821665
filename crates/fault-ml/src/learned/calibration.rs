//! From a raw score to odds: a straight line fitted on held-out scenarios (Platt1999).

use serde::{Deserialize, Serialize};

use super::LearnedError;
use crate::MonitorError;
use crate::error::within;

/// Newton steps at most; the problem is convex in two unknowns and takes about ten.
const STEPS: usize = 100;

/// log-odds of a fault = slope x raw score + offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Log-odds per unit of raw score.
    pub slope: f64,
    /// Log-odds of a raw score of zero.
    pub offset: f64,
}

impl Calibration {
    /// Takes the raw score for log-odds.
    pub const NONE: Self = Self {
        slope: 1.0,
        offset: 0.0,
    };

    /// Log-odds of a fault.
    #[must_use]
    pub fn log_odds(&self, raw: f64) -> f64 {
        self.slope * raw + self.offset
    }

    /// Refuses a line that does not rise.
    ///
    /// # Errors
    /// [`MonitorError::Value`].
    pub fn check(&self) -> Result<(), MonitorError> {
        within(
            "slope of the calibration",
            self.slope,
            (1e-12, 1e12),
            "above 0",
        )?;
        within(
            "offset of the calibration",
            self.offset,
            (-1e12, 1e12),
            "a number",
        )
    }

    /// Maximum likelihood over raw scores and whether they are of faulty steps; the targets are drawn in
    /// by a count of one, as Platt has it, so that separable scores stay finite.
    ///
    /// # Errors
    /// [`LearnedError::Value`] where either kind is missing or higher scores do not mean more faults.
    pub fn fit(scores: &[(f64, bool)]) -> Result<Self, LearnedError> {
        let faulty = scores.iter().filter(|(_, faulty)| *faulty).count() as f64;
        let healthy = scores.len() as f64 - faulty;
        within("faulty scores", faulty, (1.0, f64::MAX), "at least 1")?;
        within("healthy scores", healthy, (1.0, f64::MAX), "at least 1")?;
        let (high, low) = ((faulty + 1.0) / (faulty + 2.0), 1.0 / (healthy + 2.0));
        let rows = || {
            scores
                .iter()
                .map(|(x, f)| (*x, if *f { high } else { low }))
        };
        let mut line = Self {
            slope: 0.0,
            offset: (faulty / healthy).ln(),
        };
        for _ in 0..STEPS {
            let step = line.newton_step(rows());
            let before = line.loss(rows());
            // Halved until it helps.
            let mut share = 1.0;
            let next = loop {
                let next = Self {
                    slope: line.slope - share * step.slope,
                    offset: line.offset - share * step.offset,
                };
                if next.loss(rows()) <= before || share < 1e-9 {
                    break next;
                }
                share *= 0.5;
            };
            let moved = (next.slope - line.slope).abs() + (next.offset - line.offset).abs();
            line = next;
            if moved < 1e-10 {
                break;
            }
        }
        line.check()?;
        Ok(line)
    }

    /// Gradient times the inverse of the second derivative.
    fn newton_step(&self, rows: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut g, mut h) = ([0.0; 2], [1e-9, 0.0, 1e-9]);
        for (x, target) in rows {
            let p = sigmoid(self.log_odds(x));
            let (error, weight) = (p - target, p * (1.0 - p));
            g[0] += error * x;
            g[1] += error;
            h[0] += weight * x * x;
            h[1] += weight * x;
            h[2] += weight;
        }
        let determinant = h[0] * h[2] - h[1] * h[1];
        Self {
            slope: (h[2] * g[0] - h[1] * g[1]) / determinant,
            offset: (h[0] * g[1] - h[1] * g[0]) / determinant,
        }
    }

    /// Mean negative log-likelihood.
    fn loss(&self, rows: impl Iterator<Item = (f64, f64)>) -> f64 {
        let (sum, count) = rows.fold((0.0, 0.0), |(sum, count), (x, target)| {
            let z = self.log_odds(x);
            // ln(1 + exp(z)) - target z, without overflow.
            (
                sum + z.max(0.0) + (-z.abs()).exp().ln_1p() - target * z,
                count + 1.0,
            )
        });
        sum / count
    }
}

/// Probability of log-odds.
#[must_use]
pub fn sigmoid(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn known_odds_are_found_again() {
        let truth = Calibration {
            slope: 1.7,
            offset: -0.6,
        };
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut score = || {
            let raw = random.random_range(-4.0..4.0);
            (raw, random.random::<f64>() < sigmoid(truth.log_odds(raw)))
        };
        let scores: Vec<_> = (0..40_000).map(|_| score()).collect();
        let found = Calibration::fit(&scores).unwrap();
        // Standard errors of about 0.02 each; four of them.
        assert!((found.slope - truth.slope).abs() < 0.08, "{found:?}");
        assert!((found.offset - truth.offset).abs() < 0.08, "{found:?}");
    }

    #[test]
    fn separable_scores_stay_finite_and_useless_ones_are_refused() {
        let apart: Vec<_> = (0..50).map(|k| (f64::from(k), k >= 25)).collect();
        let line = Calibration::fit(&apart).unwrap();
        assert!(line.slope > 0.1 && line.slope.is_finite());
        // Half way between the two kinds.
        assert!(line.log_odds(24.5).abs() < 0.1);
        let reversed: Vec<_> = apart.iter().map(|(x, f)| (-x, *f)).collect();
        assert!(Calibration::fit(&reversed).is_err());
        assert!(Calibration::fit(&apart[..10]).is_err());
    }
}
