//! The pipeline: the only place where the layers meet.
//!
//! Data goes down, from samples to records:
//! advance -> search -> correlate -> loops and bits -> epochs -> measurements -> solution.
//! Nothing goes up but the search for a satellite that was lost.

mod clock;
mod discontinuity;
mod fixes;
mod follow;
mod navigator;
mod outcome;
mod report;
mod run;
mod schedule;
mod settings;
mod sky;
mod slot;
mod spectrum;

pub use outcome::Outcome;
pub use run::run;
pub use settings::{Aiding, Settings};
