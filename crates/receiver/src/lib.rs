//! GPS software receiver: samples in, positions and verdicts out.
//!
#![doc = include_str!("../README.md")]

pub mod cli;
pub mod config;
pub mod cost;
mod csv;
mod error;
pub mod inspect;
mod lines;
pub mod models;
pub mod pipeline;
pub mod progress;
pub mod raim;
pub mod record;
pub mod rinex_nav;
pub mod rinex_obs;
mod rinex_text;
pub mod samples;
pub mod session;
pub mod sigmf;
pub mod sink;
pub mod solve;
pub mod summary;
#[cfg(test)]
mod test_data;
pub mod truth;

pub use error::ReceiverError;
