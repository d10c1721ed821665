//! Thresholds for a stated false-alarm rate, from scores of healthy channels.

use serde::{Deserialize, Serialize};

use super::LearnedError;
use crate::error::within;
use crate::metrics::RateInterval;

/// Largest scores of healthy channels that the tail is fitted to.
const TAIL_PEAKS: usize = 40;
/// Alarms due from which on the last of them is the threshold: it needs no tail.
const ENOUGH_DUE: f64 = 3.0;

/// Healthy runs of scores, step by step.
#[derive(Debug, Clone, Default)]
pub struct HealthyScores {
    /// Peaks that nothing near exceeds: one alarm each, whatever the threshold below them.
    peaks: Vec<f64>,
    hours: f64,
}

/// A threshold and what is known of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OperatingPoint {
    /// Faulty above, log-odds.
    pub threshold: f64,
    /// False alarms of a channel an hour that it was chosen for.
    pub false_alarms_per_hour: f64,
    /// Healthy channel-hours it was found on.
    pub channel_hours: f64,
    /// Whether fewer than three alarms were due in them, so that a tail was drawn on.
    pub extrapolated: bool,
}

impl HealthyScores {
    /// Takes the scores of one healthy channel, `interval_s` apart. Of every `apart` steps the largest counts, and only
    /// where those of the steps before and after do not exceed it: they belong to the same alarm.
    pub fn add(&mut self, scores: &[f64], interval_s: f64, apart: usize) {
        self.hours += scores.len() as f64 * interval_s / 3600.0;
        let largest = |block: &[f64]| block.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let blocks: Vec<f64> = scores.chunks(apart.max(1)).map(largest).collect();
        let mut before = f64::NEG_INFINITY;
        for (number, peak) in blocks.iter().enumerate() {
            let after = blocks.get(number + 1).unwrap_or(&f64::NEG_INFINITY);
            if *peak > before && peak >= after {
                self.peaks.push(*peak);
            }
            before = *peak;
        }
    }

    /// Takes those of other channels.
    pub fn join(&mut self, other: Self) {
        self.peaks.extend(other.peaks);
        self.hours += other.hours;
    }

    /// Channel-hours taken.
    #[must_use]
    pub const fn hours(&self) -> f64 {
        self.hours
    }

    /// False alarms an hour above `threshold`, with the interval of 95 %.
    #[must_use]
    pub fn rate(&self, threshold: f64) -> RateInterval {
        let alarms = self.peaks.iter().filter(|peak| **peak > threshold).count();
        RateInterval::poisson(alarms, self.hours)
    }

    /// The threshold that `per_hour` false alarms an hour exceed. Where fewer than three are due in what was
    /// seen, the largest 40 peaks are continued by a tail: an estimate, to be confirmed.
    ///
    /// # Errors
    /// [`LearnedError::Value`] for a rate that is not above zero, or fewer than 40 blocks.
    pub fn operating_point(&self, per_hour: f64) -> Result<OperatingPoint, LearnedError> {
        within("false alarms an hour", per_hour, (1e-9, 1e9), "above 0")?;
        let count = self.peaks.len() as f64;
        within(
            "healthy blocks",
            count,
            (TAIL_PEAKS as f64 + 1.0, f64::MAX),
            "more than 40",
        )?;
        let mut sorted = self.peaks.clone();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let due = per_hour * self.hours;
        let extrapolated = due < ENOUGH_DUE;
        let threshold = if !extrapolated {
            // Others exceed the k-th largest of n hours k times in as many, on average.
            let last = (due as usize).saturating_sub(1);
            sorted.get(last).copied().unwrap_or(f64::NEG_INFINITY)
        } else {
            let base = sorted.get(TAIL_PEAKS).copied().unwrap_or_default();
            base + tail_excess(sorted.iter().take(TAIL_PEAKS).map(|peak| peak - base), due)
        };
        Ok(OperatingPoint {
            threshold,
            false_alarms_per_hour: per_hour,
            channel_hours: self.hours,
            extrapolated,
        })
    }
}

/// What `due` of the `excesses` over their common base lie above: a generalised Pareto tail by its moments
/// (Hosking1987), no heavier than an exponential one; scores that cannot exceed an end have a lighter one.
fn tail_excess(excesses: impl Iterator<Item = f64> + Clone, due: f64) -> f64 {
    let count = TAIL_PEAKS as f64;
    let mean = excesses.clone().sum::<f64>() / count;
    let variance = excesses.map(|e| (e - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let ratio = mean * mean / variance;
    let shape = (0.5 * (1.0 - ratio)).clamp(-1.0, 0.0);
    let rarer = count / due;
    if shape.is_nan() || shape >= -1e-6 {
        return mean * rarer.ln();
    }
    0.5 * mean * (ratio + 1.0) * (rarer.powf(shape) - 1.0) / shape
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::Exp1;

    use super::*;

    #[test]
    fn an_exponential_tail_is_continued() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let mut healthy = HealthyScores::default();
        // 10 hours of independent blocks of a second.
        let scores: Vec<f64> = (0..36_000).map(|_| random.sample(Exp1)).collect();
        healthy.add(&scores, 1.0, 1);
        assert!((healthy.hours() - 10.0).abs() < 1e-9);
        for per_hour in [0.01, 1.0, 10.0] {
            let point = healthy.operating_point(per_hour).unwrap();
            let exact = (3600.0 / per_hour).ln();
            // The scale is the mean of 40: 16 %; of ln(40 / due) at most 6, one deviation 0.95.
            assert!(
                (point.threshold - exact).abs() < 2.0,
                "{per_hour}: {point:?} {exact}"
            );
            assert_eq!(point.extrapolated, per_hour < 0.1);
        }
    }

    #[test]
    fn where_enough_are_due_the_last_of_them_is_the_threshold() {
        let mut healthy = HealthyScores::default();
        // 100 hours: peaks of 1 to 100, nothing between them.
        let scores: Vec<f64> = (0..200_u32)
            .map(|k| {
                if k % 2 == 0 {
                    0.0
                } else {
                    f64::from(k / 2 + 1)
                }
            })
            .collect();
        healthy.add(&scores, 1800.0, 1);
        let point = healthy.operating_point(0.03).unwrap();
        assert_eq!((point.threshold, point.extrapolated), (98.0, false));
        assert_eq!(healthy.rate(point.threshold).events, 2);
        assert_eq!(healthy.operating_point(0.0499).unwrap().threshold, 97.0);
        assert!(healthy.operating_point(0.0299).unwrap().extrapolated);
        // All others: 100 of 200 blocks are peaks.
        assert_eq!(healthy.rate(0.0).events, 100);
    }

    #[test]
    fn scores_with_an_end_keep_below_it() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let mut healthy = HealthyScores::default();
        let scores: Vec<f64> = (0..36_000).map(|_| random.random_range(0.0..1.0)).collect();
        healthy.add(&scores, 1.0, 1);
        let threshold = healthy.operating_point(0.01).unwrap().threshold;
        // The 40 largest of 36000 begin at 0.9989; an exponential tail would end above 1.004.
        assert!(threshold > 0.9989 && threshold < 1.0008, "{threshold}");
    }

    #[test]
    fn exceedances_that_hang_together_are_one_alarm() {
        let mut healthy = HealthyScores::default();
        let mut scores = vec![0.0; 100];
        // Across the boundary of two blocks of ten.
        scores[38..43].copy_from_slice(&[7.0, 8.0, 9.0, 8.0, 7.0]);
        healthy.add(&scores, 36.0, 10);
        assert_eq!(healthy.rate(5.0).events, 1);
        assert_eq!(healthy.rate(5.0).per_hour, 1.0);
        assert!(healthy.operating_point(0.0).is_err());
        assert!(healthy.operating_point(1.0).is_err());
    }
}
