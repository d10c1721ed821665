//! `Zhang2014`: a control chart on the shape of the correlation.

pub mod channel;
pub mod checks;
pub mod closed_loop;
pub mod correlation;
pub mod delays;
pub mod deviation;
pub mod false_alarms;
pub mod figures;
pub mod map;
pub mod rays;
pub mod report;
pub mod run_lengths;
pub mod samples;
pub mod study;
pub mod table;
pub mod tail;
#[cfg(test)]
mod tests;
pub mod urban;

use anyhow::Result;

use self::study::Study;
use super::Outcome;

/// Repeats the paper; minutes of processor time.
///
/// # Errors
/// Where a signal, a run or a picture cannot be made.
pub fn reproduce() -> Result<Outcome> {
    let study = Study::run()?;
    let checks = checks::checks(&study);
    Ok(Outcome {
        paper: "zhang2014",
        figures: report::figures(&study),
        report: report::report(&study, &checks),
        pictures: figures::pictures(&study)?,
        tables: vec![("map.csv".to_owned(), report::map_csv(&study))],
        checks,
    })
}
