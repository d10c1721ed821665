//! Code tracking error against truth at sample rates with and without an integer number of samples
//! per chip.
//!
//! [`measure`] tracks made-up signals and compares; [`Parts`] tells the error of a narrow loop
//! from far less signal.

mod experiment;
mod parts;
mod table;

pub use experiment::{Case, CodeError, Experiment, measure};
pub use parts::Parts;
pub use table::{Table, ratio, table};

/// Rates compared, Hz: 4 and 16 samples a chip exactly, beside rates next to them.
pub const RATES_HZ: [f64; 4] = [4.0e6, 4.092e6, 16.368e6, 16.369e6];
/// Each rate with an integer number of samples per chip, with the rate it is held against.
pub const INTEGER_AND_BESIDE_HZ: [(f64, f64); 2] = [(4.092e6, 4.0e6), (16.368e6, 16.369e6)];
/// Dopplers, Hz: nearly no code Doppler, and the usual.
pub const DOPPLERS_HZ: [f64; 2] = [20.0, 1000.0];
/// Front ends: two-sided bandwidth over the sample rate.
pub const BANDWIDTHS: [Option<f64>; 2] = [Some(0.8), None];
