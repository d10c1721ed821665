//! Protection levels by slopes (`Walter1995`).

use nalgebra::{Matrix2, Matrix4, Vector4};
use statrs::distribution::{ContinuousCDF, Normal};

use super::parity::row;
use super::{IntegritySettings, Solution};
use crate::NavError;
use crate::chi_square::chi_square_threshold;

/// Part of a variance that must be left in a residual for it to check its satellite.
const UNCHECKED: f64 = 1e-6;

/// Bounds on the error of a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProtectionLevels {
    /// Horizontal, m.
    pub horizontal_m: f64,
    /// Vertical, m.
    pub vertical_m: f64,
}

/// Levels of a solution that passed its test.
///
/// The slope of a satellite is the position error per square root of the chi-square that its fault
/// causes. Level = largest slope x square root of the threshold + k sigma, k the quantile of the
/// missed-detection probability. `None` where a satellite is checked by no other: its fault
/// would not show, whatever its size.
pub(super) fn levels(
    solution: &Solution,
    settings: &IntegritySettings,
) -> Result<Option<ProtectionLevels>, NavError> {
    let freedom = solution.degrees_of_freedom();
    if freedom == 0 {
        return Ok(None);
    }
    let missed = settings.missed_detection_probability;
    if !(missed > 0.0 && missed < 1.0) {
        return Err(NavError::Value {
            name: "missed-detection probability",
            value: missed.to_string(),
            expected: "more than 0 and less than 1",
        });
    }
    let threshold = chi_square_threshold(freedom, settings.false_alarm_probability)?;
    let quantile = -Normal::standard().inverse_cdf(missed);
    Ok(slopes(solution).map(|slopes| ProtectionLevels {
        horizontal_m: slopes.horizontal * threshold.sqrt() + quantile * slopes.horizontal_sigma_m,
        vertical_m: slopes.vertical * threshold.sqrt() + quantile * slopes.vertical_sigma_m,
    }))
}

struct Slopes {
    horizontal: f64,
    vertical: f64,
    horizontal_sigma_m: f64,
    vertical_sigma_m: f64,
}

fn slopes(solution: &Solution) -> Option<Slopes> {
    let whitened = || {
        solution.satellites.iter().map(|s| {
            let row = Vector4::from(row(s));
            (row / s.pseudorange_sigma_m, s.pseudorange_sigma_m)
        })
    };
    let normal = whitened().fold(Matrix4::zeros(), |n, (row, _)| n + row * row.transpose());
    let covariance = normal.cholesky()?.inverse();
    let plane: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into();
    let mut slopes = Slopes {
        horizontal: 0.0,
        vertical: 0.0,
        horizontal_sigma_m: plane.symmetric_eigenvalues().max().sqrt(),
        vertical_sigma_m: covariance[(2, 2)].sqrt(),
    };
    for (row, _) in whitened() {
        // Position error, and share of the fault left in the residuals, by one deviation.
        let shift = covariance * row;
        let checked = 1.0 - row.dot(&shift);
        if checked < UNCHECKED {
            return None;
        }
        let root = checked.sqrt();
        slopes.horizontal = slopes.horizontal.max(shift.x.hypot(shift.y) / root);
        slopes.vertical = slopes.vertical.max(shift.z.abs() / root);
    }
    Some(slopes)
}
