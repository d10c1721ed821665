//! The pipeline: the only place where the layers meet.
//!
//! Data goes down, from samples to records:
//! advance -> search -> correlate -> loops and bits -> epochs -> measurements -> solution.
//! Up goes the search for a satellite that was lost and, in vector tracking, where the filter steers
//! every channel.

mod belief;
mod clock;
mod discontinuity;
mod fixes;
mod follow;
mod measured;
mod navigated;
mod navigator;
mod outcome;
mod report;
mod run;
mod schedule;
mod settings;
mod shape;
mod sky;
mod slot;
mod spectrum;
mod vector;
mod vector_members;
mod vector_mode;

pub use outcome::Outcome;
pub(crate) use report::{filtered as filter_record, innovation, pvt as solution_record};
pub use run::run;
pub use settings::{Aiding, Settings, ShapeWatching};
pub use vector::{FilterKind, MeasurementNoise, Policy, VectorSettings};
