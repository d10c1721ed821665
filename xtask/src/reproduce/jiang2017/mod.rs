//! `Jiang2017`: vector tracking while a satellite is blocked, without detection, with the innovation test
//! and with trained monitors.

pub mod checks;
pub mod figures;
pub mod learned;
pub mod receivers;
pub mod report;
pub mod study;
#[cfg(test)]
mod tests;

use anyhow::Result;

use self::study::Study;
use super::{Making, Outcome};
use crate::scenario::make::Level;

/// Seeds of a scenario.
const SEEDS: usize = 8;

/// Repeats the vector-tracking part of the paper; on samples unless told otherwise.
///
/// # Errors
/// Where a signal, a run or a picture cannot be made.
pub fn reproduce(making: Making) -> Result<Outcome> {
    let level = making.level.unwrap_or(Level::If);
    let seeds = making.seeds.unwrap_or(SEEDS);
    let study = Study {
        learned: learned::runs(level, seeds)?,
        ..Study::run(level, seeds)?
    };
    let checks = checks::checks(&study);
    Ok(Outcome {
        paper: "jiang2017",
        figures: report::figures(&study),
        report: report::report(&study, &checks),
        pictures: figures::pictures(&study)?,
        tables: Vec::new(),
        checks,
    })
}
