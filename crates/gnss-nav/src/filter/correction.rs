//! What the two ways of taking in the measurements of an epoch have in common.

use super::covariance::{Blocks, ErrorState};
use super::row::Row;
use crate::NavError;

/// What is known of the error of a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corrected {
    /// Its estimate.
    pub(super) error: ErrorState,
    /// Covariance of the estimate.
    pub(super) covariance: Blocks,
    /// Sum over all measurements y' S^-1 y.
    pub(super) normalised_squared: f64,
    /// How many measurements.
    pub(super) count: usize,
}

impl Corrected {
    /// Before any measurement.
    pub(super) fn prior(covariance: &Blocks) -> Self {
        Self {
            error: ErrorState::zeros(),
            covariance: *covariance,
            normalised_squared: 0.0,
            count: 0,
        }
    }

    /// Whether nothing overflowed on the way.
    pub(super) fn is_finite(&self) -> bool {
        self.normalised_squared.is_finite()
            && self.error.is_finite()
            && self.covariance.has_variances()
    }
}

/// A way to take in measurements; every one gives the same result up to rounding.
pub(super) trait Correct {
    /// The error and its covariance given `rows`, from `covariance` before them.
    ///
    /// # Errors
    /// [`NavError::Singular`] where an innovation has no positive variance.
    fn correct(covariance: &Blocks, rows: impl Iterator<Item = Row>)
    -> Result<Corrected, NavError>;
}
