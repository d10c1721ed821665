//! `Jiang2017`: vector tracking while a satellite is blocked, without detection and with the innovation
//! test.

pub mod checks;
pub mod figures;
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
    let study = Study::run(level, making.seeds.unwrap_or(SEEDS))?;
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
