//! Protection levels by slopes (`Walter1995`).

use nalgebra::{Matrix2, Matrix3, Matrix4, Vector4};
use statrs::distribution::{ContinuousCDF, Normal};

use super::parity::row;
use super::{IntegritySettings, Solution};
use crate::NavError;
use crate::chi_square::chi_square_threshold;
use crate::geodesy::Look;

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

/// A satellite as protection levels see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ranged {
    /// Where it stands.
    pub look: Look,
    /// Standard deviation of its pseudorange, m.
    pub sigma_m: f64,
}

/// Levels of a solution that passed its test.
pub(super) fn levels(
    solution: &Solution,
    settings: &IntegritySettings,
) -> Result<Option<ProtectionLevels>, NavError> {
    let satellites: Vec<Ranged> = solution
        .satellites
        .iter()
        .map(|s| Ranged {
            look: s.look(),
            sigma_m: s.pseudorange_sigma_m,
        })
        .collect();
    levels_of(&satellites, None, settings)
}

/// Protection levels of a position from `satellites`, by weighted least squares of their variances; with
/// `covariance_enu_m2` (east, north, up; m^2) that of a filter, which settles where least squares would and
/// knows its own deviations.
///
/// The slope of a satellite is the position error per square root of the chi-square that its fault
/// causes. Level = largest slope x square root of the threshold + k sigma, k the quantile of the
/// missed-detection probability. `None` without a redundant satellite, or where one is checked by
/// no other: its fault would not show, whatever its size.
///
/// # Errors
/// [`NavError::Value`] for a probability outside (0, 1).
pub fn levels_of(
    satellites: &[Ranged],
    covariance_enu_m2: Option<&Matrix3<f64>>,
    settings: &IntegritySettings,
) -> Result<Option<ProtectionLevels>, NavError> {
    let Some(freedom) = satellites.len().checked_sub(4).filter(|f| *f > 0) else {
        return Ok(None);
    };
    let missed = settings.missed_detection_probability;
    if !(missed > 0.0 && missed < 1.0) {
        return Err(NavError::Value {
            name: "missed-detection probability",
            value: missed.to_string(),
            expected: "more than 0 and less than 1",
        });
    }
    let root = chi_square_threshold(freedom, settings.false_alarm_probability)?.sqrt();
    let quantile = -Normal::standard().inverse_cdf(missed);
    Ok(slopes(satellites).map(|slopes| {
        let covariance = covariance_enu_m2.unwrap_or(&slopes.covariance_enu_m2);
        let plane: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into();
        let horizontal_sigma_m = plane.symmetric_eigenvalues().max().sqrt();
        ProtectionLevels {
            horizontal_m: slopes.horizontal * root + quantile * horizontal_sigma_m,
            vertical_m: slopes.vertical * root + quantile * covariance[(2, 2)].sqrt(),
        }
    }))
}

struct Slopes {
    horizontal: f64,
    vertical: f64,
    /// Of least squares.
    covariance_enu_m2: Matrix3<f64>,
}

fn slopes(satellites: &[Ranged]) -> Option<Slopes> {
    let whitened = || {
        let rows = satellites.iter();
        rows.map(|s| Vector4::from(row(&s.look)) / s.sigma_m)
    };
    let normal = whitened().fold(Matrix4::zeros(), |n, row| n + row * row.transpose());
    let covariance = normal.cholesky()?.inverse();
    let mut slopes = Slopes {
        horizontal: 0.0,
        vertical: 0.0,
        covariance_enu_m2: covariance.fixed_view::<3, 3>(0, 0).into(),
    };
    for row in whitened() {
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
