//! Signals with truth and faults, at two levels: intermediate-frequency samples and correlator sums.

pub mod antenna;
pub mod correlator_level;
pub mod emitter;
pub mod if_signal;
pub mod message;
pub mod path;
pub mod profile;
