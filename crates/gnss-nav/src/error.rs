//! Errors of this crate.

use crate::SatelliteId;

/// What went wrong, with the value and what was allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NavError {
    /// Text that names no satellite.
    #[error("'{text}' is no satellite: expected a name such as G07")]
    Satellite {
        /// The text.
        text: String,
    },
    /// A value outside its range.
    #[error("{name} is {value}: expected {expected}")]
    Value {
        /// The quantity, with its unit.
        name: &'static str,
        /// Its value.
        value: String,
        /// What was allowed.
        expected: &'static str,
    },
    /// Kepler's equation did not converge or the orbit is not an ellipse.
    #[error("ephemeris of {satellite} is no orbit: {reason}")]
    Orbit {
        /// Whose ephemeris.
        satellite: SatelliteId,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Too few measurements for the unknowns.
    #[error("{found} measurements for {needed} unknowns")]
    TooFew {
        /// Measurements given.
        found: usize,
        /// Unknowns.
        needed: usize,
    },
    /// The geometry does not determine the solution.
    #[error("the geometry is singular")]
    Singular,
    /// An iteration did not converge.
    #[error("no convergence after {iterations} iterations")]
    NoConvergence {
        /// Iterations made.
        iterations: usize,
    },
    /// A measurement a filter cannot take.
    #[error(
        "innovation of {satellite} is {residual} with a noise variance of {variance}: \
         expected finite values and a variance above 0"
    )]
    Measurement {
        /// Whose.
        satellite: SatelliteId,
        /// Measured minus predicted, m or m/s.
        residual: f64,
        /// Variance given to the measurement, m^2 or (m/s)^2.
        variance: f64,
    },
    /// Innovations that were not formed against the present state of the filter.
    #[error("the filter has moved since these innovations were formed: form them again")]
    StaleInnovations,
    /// No millisecond ambiguities near the prior make the measurements agree.
    #[error("{satellites} code phases agree with no position and time near the prior")]
    NoFit {
        /// Satellites measured.
        satellites: usize,
    },
}
