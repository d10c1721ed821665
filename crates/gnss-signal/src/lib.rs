//! GNSS signal processing: samples to correlator sums to discriminators; acquisition and scalar
//! tracking. Knows no position.
//!
#![doc = include_str!("../README.md")]

mod acquisition;
mod bank;
mod ca_code;
mod correlator;
mod error;
pub mod sample;
mod signal;
pub mod tracking;

pub use acquisition::{AcquisitionEngine, SearchStatistics, default_search};
pub use bank::{
    AcquisitionHit, CorrelatorBank, MAX_TAPS, Replica, SearchReport, SearchRequest, TapOffsets,
    Taps,
};
pub use ca_code::{CA_CODE_LENGTH_CHIPS, ranging_code};
pub use correlator::{Correlator, IfCorrelatorBank, InstructionSet};
pub use error::SignalError;
pub use signal::{FrontEnd, Signal, SignalId, SignalSpec};
