//! Many hours of healthy channels: what a monitor cries wolf at.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::Result;
use fault_ml::learned::{Dataset, HealthyScores};

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

/// The largest score of a channel in a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The score.
    pub score: f64,
    /// Number of the run in its series.
    pub number: u32,
    /// Number of the satellite.
    pub satellite: u32,
    /// When, s.
    pub time_s: f64,
}

impl fmt::Display for Peak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (number, satellite) = (self.number, self.satellite);
        write!(
            f,
            "{:.2} of G{satellite:02} after {:.2} s of run {number}",
            self.score, self.time_s
        )
    }
}

/// What a monitor says of healthy channels.
#[derive(Debug, Clone, Default)]
pub struct Quiet {
    /// All scores.
    pub scores: HealthyScores,
    peaks: Vec<Peak>,
}

impl Quiet {
    /// The channels whose scores exceed `threshold`, the largest first.
    #[must_use]
    pub fn above(&self, threshold: f64) -> Vec<Peak> {
        let above = self.peaks.iter().filter(|peak| peak.score > threshold);
        let mut above: Vec<Peak> = above.copied().collect();
        above.sort_by(|a, b| b.score.total_cmp(&a.score));
        above
    }

    /// Takes in `scores` of the run `number`, whose steps `data` holds.
    fn add(&mut self, number: u32, data: &Dataset, scores: &[Vec<Option<f64>>], interval_s: f64) {
        add_healthy(&mut self.scores, data, scores, interval_s);
        let mut peaks: BTreeMap<u32, Peak> = BTreeMap::new();
        for (sequence, scores) in data.sequences.iter().zip(scores) {
            for (labelled, score) in sequence.steps.iter().zip(scores) {
                let (Some(score), time_s) = (*score, labelled.time_s) else {
                    continue;
                };
                let satellite = labelled.step.satellite;
                let new = Peak {
                    score,
                    number,
                    satellite,
                    time_s,
                };
                let peak = peaks.entry(satellite).or_insert(new);
                if score > peak.score {
                    *peak = new;
                }
            }
        }
        self.peaks.extend(peaks.into_values());
    }
}

/// What each of `examinees` says over the healthy runs `numbers` of `series`, at the correlator level; nothing
/// is left out, neither the first seconds of the filter nor those of a channel.
///
/// # Errors
/// Where a run fails.
pub fn scores(
    series: Series,
    numbers: std::ops::Range<u32>,
    examinees: &[Examinee],
    interval_s: f64,
) -> Result<Vec<Quiet>> {
    let first = numbers.start;
    let parts = in_parallel(numbers.len(), |number| {
        let number = first + number as u32;
        let plan = Plan::healthy(number, series, RUN_S);
        let data = steps(&plan, Level::Correlator, &Product)?;
        let of = |examinee: &Examinee| {
            let mut quiet = Quiet::default();
            quiet.add(number, &data, &examinee.all_scores(&data)?, interval_s);
            Ok(quiet)
        };
        examinees.iter().map(of).collect::<Result<Vec<_>>>()
    })?;
    let mut all = vec![Quiet::default(); examinees.len()];
    for part in parts {
        for (whole, part) in all.iter_mut().zip(part) {
            whole.scores.join(part.scores);
            whole.peaks.extend(part.peaks);
        }
    }
    Ok(all)
}
