//! False alarms of closed loops without a fault.

use anyhow::Result;
use fault_ml::ChannelMonitor;
use fault_ml::metrics::RateInterval;
use fault_ml::shape::{Shape, ShapeMonitor, ShapeSettings, closed_loop_chart};

use super::closed_loop::{ClosedLoop, Setting};
use super::correlation::Correlation;
use super::tail::{Tail, tails};
use crate::judged::in_parallel;

/// Signal strengths, dB-Hz.
pub const CN0_DBHZ: [f64; 7] = [32.0, 35.0, 38.0, 41.0, 44.0, 47.0, 50.0];
/// Simulated at each, h: of the monitor as the receiver has it without a filter, 371 in all, behind one, and of
/// the paper's chart.
const OPEN_HOURS: f64 = 53.0;
const FILTERED_HOURS: f64 = 9.0;
const PAPER_HOURS: f64 = 3.0;

/// Alarms by C/N0 in the order of [`CN0_DBHZ`], and hours simulated at each.
#[derive(Debug, Clone, PartialEq)]
pub struct FalseAlarms {
    /// Steps from healthy to faulty.
    pub alarms: Vec<usize>,
    /// Hours at each C/N0.
    pub hours: f64,
}

impl FalseAlarms {
    /// Alarms of a channel an hour over all C/N0.
    #[must_use]
    pub fn rate(&self) -> RateInterval {
        let hours = self.hours * self.alarms.len() as f64;
        RateInterval::poisson(self.alarms.iter().sum(), hours)
    }
}

/// Of the receiver's monitor at its default settings, behind a front end of `correlation`.
///
/// # Errors
/// Where a monitor fails.
pub fn of_monitor(correlation: &Correlation) -> Result<FalseAlarms> {
    let hours = match correlation {
        Correlation::Triangle => OPEN_HOURS,
        Correlation::Filtered(_) => FILTERED_HOURS,
    };
    let alarms = in_parallel(CN0_DBHZ.len(), |k| {
        let setting = Setting::receiver(CN0_DBHZ[k], correlation.clone());
        let steps = hours * 3600.0 / setting.integration_s;
        let mut closed = ClosedLoop::new(setting, 9_000 + k as u64);
        let mut monitor = ShapeMonitor::new(ShapeSettings::default())?;
        count(steps as usize, || {
            let magnitudes = closed.step(&[]).shape;
            Ok(monitor.step(&Shape { magnitudes })?.is_faulty())
        })
    })?;
    Ok(FalseAlarms { alarms, hours })
}

/// Of the paper's chart with the limits of closed loops.
///
/// # Errors
/// Where a chart's settings are impossible.
pub fn of_paper() -> Result<FalseAlarms> {
    let tails = tails(PAPER_HOURS, 9_100)?;
    Ok(by_table(&tails))
}

/// Of the paper's chart over `tails`, with the limits of closed loops.
#[must_use]
pub fn by_table(tails: &[Tail]) -> FalseAlarms {
    let alarms = |t: &Tail| t.alarms(closed_loop_chart(t.cn0_dbhz).limit(u32::MAX));
    FalseAlarms {
        alarms: tails.iter().map(alarms).collect(),
        hours: tails.first().map_or(0.0, |t| t.hours),
    }
}

/// Alarms of the receiver's monitor within two seconds of its beginning, over `starts` beginnings at each of
/// [`CN0_DBHZ`].
///
/// # Errors
/// Where a monitor fails.
pub fn of_starts(starts: usize) -> Result<Vec<usize>> {
    const STEPS: usize = 200;
    in_parallel(CN0_DBHZ.len(), |k| {
        let setting = Setting::receiver(CN0_DBHZ[k], Correlation::Triangle);
        let mut closed = ClosedLoop::new(setting, 9_200 + k as u64);
        let mut monitor = ShapeMonitor::new(ShapeSettings::default())?;
        let mut alarmed = 0;
        for _ in 0..starts {
            monitor.reset();
            let alarms = count(STEPS, || {
                let magnitudes = closed.step(&[]).shape;
                Ok(monitor.step(&Shape { magnitudes })?.is_faulty())
            })?;
            alarmed += usize::from(alarms > 0);
        }
        Ok(alarmed)
    })
}

/// How often `is_faulty` turns true.
fn count(steps: usize, mut is_faulty: impl FnMut() -> Result<bool>) -> Result<usize> {
    let (mut before, mut alarms) = (false, 0);
    for _ in 0..steps {
        let now = is_faulty()?;
        alarms += usize::from(now && !before);
        before = now;
    }
    Ok(alarms)
}
