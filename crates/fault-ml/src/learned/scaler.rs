//! Features brought to like size.

use super::Features;
use crate::MonitorError;
use crate::error::within;

/// Scaled features beyond this many deviations say no more than this many.
const FARTHEST: f32 = 8.0;

/// Subtracts a mean and divides by a deviation, feature by feature.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaler {
    means: Vec<f32>,
    deviations: Vec<f32>,
}

impl Scaler {
    /// From means and deviations of each feature.
    ///
    /// # Errors
    /// [`MonitorError::Value`] for as many of each as there are not, a mean that is no number or a
    /// deviation that is not above zero.
    pub fn new(means: Vec<f32>, deviations: Vec<f32>) -> Result<Self, MonitorError> {
        let (few, many) = (means.len(), deviations.len());
        let count = few as f64;
        within(
            "means",
            count,
            (many as f64, many as f64),
            "as many as deviations",
        )?;
        for (mean, deviation) in means.iter().zip(&deviations) {
            within("mean", f64::from(*mean), (-1e30, 1e30), "a number")?;
            within("deviation", f64::from(*deviation), (1e-30, 1e30), "above 0")?;
        }
        Ok(Self { means, deviations })
    }

    /// Mean and deviation of each feature of `rows`; a feature that never changes is left as it is.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where there are no rows.
    pub fn fit<'a>(rows: impl Iterator<Item = &'a Features> + Clone) -> Result<Self, MonitorError> {
        let count = rows.clone().count() as f64;
        within("rows to scale by", count, (1.0, f64::MAX), "at least 1")?;
        let width = rows.clone().next().map_or(0, |row| row.values().len());
        let mean = |value: &dyn Fn(&Features) -> f64| rows.clone().map(value).sum::<f64>() / count;
        let at = |row: &Features, k: usize| row.values().get(k).copied().map_or(0.0, f64::from);
        let (mut means, mut deviations) = (Vec::new(), Vec::new());
        for k in 0..width {
            let middle = mean(&|row| at(row, k));
            let deviation = mean(&|row| (at(row, k) - middle).powi(2)).sqrt();
            means.push(middle as f32);
            deviations.push(if deviation > 1e-12 {
                deviation as f32
            } else {
                1.0
            });
        }
        Self::new(means, deviations)
    }

    /// Features a step.
    #[must_use]
    pub fn width(&self) -> usize {
        self.means.len()
    }

    /// Means and deviations.
    #[must_use]
    pub fn parts(&self) -> (&[f32], &[f32]) {
        (&self.means, &self.deviations)
    }

    /// The scaled features, at most 8 either way.
    pub fn scaled<'a>(&'a self, features: &'a Features) -> impl Iterator<Item = f32> + 'a {
        let by = self.means.iter().zip(&self.deviations);
        features
            .values()
            .iter()
            .zip(by)
            .map(|(value, (mean, deviation))| {
                ((value - mean) / deviation).clamp(-FARTHEST, FARTHEST)
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::{ChannelStep, FeatureSet, FeatureTrack};

    fn features(code: f64, rate: f64) -> Features {
        let step = ChannelStep::normal(1, code / 8.0, rate / 0.2);
        FeatureTrack::new(FeatureSet::Paper).next(&step).unwrap()
    }

    #[test]
    fn rows_get_mean_zero_and_deviation_one() {
        let rows = [features(1.0, 5.0), features(3.0, 5.0), features(5.0, 5.0)];
        let scaler = Scaler::fit(rows.iter()).unwrap();
        let scaled: Vec<f32> = rows.iter().flat_map(|row| scaler.scaled(row)).collect();
        // Deviation sqrt(8/3); the second feature never changes.
        let one = (1.5_f32).sqrt();
        for (found, expected) in scaled.iter().zip([-one, 0.0, 0.0, 0.0, one, 0.0]) {
            // Single precision.
            assert!((found - expected).abs() < 1e-6, "{scaled:?}");
        }
        let far: Vec<f32> = scaler.scaled(&features(1e6, 5.0)).collect();
        assert_eq!(far, [8.0, 0.0]);
    }

    #[test]
    fn impossible_scales_are_refused() {
        assert!(Scaler::new(vec![0.0], vec![1.0, 1.0]).is_err());
        assert!(Scaler::new(vec![f32::NAN], vec![1.0]).is_err());
        assert!(Scaler::new(vec![0.0], vec![0.0]).is_err());
        assert!(Scaler::fit(std::iter::empty()).is_err());
    }
}
