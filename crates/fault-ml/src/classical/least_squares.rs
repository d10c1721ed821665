//! Least squares of one epoch: chi-square of the residuals, and each residual on its own.

use nalgebra::{Matrix4, Vector4};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::error::within;
use crate::{MonitorError, STATES, Sight};

/// Weighted least squares of the sights of one epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquaresFit {
    /// State, m about the reference point.
    pub state_m: [f64; STATES],
    /// Sum of squared residuals over their variances: chi-square of n - 4 degrees of freedom.
    pub chi_square: f64,
    /// Residual of each sight over its own standard deviation after the fit, in their order.
    pub standardised: Vec<f64>,
    /// Part of each variance that is left in the residual, 1 - leverage.
    pub redundancy: Vec<f64>,
}

impl LeastSquaresFit {
    /// Fits `sights`; `None` with fewer than four, or in a geometry that does not fix the state.
    ///
    /// standardised_s = r_s / (sigma_s sqrt(1 - leverage_s)); zero where nothing checks a sight.
    #[must_use]
    pub fn new(sights: &[Sight]) -> Option<Self> {
        let mut normal = Matrix4::zeros();
        let mut right = Vector4::zeros();
        for sight in sights {
            let design = Vector4::from(sight.design) / sight.sigma_m;
            normal += design * design.transpose();
            right += design * (sight.residual_m / sight.sigma_m);
        }
        let covariance = normal.cholesky()?.inverse();
        if !covariance.iter().all(|c| c.is_finite()) {
            return None;
        }
        let state = covariance * right;
        let mut fit = Self {
            state_m: state.into(),
            chi_square: 0.0,
            standardised: Vec::with_capacity(sights.len()),
            redundancy: Vec::with_capacity(sights.len()),
        };
        for sight in sights {
            fit.judge(sight, &covariance);
        }
        Some(fit)
    }

    fn judge(&mut self, sight: &Sight, covariance: &Matrix4<f64>) {
        let design = Vector4::from(sight.design) / sight.sigma_m;
        let ratio = sight.residual_about(&self.state_m) / sight.sigma_m;
        let redundancy = 1.0 - design.dot(&(covariance * design));
        // Rounding of a leverage of one; nothing checks such a sight.
        let checked = redundancy > 1e-9;
        self.chi_square += ratio * ratio;
        self.redundancy.push(if checked { redundancy } else { 0.0 });
        self.standardised.push(if checked {
            ratio / redundancy.sqrt()
        } else {
            0.0
        });
    }

    /// Index of the sight whose residual stands out most; none without redundancy.
    #[must_use]
    pub fn worst(&self) -> Option<usize> {
        let sizes = self.standardised.iter().map(|w| w.abs()).enumerate();
        let checked = sizes.filter(|(s, _)| self.redundancy[*s] > 0.0);
        checked.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(s, _)| s)
    }
}

/// Threshold of the chi-square of `satellites` residuals, exceeded without a fault with
/// `false_alarm_probability` in an epoch.
///
/// # Errors
/// [`MonitorError::Value`] where there is no redundancy or no such probability.
pub fn chi_square_threshold(
    satellites: usize,
    false_alarm_probability: f64,
) -> Result<f64, MonitorError> {
    let limits = (1e-15, 0.5);
    within(
        "false-alarm probability",
        false_alarm_probability,
        limits,
        "1e-15 to 0.5",
    )?;
    let freedom = satellites as f64 - STATES as f64;
    let law = ChiSquared::new(freedom).map_err(|_| MonitorError::Value {
        name: "satellites",
        value: satellites as f64,
        expected: "5 or more",
    })?;
    Ok(law.inverse_cdf(1.0 - false_alarm_probability))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sights(residuals_m: [f64; 5]) -> Vec<Sight> {
        let designs = [
            [-1.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 1.0],
            [0.0, -1.0, 0.0, 1.0],
            [0.0, 1.0, 0.0, 1.0],
            [0.0, 0.0, -1.0, 1.0],
        ];
        let sight = |(id, (design, residual_m))| Sight {
            id,
            design,
            residual_m,
            sigma_m: 2.0,
        };
        (0..)
            .zip(designs.into_iter().zip(residuals_m))
            .map(sight)
            .collect()
    }

    #[test]
    fn the_redundant_combination_alone_is_judged() {
        // East minus north pair: (y0 + y1 - y2 - y3) / 2 has deviation sigma and is what the
        // fifth degree of freedom sees; up is not checked by anything.
        let fit = LeastSquaresFit::new(&sights([4.0, 0.0, 0.0, 0.0, 9.0])).unwrap();
        assert!((fit.chi_square - 1.0).abs() < 1e-12, "{}", fit.chi_square);
        for (s, w) in [1.0, 1.0, -1.0, -1.0, 0.0].into_iter().enumerate() {
            assert!((fit.standardised[s] - w).abs() < 1e-12, "{s}");
        }
        assert_eq!(fit.redundancy[4], 0.0);
    }

    #[test]
    fn a_state_on_the_model_leaves_no_residual() {
        let state = [3.0, -2.0, 7.0, 11.0];
        let mut sights = sights([0.0; 5]);
        for sight in &mut sights {
            sight.residual_m = -sight.residual_about(&state);
        }
        let fit = LeastSquaresFit::new(&sights).unwrap();
        for (found, put) in fit.state_m.iter().zip(state) {
            assert!((found - put).abs() < 1e-12);
        }
        assert!(fit.chi_square < 1e-24);
    }

    #[test]
    fn too_few_or_all_in_one_direction_is_no_fit() {
        assert_eq!(LeastSquaresFit::new(&sights([0.0; 5])[..3]), None);
        let same = vec![sights([0.0; 5])[0]; 6];
        assert_eq!(LeastSquaresFit::new(&same), None);
    }

    #[test]
    fn thresholds_are_quantiles_of_chi_square() {
        // Five degrees of freedom, 1e-5: 30.86 (Abramowitz1964, 26.4).
        assert!((chi_square_threshold(9, 1e-5).unwrap() - 30.856).abs() < 1e-2);
        assert!(chi_square_threshold(4, 1e-5).is_err());
    }
}
