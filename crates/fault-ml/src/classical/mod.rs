//! Classical detectors over the same sights: what particle filters are held against.
//!
//! Small and plain: baselines for comparison, not the receiver's own monitoring.

mod bank;
mod glr;
#[cfg(test)]
mod golden_tests;
mod kalman;
mod least_squares;

pub use bank::{KalmanBank, KalmanIncrements};
pub use glr::{InnovationGlr, ParityGlr};
pub use kalman::{KalmanFilter, KalmanParameters};
pub use least_squares::{LeastSquaresFit, chi_square_threshold};
