//! Classical detectors over the same sights: what particle filters are held against.
//!
//! Small and plain. [`GlrMonitor`] makes an integrity monitor of one of them.

mod bank;
mod glr;
mod glr_monitor;
#[cfg(test)]
mod glr_monitor_tests;
#[cfg(test)]
mod golden_tests;
mod kalman;
mod least_squares;

pub use bank::{KalmanBank, KalmanIncrements};
pub use glr::{InnovationGlr, ParityGlr};
pub use glr_monitor::{GlrMonitor, GlrParameters};
pub use kalman::{KalmanFilter, KalmanParameters};
pub use least_squares::{LeastSquaresFit, chi_square_threshold};
