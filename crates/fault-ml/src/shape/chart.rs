//! The chart of exponentially weighted means.

use crate::MonitorError;
use crate::error::within;

/// Settings of an [`EwmaChart`]; the defaults are those of the paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartSettings {
    /// Mean of what is observed while nothing is wrong, mu. Default 0.
    pub target: f64,
    /// Its deviation, sigma, in the same unit. Default 0.0498 (chips): 1 ms at 44 dB-Hz alone.
    pub sigma: f64,
    /// Weight of the newest value, lambda, above 0 and at most 1. Default 0.02: a mean over some 50.
    pub lambda: f64,
    /// Distance of the limits from the target, L, deviations of the mean. Default 6.
    pub width: f64,
}

impl Default for ChartSettings {
    fn default() -> Self {
        Self {
            target: 0.0,
            sigma: 0.0498,
            lambda: 0.02,
            width: 6.0,
        }
    }
}

impl ChartSettings {
    /// Half the distance of the limits after `steps` steps, equations (9) and (10); in the limit
    /// for very many.
    #[must_use]
    pub fn limit(&self, steps: u32) -> f64 {
        let left = (1.0 - self.lambda).powf(2.0 * f64::from(steps));
        self.width * self.sigma * (self.share() * (1.0 - left)).sqrt()
    }

    /// Variance of the mean over that of a value, after very many steps.
    const fn share(&self) -> f64 {
        self.lambda / (2.0 - self.lambda)
    }
}

/// Exponentially weighted mean of a sequence and the limits it is held against (6) to (10).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EwmaChart {
    settings: ChartSettings,
    mean: f64,
    /// Square of the weight that the target still has in the mean, and by what it falls a step.
    left: f64,
    fall: f64,
    /// Variance of the mean over that of a value, in the end.
    share: f64,
}

impl EwmaChart {
    /// A chart at its target.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a setting is out of its range.
    pub fn new(settings: ChartSettings) -> Result<Self, MonitorError> {
        let finite = (f64::MIN, f64::MAX);
        let positive = (f64::MIN_POSITIVE, f64::MAX);
        within("target", settings.target, finite, "a finite number")?;
        within("sigma", settings.sigma, positive, "more than 0, and finite")?;
        within(
            "lambda",
            settings.lambda,
            (f64::MIN_POSITIVE, 1.0),
            "above 0 and at most 1",
        )?;
        within(
            "width of the limits",
            settings.width,
            positive,
            "more than 0, and finite",
        )?;
        Ok(Self {
            settings,
            mean: settings.target,
            left: 1.0,
            fall: (1.0 - settings.lambda).powi(2),
            share: settings.share(),
        })
    }

    /// Takes a value; returns the new mean, Z.
    pub fn step(&mut self, value: f64) -> f64 {
        self.mean += self.settings.lambda * (value - self.mean);
        self.left *= self.fall;
        // No longer seen beside one; it would never become zero, only a number that is slow to multiply by.
        if self.left < f64::EPSILON / 4.0 {
            self.left = 0.0;
        }
        self.mean
    }

    /// The mean, Z.
    #[must_use]
    pub const fn mean(&self) -> f64 {
        self.mean
    }

    /// Distance of the mean from the target.
    #[must_use]
    pub fn distance(&self) -> f64 {
        (self.mean - self.settings.target).abs()
    }

    /// Half the distance of the limits at this step: upper and lower limit lie so far from the target.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.settings.width * self.settings.sigma * self.mean_variance_of(1.0).sqrt()
    }

    /// Variance of the mean at this step (8), for values of another `variance` than was set.
    #[must_use]
    pub fn mean_variance_of(&self, variance: f64) -> f64 {
        variance * self.share * (1.0 - self.left)
    }

    /// Whether the mean is outside its limits.
    #[must_use]
    pub fn is_outside(&self) -> bool {
        self.distance() > self.limit()
    }

    /// Back to the target.
    pub const fn reset(&mut self) {
        self.mean = self.settings.target;
        self.left = 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::{numbers, text};

    #[test]
    fn limits_end_where_they_would_for_ever() {
        let mut chart = EwmaChart::new(ChartSettings::default()).unwrap();
        for _ in 0..20_000 {
            chart.step(0.01);
        }
        assert_eq!(chart.left, 0.0);
        assert_eq!(chart.limit(), ChartSettings::default().limit(u32::MAX));
    }

    #[test]
    fn limits_are_those_of_the_reference() {
        let Some(text) = text("golden.json") else {
            return;
        };
        let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
        let steady = golden
            .pointer("/ewma/ucl_steady")
            .unwrap()
            .as_f64()
            .unwrap();
        let settings = ChartSettings::default();
        assert!((settings.limit(u32::MAX) - steady).abs() < 1e-6);
        let first = numbers(&golden, "/ewma/ucl_i");
        for (steps, expected) in [1, 2, 10, 100].into_iter().zip(first) {
            let mut chart = EwmaChart::new(settings).unwrap();
            (0..steps).for_each(|_| _ = chart.step(0.0));
            for found in [settings.limit(steps), chart.limit()] {
                assert!(
                    (found - expected).abs() < 1e-6,
                    "{steps}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn the_mean_is_the_weighted_sum_of_all_values() {
        let settings = ChartSettings {
            target: 0.3,
            lambda: 0.1,
            ..ChartSettings::default()
        };
        let mut chart = EwmaChart::new(settings).unwrap();
        let values = [1.0, -2.0, 0.5, 4.0];
        values.iter().for_each(|v| _ = chart.step(*v));
        // Equation (7).
        let weighted = values.iter().rev().enumerate();
        let sum: f64 = weighted
            .map(|(k, v)| 0.1 * 0.9_f64.powi(k as i32) * v)
            .sum();
        let expected = sum + 0.9_f64.powi(4) * 0.3;
        assert!((chart.mean() - expected).abs() < 1e-12);
        assert!(chart.is_outside());
        chart.reset();
        assert_eq!((chart.mean(), chart.limit()), (0.3, 0.0));
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        let base = ChartSettings::default();
        let refused = |settings, name| {
            let error = EwmaChart::new(settings).unwrap_err().to_string();
            assert!(error.starts_with(name), "{error}");
        };
        refused(
            ChartSettings {
                lambda: 0.0,
                ..base
            },
            "lambda",
        );
        refused(
            ChartSettings {
                lambda: 1.1,
                ..base
            },
            "lambda",
        );
        refused(ChartSettings { sigma: 0.0, ..base }, "sigma");
        refused(
            ChartSettings {
                width: f64::NAN,
                ..base
            },
            "width",
        );
        refused(
            ChartSettings {
                target: f64::NAN,
                ..base
            },
            "target",
        );
    }
}
