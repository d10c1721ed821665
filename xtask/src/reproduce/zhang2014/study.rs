//! Everything that is simulated.

use anyhow::Result;
use fault_ml::shape::{ChartSettings, closed_loop_chart};

use super::correlation::Correlation;
use super::delays::{Delays, delays};
use super::deviation::{self, Case};
use super::false_alarms::{self, FalseAlarms};
use super::map::{Point, map};
use super::rays::{self, Detection, Run};
use super::run_lengths::{RunLength, run_lengths};
use super::samples;
use super::table::{Row, table};
use super::urban::{self, Urban, urban};
use crate::judged::in_parallel;

/// Seeds of the two reflections on correlator sums, and on samples.
const SEEDS: usize = 60;
const SAMPLED_SEEDS: usize = 6;
/// Amplitude of the reflection in Figures 2 and 3.
pub const AMPLITUDE: f64 = 0.5;
/// One-sided bandwidth of the narrower front end of false alarms, Hz.
const NARROW_HZ: f64 = 1.6e6;

/// Results of all parts.
#[derive(Debug, Clone)]
pub struct Study {
    /// Figures 2 and 3.
    pub map: Vec<Point>,
    /// Table 1.
    pub table: Vec<Row>,
    /// Deviation of T by integration, loop and bandwidth.
    pub deviations: Vec<Case>,
    /// The same by C/N0, dB-Hz and chips.
    pub deviation_by_cn0: Vec<(f64, f64)>,
    /// Figure 4: one run.
    pub drawn: Run,
    /// All runs by the paper's limits, and by those of closed loops at 1.7 alarms an hour and one in a hundred.
    pub detection: [Detection; 3],
    /// The same on samples.
    pub sampled: [Detection; 3],
    /// Average run lengths.
    pub run_lengths: Vec<RunLength>,
    /// Time to the alarm.
    pub delays: Vec<Delays>,
    /// Of the receiver's monitor without and with a filter, and of the paper's chart with limits of closed
    /// loops.
    pub false_alarms: [FalseAlarms; 3],
    /// Twelve satellites.
    pub urban: Vec<Urban>,
}

/// What `runs` say under each of the charts of [`Study::detection`].
fn detections(runs: &[Run]) -> Result<[Detection; 3]> {
    let of = |chart: ChartSettings, unjudged| -> Result<Detection> {
        let charted = runs.iter().map(|run| rays::charted(run, chart));
        let charted: Vec<Run> = charted.collect::<Result<_>>()?;
        Ok(Detection::of(&charted, unjudged))
    };
    Ok([
        of(ChartSettings::default(), 0)?,
        of(rays::frequent_chart(), rays::UNJUDGED)?,
        of(closed_loop_chart(deviation::COMPLEX_DBHZ), rays::UNJUDGED)?,
    ])
}

impl Study {
    /// Runs everything.
    ///
    /// # Errors
    /// Where a part cannot be simulated.
    pub fn run() -> Result<Self> {
        let drawn = in_parallel(SEEDS, |seed| {
            rays::run(ChartSettings::default(), seed as u64)
        })?;
        Ok(Self {
            map: map(&Correlation::Triangle, AMPLITUDE),
            table: table(),
            deviations: deviation::by_integration(),
            deviation_by_cn0: deviation::by_cn0(),
            detection: detections(&drawn)?,
            drawn: drawn.into_iter().next().unwrap_or_default(),
            sampled: detections(&samples::runs(SAMPLED_SEEDS)?)?,
            run_lengths: run_lengths()?,
            delays: delays()?,
            false_alarms: [
                false_alarms::of_monitor(&Correlation::Triangle)?,
                false_alarms::of_monitor(&Correlation::filtered(NARROW_HZ))?,
                false_alarms::of_paper()?,
            ],
            urban: urban(urban::SCENARIOS)?,
        })
    }

    /// Least and largest error of Figure 2, chips.
    #[must_use]
    pub fn extremes_chips(&self) -> (f64, f64) {
        let errors = || self.map.iter().map(|p| p.error_chips);
        (
            errors().fold(f64::MAX, f64::min),
            errors().fold(f64::MIN, f64::max),
        )
    }

    /// The case that the paper's deviation is found in: 1 ms, 3 Hz, no filter, complex samples.
    #[must_use]
    pub fn paper_case(&self) -> Option<&Case> {
        self.deviations.iter().find(|c| {
            c.integration_ms < 1.5
                && (c.loop_hz - 3.0).abs() < 0.1
                && c.bandwidth_mhz.is_infinite()
                && c.cn0_dbhz > 42.0
        })
    }
}
