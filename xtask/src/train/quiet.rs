//! Many hours of healthy channels: what a monitor cries wolf at.

use anyhow::Result;
use fault_ml::learned::HealthyScores;

use super::harvest::{Product, steps};
use super::plan::{Plan, Series};
use super::scoring::{Examinee, add_healthy};
use crate::judged::in_parallel;
use crate::scenario::make::Level;

/// Signal of a run, s.
const RUN_S: f64 = 400.0;
/// Channels of a run, about.
const CHANNELS: f64 = 9.0;

/// Runs that make about `channel_hours`.
#[must_use]
pub fn runs(channel_hours: f64) -> u32 {
    (channel_hours * 3600.0 / (RUN_S * CHANNELS)).ceil() as u32
}

/// The scores of each of `examinees` over the healthy runs `numbers` of `series`, at the correlator level; nothing
/// is left out, neither the first seconds of the filter nor those of a channel.
///
/// # Errors
/// Where a run fails.
pub fn scores(
    series: Series,
    numbers: std::ops::Range<u32>,
    examinees: &[Examinee],
    interval_s: f64,
) -> Result<Vec<HealthyScores>> {
    let first = numbers.start;
    let parts = in_parallel(numbers.len(), |number| {
        let plan = Plan::healthy(first + number as u32, series, RUN_S);
        let data = steps(&plan, Level::Correlator, &Product)?;
        let of = |examinee: &Examinee| {
            let mut healthy = HealthyScores::default();
            add_healthy(
                &mut healthy,
                &data,
                &examinee.all_scores(&data)?,
                interval_s,
            );
            Ok(healthy)
        };
        examinees.iter().map(of).collect::<Result<Vec<_>>>()
    })?;
    let mut all = vec![HealthyScores::default(); examinees.len()];
    for part in parts {
        for (whole, part) in all.iter_mut().zip(part) {
            whole.join(part);
        }
    }
    Ok(all)
}
