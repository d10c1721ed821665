//! Figure 4: two reflections, one after the other, and the chart.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use fault_ml::shape::{ChartSettings, EwmaChart};

use super::channel::{Channel, Seen};
use super::closed_loop::{Reflection, Setting};
use super::deviation::COMPLEX_DBHZ;
use super::map::correlation_coefficient;

/// Signal, s.
const DURATION_S: f64 = 8.0;
/// When the first reflection sets in, s.
pub const ONSET_S: f64 = 2.0;
/// An integration, s.
const STEP_S: f64 = 1e-3;
/// Limit of the mean that closed loops at 44 dB-Hz pass 1.7 times an hour (`cargo xtask validate shape`: 0.0298 ten
/// times, 0.0340 once), chips: of 60 runs with 2 s of healthy signal one in twenty series has an early alarm.
const FREQUENT_LIMIT_CHIPS: f64 = 0.0330;
/// A chart with limits of closed loops judges from its two hundredth value on, as those were counted: the first
/// limits of (9) and (10) take T for normal, but a single value of 0.3 chip passes six deviations.
pub const UNJUDGED: usize = 200;

/// A reflection for some time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// From and until, s.
    pub during_s: (f64, f64),
    /// Amplitude.
    pub amplitude: f64,
    /// Delay, chips.
    pub delay_chips: f64,
    /// Phase at its beginning, rad.
    pub phase_rad: f64,
    /// Fading frequency, Hz.
    pub fading_hz: f64,
}

/// The paper's table of the two rays is lost; these are ours.
pub const RAYS: [Ray; 2] = [
    Ray {
        during_s: (ONSET_S, 4.0),
        amplitude: 0.5,
        delay_chips: 0.4,
        phase_rad: 0.0,
        fading_hz: 0.5,
    },
    Ray {
        during_s: (5.0, 7.0),
        amplitude: 0.4,
        delay_chips: 0.8,
        phase_rad: PI,
        fading_hz: 0.25,
    },
];

impl Ray {
    fn at(&self, time_s: f64) -> Option<Reflection> {
        let (begin_s, end_s) = self.during_s;
        (time_s >= begin_s && time_s < end_s).then_some(Reflection {
            amplitude: self.amplitude,
            delay_chips: self.delay_chips,
            phase_rad: self.phase_rad + TAU * self.fading_hz * (time_s - begin_s),
        })
    }
}

/// The reflections of a time.
#[must_use]
pub fn reflections(time_s: f64) -> Vec<Reflection> {
    RAYS.iter().filter_map(|ray| ray.at(time_s)).collect()
}

/// A run: time, s, and what was seen.
pub type Run = Vec<(f64, Seen)>;

/// The run of `seed` under `chart`.
///
/// # Errors
/// Where the chart's settings are impossible.
pub fn run(chart: ChartSettings, seed: u64) -> Result<Run> {
    let mut channel = Channel::new(Setting::paper(COMPLEX_DBHZ), chart, seed)?;
    let steps = (DURATION_S / STEP_S).round() as u32;
    let step = |k: u32| {
        let time_s = f64::from(k) * STEP_S;
        (time_s, channel.step(&reflections(time_s)))
    };
    Ok((0..steps).map(step).collect())
}

/// The paper's chart with a limit of 1.7 alarms an hour in a closed loop.
#[must_use]
pub fn frequent_chart() -> ChartSettings {
    let paper = ChartSettings::default();
    let width = paper.width * FREQUENT_LIMIT_CHIPS / paper.limit(u32::MAX);
    ChartSettings { width, ..paper }
}

/// `run` under another chart.
///
/// # Errors
/// Where its settings are impossible.
pub fn charted(run: &Run, settings: ChartSettings) -> Result<Run> {
    let mut chart = EwmaChart::new(settings)?;
    let again = |(time_s, seen): &(f64, Seen)| {
        let mean_chips = chart.step(seen.observed_chips);
        let seen = Seen {
            mean_chips,
            limit_chips: chart.limit(),
            ..*seen
        };
        (*time_s, seen)
    };
    Ok(run.iter().map(again).collect())
}

/// What all runs say.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Runs that alarmed before the first reflection.
    pub early_alarms: usize,
    /// Delay of the first alarm after its onset, s, in order; infinite where there was none.
    pub delays_s: Vec<f64>,
    /// Correlation of Z with the true error, in order.
    pub correlations: Vec<f64>,
}

impl Detection {
    /// Of `runs`, without their first `unjudged` values.
    #[must_use]
    pub fn of(runs: &[Run], unjudged: usize) -> Self {
        let first = |run: &Run| {
            run.iter()
                .skip(unjudged)
                .find(|(_, seen)| seen.is_outside())
                .map(|(t, _)| *t)
        };
        let alarms: Vec<_> = runs.iter().map(first).collect();
        let early = |alarm: &&Option<f64>| alarm.is_some_and(|s| s < ONSET_S);
        let pairs = |run: &Run| -> Vec<_> {
            run.iter()
                .map(|(_, seen)| (seen.mean_chips, seen.late_chips))
                .collect()
        };
        let correlations = runs
            .iter()
            .filter_map(|run| correlation_coefficient(&pairs(run)));
        Self {
            early_alarms: alarms.iter().filter(early).count(),
            delays_s: alarms
                .iter()
                .map(|a| a.map_or(f64::INFINITY, |s| s - ONSET_S))
                .collect(),
            correlations: correlations.collect(),
        }
    }
}
