//! Signals with truth and faults, at two levels: intermediate-frequency samples and correlator sums.

pub mod antenna;
pub mod broadcast;
pub mod built;
pub mod catalogue;
pub mod clock;
pub mod command;
pub mod constellation;
pub mod correlator_level;
pub mod counterfeit;
pub mod emitter;
pub mod fault;
pub mod front_end;
pub mod if_signal;
pub mod link;
pub mod make;
pub mod message;
pub mod multipath;
pub mod orbit;
pub mod path;
pub mod power;
pub mod profile;
pub mod satellite;
pub mod spec;
pub mod trajectory;
pub mod truth_files;
