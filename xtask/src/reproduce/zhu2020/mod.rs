//! `Zhu2020`: which innovations are those of a blocked channel, by an LSTM and by a support-vector machine, and
//! what the receiver gains by it.

pub mod report;
pub mod study;
#[cfg(test)]
mod tests;

use anyhow::Result;

use self::study::Study;
use super::{Making, Outcome};
use crate::scenario::make::Level;
use crate::train::paper::LENGTHS;

/// Runs of every class of C/N0 that are learned from and judged by.
const SEEDS: usize = 16;
/// Trainings of every model and length.
const TRAININGS: u64 = 3;

/// Repeats the paper; on correlator sums unless told otherwise.
///
/// # Errors
/// Where a signal, a run, a training or a picture cannot be made.
pub fn reproduce(making: Making) -> Result<Outcome> {
    let level = making.level.unwrap_or(Level::Correlator);
    let seeds = making.seeds.unwrap_or(SEEDS);
    let study = Study::run(level, seeds, &LENGTHS, TRAININGS)?;
    let checks = report::checks(&study);
    Ok(Outcome {
        paper: "zhu2020",
        figures: report::figures(&study),
        report: report::report(&study, &checks),
        pictures: report::pictures(&study)?,
        tables: Vec::new(),
        checks,
    })
}
