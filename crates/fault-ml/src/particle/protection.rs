//! Protection levels from what the particles of all filters believe.

use nalgebra::{Matrix3, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::ParticleRaim;
use super::cloud::Cloud;
use crate::MonitorError;
use crate::error::within;

/// How often an error may exceed its protection level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntegrityRisk {
    /// Probability that the error exceeds the level unnoticed, 1e-12 to 0.1. Default 1e-7.
    pub probability: f64,
    /// Probability that one given satellite is at fault, 1e-12 to 1. Default 1e-4.
    pub satellite_fault: f64,
}

impl Default for IntegrityRisk {
    fn default() -> Self {
        Self {
            probability: 1e-7,
            satellite_fault: 1e-4,
        }
    }
}

/// Bounds on the position error of the main filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProtectionLevels {
    /// Horizontal, m.
    pub horizontal_m: f64,
    /// Vertical, m.
    pub vertical_m: f64,
}

/// Factors from a standard deviation to a bound.
#[derive(Debug, Clone, Copy)]
struct Factors {
    horizontal: f64,
    vertical: f64,
}

impl Factors {
    /// Exceeded with `probability`: a Rayleigh law with the larger horizontal deviation, and a
    /// normal one on both sides. A probability of one or more needs no bound.
    fn exceeded_with(probability: f64) -> Self {
        if probability >= 1.0 {
            return Self {
                horizontal: 0.0,
                vertical: 0.0,
            };
        }
        Self {
            horizontal: (-2.0 * probability.ln()).sqrt(),
            vertical: -Normal::standard().inverse_cdf(0.5 * probability),
        }
    }
}

/// Position of a cloud: mean and the deviations that bound its spread.
#[derive(Debug, Clone, Copy)]
struct Spread {
    mean_m: Vector3<f64>,
    horizontal_m: f64,
    vertical_m: f64,
}

impl Spread {
    fn of(cloud: &Cloud, up: &Vector3<f64>) -> Option<Self> {
        let (mean, covariance) = cloud.moments();
        let position: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into();
        let inflation = sampling_inflation(cloud.effective())?;
        let level = Matrix3::identity() - up * up.transpose();
        let horizontal = (level * position * level).symmetric_eigenvalues().max();
        Some(Self {
            mean_m: mean.fixed_rows::<3>(0).into(),
            horizontal_m: (inflation * horizontal).sqrt(),
            vertical_m: (inflation * up.dot(&(position * up))).max(0.0).sqrt(),
        })
    }
}

/// A variance of n effective particles is below the truth by more than this factor once in a
/// hundred times: (n - 1) over the 1 % quantile of chi-square.
fn sampling_inflation(effective: f64) -> Option<f64> {
    let freedom = effective - 1.0;
    let quantile = ChiSquared::new(freedom).ok()?.inverse_cdf(0.01);
    (quantile > 0.0).then_some(freedom / quantile)
}

impl ParticleRaim {
    /// Protection levels of the main filter's position, where `up` is the unit vector upwards in
    /// the frame of the sights.
    ///
    /// One hypothesis without a fault, one for every satellite, risk shared half and half:
    /// K sigma of the main cloud, and for each satellite the distance of the main mean from that of
    /// the filter which never saw it, plus K sigma of that filter's cloud. The tails are those
    /// of a normal law with the cloud's covariance: fifty particles say nothing of 1e-7. A swarm
    /// that is not corrected has drawn its cloud together, and its levels are no bound.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a probability or `up` is not usable.
    ///
    /// Returns `None` where fewer than five satellites are in use or a cloud has collapsed.
    pub fn protection_levels(
        &self,
        up: &[f64; 3],
        risk: &IntegrityRisk,
    ) -> Result<Option<ProtectionLevels>, MonitorError> {
        within(
            "integrity risk",
            risk.probability,
            (1e-12, 0.1),
            "1e-12 to 0.1",
        )?;
        let prior = risk.satellite_fault;
        within(
            "probability of a satellite fault",
            prior,
            (1e-12, 1.0),
            "1e-12 to 1",
        )?;
        let up = Vector3::from(*up);
        within("length of up", up.norm(), (0.999, 1.001), "1")?;
        Ok(self.levels(&up, risk))
    }

    fn levels(&self, up: &Vector3<f64>, risk: &IntegrityRisk) -> Option<ProtectionLevels> {
        let satellites = self.filters_without_one().count();
        if satellites < 5 {
            return None;
        }
        let half = 0.5 * risk.probability;
        let clean = Factors::exceeded_with(half);
        let faulty = Factors::exceeded_with(half / (satellites as f64 * risk.satellite_fault));
        let main = Spread::of(self.main_filter().cloud(), up)?;
        let mut levels = ProtectionLevels {
            horizontal_m: clean.horizontal * main.horizontal_m,
            vertical_m: clean.vertical * main.vertical_m,
        };
        for filter in self.filters_without_one() {
            let spread = Spread::of(filter.cloud(), up)?;
            let apart_m = main.mean_m - spread.mean_m;
            let vertical_m = apart_m.dot(up);
            let horizontal_m = (apart_m - up * vertical_m).norm();
            let horizontal = horizontal_m + faulty.horizontal * spread.horizontal_m;
            let vertical = vertical_m.abs() + faulty.vertical * spread.vertical_m;
            levels.horizontal_m = levels.horizontal_m.max(horizontal);
            levels.vertical_m = levels.vertical_m.max(vertical);
        }
        Some(levels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_quantiles() {
        // 5 % two-sided: 1.95996 sigma; Rayleigh: sqrt(-2 ln 0.05) = 2.44775.
        let factors = Factors::exceeded_with(0.05);
        assert!((factors.vertical - 1.959_964).abs() < 1e-6);
        assert!((factors.horizontal - 2.447_747).abs() < 1e-6);
        assert_eq!(Factors::exceeded_with(1.5).vertical, 0.0);
    }

    #[test]
    fn few_particles_widen_the_levels() {
        // chi-square 1 % quantile of 49 degrees of freedom: 28.94 (Abramowitz1964, table 26.8
        // gives 29.71 for 50).
        let inflation = sampling_inflation(50.0).unwrap();
        assert!((inflation - 49.0 / 28.941).abs() < 1e-3, "{inflation}");
        assert!(sampling_inflation(1.0).is_none());
    }
}
