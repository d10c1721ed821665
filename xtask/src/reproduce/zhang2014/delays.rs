//! Time from the onset of a reflection to the alarm.

use anyhow::Result;
use fault_ml::ChannelMonitor;
use fault_ml::shape::{ChartSettings, Shape, ShapeMonitor, ShapeSettings, closed_loop_chart};

use super::channel::Channel;
use super::closed_loop::{ClosedLoop, Reflection, Setting, settled};
use super::correlation::Correlation;
use crate::judged::in_parallel;
use crate::order::quantile;

/// C/N0, dB-Hz.
const CN0_DBHZ: f64 = 44.0;
/// Runs of a case.
const RUNS: u64 = 60;
/// Longest time waited for an alarm, s.
const PATIENCE_S: f64 = 3.0;

/// Amplitude, delay (chips), phase (degrees) of a reflection, and the oracle's delay, median and 95th
/// percentile, s.
const CASES: [(f64, f64, f64, [f64; 2]); 11] = [
    (0.5, 0.25, 0.0, [0.212, 0.290]),
    (0.5, 0.5, 0.0, [0.085, 0.109]),
    (0.5, 0.75, 0.0, [0.081, 0.109]),
    (0.5, 1.0, 0.0, [0.104, 0.139]),
    (0.3, 0.5, 0.0, [0.097, 0.119]),
    (0.2, 0.5, 0.0, [0.112, 0.142]),
    (0.1, 0.5, 0.0, [0.210, 0.334]),
    (0.5, 0.25, 180.0, [0.088, 0.118]),
    (0.5, 0.5, 180.0, [0.066, 0.081]),
    (0.3, 0.5, 180.0, [0.072, 0.086]),
    (0.5, 0.5, 90.0, [0.102, 0.136]),
];

/// Delays of one monitor: median and 95th percentile, s; infinite where it did not alarm in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delay {
    /// Median, s.
    pub median_s: f64,
    /// 95th percentile, s.
    pub p95_s: f64,
}

/// One reflection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delays {
    /// Amplitude, delay (chips), phase (degrees).
    pub reflection: (f64, f64, f64),
    /// Error of the settled loop, chips late, with a chip between early and late.
    pub error_chips: f64,
    /// An independent prototype's with six deviations.
    pub oracle: Delay,
    /// Six deviations, as in the paper.
    pub paper: Delay,
    /// Limits of closed loops.
    pub closed_loop: Delay,
    /// The receiver's monitor, on sums of 10 ms.
    pub monitor: Delay,
}

/// All cases.
///
/// # Errors
/// Where a monitor's settings are impossible.
pub fn delays() -> Result<Vec<Delays>> {
    in_parallel(CASES.len(), |k| {
        let (amplitude, delay_chips, phase_deg, [median_s, p95_s]) = CASES[k];
        let reflection = Reflection {
            amplitude,
            delay_chips,
            phase_rad: phase_deg.to_radians(),
        };
        let (error_chips, _) = settled(&Correlation::Triangle, 1.0, &[reflection]);
        Ok(Delays {
            reflection: (amplitude, delay_chips, phase_deg),
            error_chips,
            oracle: Delay { median_s, p95_s },
            paper: of_chart(ChartSettings::default(), reflection)?,
            closed_loop: of_chart(closed_loop_chart(CN0_DBHZ), reflection)?,
            monitor: of_monitor(reflection)?,
        })
    })
}

fn of_chart(chart: ChartSettings, reflection: Reflection) -> Result<Delay> {
    let run = |seed| {
        let setting = Setting::paper(CN0_DBHZ);
        let step_s = setting.integration_s;
        let mut channel = Channel::new(setting, chart, 7_000 + seed)?;
        (0..1_000).for_each(|_| _ = channel.step(&[]));
        first(step_s, || Ok(channel.step(&[reflection]).is_outside()))
    };
    Ok(summary((0..RUNS).map(run).collect::<Result<Vec<_>>>()?))
}

fn of_monitor(reflection: Reflection) -> Result<Delay> {
    let run = |seed| {
        let setting = Setting::receiver(CN0_DBHZ, Correlation::Triangle);
        let step_s = setting.integration_s;
        let mut closed = ClosedLoop::new(setting, 8_000 + seed);
        let mut monitor = ShapeMonitor::new(ShapeSettings::default())?;
        let mut step = |reflections: &[Reflection]| -> Result<bool> {
            let magnitudes = closed.step(reflections).shape;
            Ok(monitor.step(&Shape { magnitudes })?.is_faulty())
        };
        for _ in 0..1_000 {
            step(&[])?;
        }
        first(step_s, || step(&[reflection]))
    };
    Ok(summary((0..RUNS).map(run).collect::<Result<Vec<_>>>()?))
}

/// When `is_faulty` is first true, s; infinite where it takes too long.
fn first(step_s: f64, mut is_faulty: impl FnMut() -> Result<bool>) -> Result<f64> {
    for step in 1..=(PATIENCE_S / step_s) as u32 {
        if is_faulty()? {
            return Ok(f64::from(step) * step_s);
        }
    }
    Ok(f64::INFINITY)
}

fn summary(delays_s: Vec<f64>) -> Delay {
    Delay {
        median_s: quantile(delays_s.iter().copied(), 0.5),
        p95_s: quantile(delays_s, 0.95),
    }
}
