//! One scalar measurement, linearised.

use nalgebra::Vector4;

use super::covariance::Blocks;

/// What a measurement depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Observable {
    /// Pseudorange: position and clock bias.
    Pseudorange,
    /// Range rate: velocity and clock drift.
    RangeRate,
}

/// A row of the measurement equation: `residual = gradient . states + noise`.
///
/// Of the eight elements of a row four are not zero; only these are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) observable: Observable,
    /// By x, y, z and the clock, or by their rates.
    pub(super) gradient: Vector4<f64>,
    /// Measured minus predicted, m or m/s.
    pub(super) residual: f64,
    /// Variance of the noise, m^2 or (m/s)^2.
    pub(super) variance: f64,
}

impl Row {
    /// Element of the whole row by state, in the order of the papers.
    pub(super) fn element(&self, state: usize) -> f64 {
        let own = match self.observable {
            Observable::Pseudorange => 0,
            Observable::RangeRate => 1,
        };
        if state % 2 == own {
            self.gradient[state / 2]
        } else {
            0.0
        }
    }

    /// h' P h: what the uncertainty of the states adds to the variance of the innovation.
    pub(super) fn state_variance(&self, covariance: &Blocks) -> f64 {
        let own = match self.observable {
            Observable::Pseudorange => &covariance.offset,
            Observable::RangeRate => &covariance.rate,
        };
        self.gradient.dot(&(own * self.gradient))
    }
}
