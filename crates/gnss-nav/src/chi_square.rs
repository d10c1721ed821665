//! Threshold of the residual test.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::NavError;

/// Value that a chi-square variable of `degrees_of_freedom` exceeds with
/// `false_alarm_probability`.
///
/// # Errors
/// [`NavError::Value`] unless there is a degree of freedom and the probability lies in (0, 1).
pub fn chi_square_threshold(
    degrees_of_freedom: usize,
    false_alarm_probability: f64,
) -> Result<f64, NavError> {
    if !(false_alarm_probability > 0.0 && false_alarm_probability < 1.0) {
        return Err(NavError::Value {
            name: "false alarm probability",
            value: false_alarm_probability.to_string(),
            expected: "more than 0 and less than 1",
        });
    }
    let distribution = ChiSquared::new(degrees_of_freedom as f64).map_err(|_| NavError::Value {
        name: "degrees of freedom",
        value: degrees_of_freedom.to_string(),
        expected: "at least 1",
    })?;
    Ok(distribution.inverse_cdf(1.0 - false_alarm_probability))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tabulated_quantiles() {
        // Any table of the distribution, three decimals.
        for (dof, p, expected) in [(1, 0.05, 3.841), (4, 0.001, 18.467), (10, 0.01, 23.209)] {
            let threshold = chi_square_threshold(dof, p).unwrap();
            assert!(
                (threshold - expected).abs() < 6e-4,
                "{threshold} {expected}"
            );
        }
        assert!(chi_square_threshold(0, 0.01).is_err());
        assert!(chi_square_threshold(3, f64::NAN).is_err());
    }
}
