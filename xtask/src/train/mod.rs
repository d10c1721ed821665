//! Training of channel monitors on made-up runs.

pub mod command;
pub mod evaluate;
pub mod fit;
pub mod harvest;
pub mod label;
pub mod paper;
pub mod plan;
pub mod quiet;
pub mod scoring;

pub use command::{Trained, train};
