//! What is done with the measurements of an epoch, and what was done.

use super::row::Observable;
use crate::{NavError, SatelliteId};

/// What a filter is to do with a satellite.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Disposition {
    /// Use it with the variance of its measurements.
    #[default]
    Use,
    /// Use it with that variance times a factor.
    Deweight {
        /// More than 0, and finite; above 1 it lowers the weight.
        variance_factor: f64,
    },
    /// Leave it out.
    Exclude,
}

impl Disposition {
    pub(super) fn check(&self) -> Result<(), NavError> {
        match *self {
            Self::Deweight { variance_factor }
                if !(variance_factor > 0.0 && variance_factor.is_finite()) =>
            {
                Err(NavError::Value {
                    name: "variance factor",
                    value: variance_factor.to_string(),
                    expected: "more than 0, and finite",
                })
            }
            _ => Ok(()),
        }
    }
}

/// Disposition of `satellite` in a list; [`Disposition::Use`] where it is not named.
pub(super) fn of(satellite: SatelliteId, list: &[(SatelliteId, Disposition)]) -> Disposition {
    list.iter()
        .find(|(named, _)| *named == satellite)
        .map_or(Disposition::Use, |&(_, disposition)| disposition)
}

/// Why a measurement was not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SkipReason {
    /// Its innovation exceeded the gate.
    Gate,
    /// Its satellite was excluded.
    Excluded,
    /// Its satellite stands below the elevation mask.
    BelowMask,
}

/// A measurement that was not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Skipped {
    /// Whose.
    pub satellite: SatelliteId,
    /// Which of its measurements.
    pub observable: Observable,
    /// Why.
    pub reason: SkipReason,
}

/// What an update did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Update {
    /// Measurements used: pseudoranges and range rates.
    pub used: usize,
    /// Their normalised innovation squared together, y' S^-1 y: chi-square with `used` degrees of
    /// freedom where the filter's assumptions hold and no gate cuts its tail.
    pub normalised_innovation_squared: f64,
    /// Measurements not used, in the order of the innovations.
    pub skipped: Vec<Skipped>,
}
