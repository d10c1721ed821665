//! How often the mean of the largest tap passes a limit by chance, in closed loops.

use anyhow::Result;
use fault_ml::shape::{ChartSettings, EwmaChart, SHAPE_TAPS_CHIPS, largest_tap};

use super::closed_loop::{ClosedLoop, Setting};
use super::false_alarms::CN0_DBHZ;
use crate::judged::in_parallel;

/// Distance of the limits that passages are counted of, chips; the last is as far as T reaches.
const GRID_CHIPS: f64 = 0.00025;
const LIMITS: usize = 1600;
/// Steps in which loop and chart settle: quantised values pass the narrow limits of a chart that has just begun.
const SETTLING: usize = 200;
/// Most of a C/N0 simulated in one go, h: the cores share the rest.
const LONGEST_PART_HOURS: f64 = 6.0;

/// Passages of the mean, Z, through limits, of loops without a fault at one C/N0.
#[derive(Debug, Clone, PartialEq)]
pub struct Tail {
    /// Signal strength, dB-Hz.
    pub cn0_dbhz: f64,
    /// Simulated, h.
    pub hours: f64,
    /// Steps from within to outside, by limit.
    passages: Vec<u32>,
}

impl Tail {
    /// Of the paper's loop and lambda over `hours`.
    ///
    /// # Errors
    /// Where the chart's settings are impossible.
    pub fn simulate(cn0_dbhz: f64, hours: f64, seed: u64) -> Result<Self> {
        let setting = Setting::paper(cn0_dbhz);
        let steps = (hours * 3600.0 / setting.integration_s).round() as usize;
        let mut chart = EwmaChart::new(ChartSettings::default())?;
        let mut closed = ClosedLoop::new(setting, seed);
        let mut step = || {
            let shape = closed.step(&[]).shape;
            let mean = chart.step(largest_tap(&SHAPE_TAPS_CHIPS, &shape).unwrap_or(0.0));
            ((mean.abs() / GRID_CHIPS) as usize).min(LIMITS - 1)
        };
        let mut passages = vec![0; LIMITS];
        let mut before = (0..SETTLING).fold(0, |_, _| step());
        for _ in 0..steps {
            let now = step();
            for passed in before..now {
                passages[passed + 1] += 1;
            }
            before = now;
        }
        Ok(Self {
            cn0_dbhz,
            hours,
            passages,
        })
    }

    /// Alarms under `limit_chips`, rounded down to the grid.
    #[must_use]
    pub fn alarms(&self, limit_chips: f64) -> usize {
        // A limit on the grid may come out below it by rounding.
        let place = (limit_chips / GRID_CHIPS + 1e-6) as usize;
        self.passages.get(place).map_or(0, |n| *n as usize)
    }

    /// The least limit of the grid that is passed at most `per_hour`, chips.
    #[must_use]
    pub fn limit_chips(&self, per_hour: f64) -> f64 {
        let most = per_hour * self.hours;
        let often = |n: &u32| f64::from(*n) > most;
        let last = self.passages.iter().rposition(often).unwrap_or(0);
        (last + 1) as f64 * GRID_CHIPS
    }

    fn and(mut self, other: &Self) -> Self {
        self.hours += other.hours;
        let both = self.passages.iter_mut().zip(&other.passages);
        both.for_each(|(a, b)| *a += b);
        self
    }
}

/// Tails at [`CN0_DBHZ`], `hours` each.
///
/// # Errors
/// Where the chart's settings are impossible.
pub fn tails(hours: f64, seed: u64) -> Result<Vec<Tail>> {
    let parts = (hours / LONGEST_PART_HOURS).ceil().max(1.0) as usize;
    let part_hours = hours / parts as f64;
    let all = in_parallel(CN0_DBHZ.len() * parts, |k| {
        Tail::simulate(CN0_DBHZ[k / parts], part_hours, seed + k as u64)
    })?;
    let sum = |parts: &[Tail]| parts[1..].iter().fold(parts[0].clone(), Tail::and);
    Ok(all.chunks(parts).map(sum).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passages_are_the_alarms_of_a_chart() {
        let limit = 40.0 * GRID_CHIPS;
        let tail = Tail::simulate(41.0, 0.01, 3).unwrap();
        let setting = Setting::paper(41.0);
        let mut chart = EwmaChart::new(ChartSettings::default()).unwrap();
        let mut closed = ClosedLoop::new(setting, 3);
        let (mut alarms, mut outside) = (0, false);
        for step in 0..36_200 {
            let shape = closed.step(&[]).shape;
            chart.step(largest_tap(&SHAPE_TAPS_CHIPS, &shape).unwrap());
            let now = chart.distance() >= limit;
            alarms += usize::from(now && !outside && step >= SETTLING);
            outside = now;
        }
        assert!(alarms > 50);
        assert_eq!(tail.alarms(limit), alarms);
        // The limit for a rate is passed at most so often, the one below more often.
        let found = tail.limit_chips(1e4);
        assert!(tail.alarms(found) <= 100 && tail.alarms(found - GRID_CHIPS) > 100);
    }

    #[test]
    fn parts_make_the_whole() {
        let [a, b] = [1, 2].map(|seed| Tail::simulate(44.0, 0.002, seed).unwrap());
        let both = a.clone().and(&b);
        let limit = 0.01;
        assert_eq!(both.alarms(limit), a.alarms(limit) + b.alarms(limit));
        assert!((both.hours - 0.004).abs() < 1e-12);
    }
}
