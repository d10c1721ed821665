//! The shape of a channel's correlation, watched by a control chart (`Zhang2014`).
//!
//! Reflections distort the correlation peak. Taps around prompt show it: an [`observable`] says how
//! late the replica stands by the shape of the peak, an [`EwmaChart`] averages it exponentially and
//! holds the mean against limits, [`average_run_length`] says how often such a chart alarms by chance.
//!
//! Two forms, as a monitor of one channel:
//!
//! - the paper's, from [`largest_tap`]: quantised to the distance of the taps, so that its limits come
//!   from the tail of simulated closed loops ([`closed_loop_chart`]), not from a deviation;
//! - [`ShapeMonitor`], from [`FlankBalance`]: not quantised, blind to how the replica as a whole is
//!   off, and with a deviation that each channel measures itself.
//!
//! Magnitudes of correlator sums in, chips out; above zero the replica is late, the range too long.

mod balance;
mod chart;
mod closed_loop;
mod monitor;
pub mod observable;
mod run_length;

pub use balance::FlankBalance;
pub use chart::{ChartSettings, EwmaChart};
pub use closed_loop::closed_loop_chart;
pub use monitor::{Shape, ShapeMonitor, ShapeSettings};
pub use observable::{SHAPE_TAPS_CHIPS, fitted_peak, largest_tap};
pub use run_length::average_run_length;
