//! `Li2019`: a vehicle passes road signs and an overpass; vector tracking against single points of scalar
//! loops, by filter, mode, measurement and noise bandwidth.

pub mod checks;
pub mod figures;
pub mod noise_bandwidth;
pub mod receivers;
pub mod report;
pub mod steady_filter;
pub mod study;
pub mod table;
#[cfg(test)]
mod tests;
pub mod theory;

use anyhow::Result;

use self::study::Study;
use super::{Making, Outcome};
use crate::scenario::make::Level;

/// Seeds of the scenario.
const SEEDS: usize = 12;

/// Repeats the vehicle test of the paper; on correlator sums unless told otherwise (a run of samples at the
/// paper's 62.5 MHz takes 800 MB and minutes).
///
/// # Errors
/// Where a signal, a run or a picture cannot be made.
pub fn reproduce(making: Making) -> Result<Outcome> {
    let level = making.level.unwrap_or(Level::Correlator);
    let study = Study::run(level, making.seeds.unwrap_or(SEEDS))?;
    let checks = checks::checks(&study);
    Ok(Outcome {
        paper: "li2019",
        figures: report::figures(&study),
        report: report::report(&study, &checks),
        pictures: figures::pictures(&study)?,
        tables: vec![("errors.csv".to_owned(), table::csv(&study))],
        checks,
    })
}
