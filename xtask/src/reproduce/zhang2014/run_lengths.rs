//! How long a chart runs without a fault: by theory of independent values, and in a closed loop.

use anyhow::Result;
use fault_ml::shape::{ChartSettings, average_run_length};
use statrs::distribution::{ContinuousCDF, Normal};

use super::channel::Channel;
use super::closed_loop::Setting;

/// C/N0, dB-Hz.
const CN0_DBHZ: f64 = 44.0;
/// Integrations simulated for a width.
const STEPS: usize = 6_000_000;

/// Run lengths of one width of the limits, steps of 1 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunLength {
    /// L.
    pub width: f64,
    /// Of independent normal values.
    pub normal: f64,
    /// Of independent values with the distribution that T has in the closed loop.
    pub independent: f64,
    /// Of the closed loop; infinite where it was never left.
    pub closed_loop: f64,
    /// Alarms that this rests on.
    pub alarms: usize,
}

/// Run lengths of limits three to six deviations wide, at 44 dB-Hz.
///
/// # Errors
/// Where a chart has none.
pub fn run_lengths() -> Result<Vec<RunLength>> {
    let sigma_and_shares = distribution()?;
    crate::judged::in_parallel(4, |k| run_length(3.0 + k as f64, &sigma_and_shares))
}

/// Deviation of T, and how often each value occurs.
type Distribution = (f64, [f64; 9]);

fn distribution() -> Result<Distribution> {
    const DRAWN: usize = 2_000_000;
    let mut channel = Channel::new(Setting::paper(CN0_DBHZ), ChartSettings::default(), 31)?;
    let mut shares = [0.0; 9];
    let mut squares = 0.0;
    for _ in 0..DRAWN {
        let observed = channel.step(&[]).observed_chips;
        squares += observed * observed;
        shares[((observed * 10.0).round() + 4.0) as usize] += 1.0 / DRAWN as f64;
    }
    Ok(((squares / DRAWN as f64).sqrt(), shares))
}

fn run_length(width: f64, (sigma, shares): &Distribution) -> Result<RunLength> {
    let chart = ChartSettings {
        sigma: *sigma,
        width,
        ..ChartSettings::default()
    };
    let limit = chart.limit(u32::MAX);
    let normal = Normal::new(0.0, *sigma)?;
    let below = |x: f64| -> f64 {
        let values = shares.iter().enumerate();
        let within = values.filter(|(k, _)| (*k as f64 - 4.0) / 10.0 <= x + 1e-12);
        within.map(|(_, share)| share).sum()
    };
    let (closed_loop, alarms) = simulated(chart, 500 + width as u64)?;
    Ok(RunLength {
        width,
        normal: average_run_length(chart.lambda, limit, |x| normal.cdf(x))?,
        independent: average_run_length(chart.lambda, limit, below)?,
        closed_loop,
        alarms,
    })
}

/// Mean length of runs from a chart at its target, limits as after many steps, and how many there were.
fn simulated(chart: ChartSettings, seed: u64) -> Result<(f64, usize)> {
    let limit = chart.limit(u32::MAX);
    let mut channel = Channel::new(Setting::paper(CN0_DBHZ), chart, seed)?;
    let mut alarms = 0;
    for _ in 0..STEPS {
        if channel.step(&[]).mean_chips.abs() > limit {
            alarms += 1;
            channel.restart_chart();
        }
    }
    Ok((STEPS as f64 / f64::from(alarms), alarms as usize))
}
