//! One scalar measurement, linearised.

use super::covariance::{Covariance, ErrorState, HALF};

/// What a measurement depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Observable {
    /// Pseudorange: position and clock bias.
    Pseudorange,
    /// Range rate: velocity and clock drift.
    RangeRate,
}

impl Observable {
    /// Index of the first state it depends on; the others follow at every second place.
    pub(super) const fn first_state(self) -> usize {
        match self {
            Self::Pseudorange => 0,
            Self::RangeRate => 1,
        }
    }
}

/// A row of the measurement equation: `residual = gradient . states + noise`.
///
/// Of the eight elements of a row four are not zero; only these are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) observable: Observable,
    /// By x, y, z and the clock (or their rates).
    pub(super) gradient: [f64; HALF],
    /// Measured minus predicted, m or m/s.
    pub(super) residual: f64,
    /// Variance of the noise, m^2 or (m/s)^2.
    pub(super) variance: f64,
}

impl Row {
    /// The row with its zeros.
    pub(super) fn dense(&self) -> ErrorState {
        let mut dense = ErrorState::zeros();
        for (k, &g) in self.gradient.iter().enumerate() {
            dense[self.observable.first_state() + 2 * k] = g;
        }
        dense
    }

    /// h' P h: what the uncertainty of the states adds to the variance of the innovation.
    pub(super) fn state_variance(&self, covariance: &Covariance) -> f64 {
        let first = self.observable.first_state();
        let mut sum = 0.0;
        for (j, &gj) in self.gradient.iter().enumerate() {
            for (i, &gi) in self.gradient.iter().enumerate() {
                sum += gi * gj * covariance[(first + 2 * i, first + 2 * j)];
            }
        }
        sum
    }
}
