//! GNSS signal processing: samples to correlator sums to discriminators; acquisition and scalar
//! tracking. Knows no position.

mod bank;
mod error;
mod signal;

pub use bank::{
    AcquisitionHit, CorrelatorBank, MAX_TAPS, Replica, SearchReport, SearchRequest, TapOffsets,
    Taps,
};
pub use error::SignalError;
pub use signal::{FrontEnd, Signal, SignalId, SignalSpec};
