//! Runs at one C/N0 after another, and the C/N0 at which half of them are lost.

use anyhow::Result;
use gnss_nav::constants::L1_WAVELENGTH_M;
use gnss_nav::dynamics::ProcessNoise;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::loops::{Loops, Scalar, Vector};
use super::sums::{CHIP_M, INTERVAL_S, measure};
use super::truth::{Motion, Truth, expected};
use crate::judged::in_parallel;

/// Length of a run, s.
const RUN_S: f64 = 60.0;
/// A replica is lost beyond half a chip, m ...
const LOST_M: f64 = CHIP_M / 2.0;
/// ... or 1/(4T), m/s, T the sums whose phases are compared: half an interval.
const LOST_MPS: f64 = L1_WAVELENGTH_M / (2.0 * INTERVAL_S);
/// Where a search for the threshold begins, dB-Hz, and its steps, dB.
const HIGHEST_DBHZ: f64 = 30.0;
const COARSE_DB: f64 = 2.0;
/// Signals below are not told apart, dB-Hz.
const LOWEST_DBHZ: f64 = 8.0;
/// Runs of a step of the search.
const COARSE_RUNS: usize = 16;
/// Points are 1 dB apart, from so much below where the search ended, dB, up to where hardly a run loses any
/// channel.
const BELOW_DB: f64 = 1.0;
const POINT_DB: f64 = 1.0;
const HARDLY: f64 = 0.2;
/// Resamplings of the bootstrap.
const RESAMPLINGS: usize = 1000;

/// Who closes the loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Receiver {
    /// A Kalman filter a channel.
    Scalar,
    /// One filter of all.
    Vector,
}

/// Satellites and motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Case {
    /// Satellites, 5 or 11.
    pub satellites: usize,
    /// Motion of the receiver.
    pub motion: Motion,
}

/// Part of the channels lost within a run at `cn0_dbhz`.
///
/// # Errors
/// Where numbers fail.
pub fn lost(case: Case, receiver: Receiver, cn0_dbhz: f64, seed: u64) -> Result<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut truth = Truth::new(case.motion);
    let sky = truth.sky(case.satellites);
    // Of the clock in truth, and of both as the loops are told.
    let process = ProcessNoise::default();
    let mut time = truth.state.time;
    let mut loops: Box<dyn Loops> = match receiver {
        Receiver::Scalar => Box::new(Scalar::new(&truth.state, &sky, time, process)),
        Receiver::Vector => Box::new(Vector::new(&truth.state, &sky, time, process)?),
    };
    let cn0_hz = 10f64.powf(cn0_dbhz / 10.0);
    let seen = |truth: &Truth, time| -> Vec<(f64, f64)> {
        let all = sky.iter();
        all.map(|(_, s)| expected(&truth.state, s, time)).collect()
    };
    let mut is_lost = vec![false; sky.len()];
    let mut begin = seen(&truth, time);
    for _ in 0..(RUN_S / INTERVAL_S) as usize {
        let replicas = loops.replicas();
        let middle_time = time + INTERVAL_S / 2.0;
        truth.advance(middle_time, &process.clock, &mut rng);
        let middle = seen(&truth, middle_time);
        time = time + INTERVAL_S;
        truth.advance(time, &process.clock, &mut rng);
        let end = seen(&truth, time);
        let mut measured = Vec::with_capacity(sky.len());
        for (k, replica) in replicas.iter().enumerate() {
            let errors_m = replica.errors_m([begin[k].0, middle[k].0, end[k].0]);
            is_lost[k] |= is_beyond(errors_m[2], end[k].1 - replica.rate_mps);
            measured.push(measure(cn0_hz, replica, errors_m, &mut rng));
        }
        if is_lost.iter().all(|lost| *lost) {
            break;
        }
        loops.update(time, &measured)?;
        begin = end;
    }
    Ok(is_lost.iter().filter(|lost| **lost).count() as f64 / sky.len() as f64)
}

/// The clock's white noise of frequency, 0.7 m/s over an interval, is no error of a rate.
fn is_beyond(range_m: f64, rate_mps: f64) -> bool {
    range_m.abs() > LOST_M || rate_mps.abs() > LOST_MPS
}

/// Runs at several C/N0 about the threshold, C/N0 falling: parts lost, by seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// C/N0, dB-Hz, and what was lost of each run.
    pub points: Vec<(f64, Vec<f64>)>,
}

impl Sweep {
    /// `runs` runs at every point about the threshold.
    ///
    /// # Errors
    /// Where numbers fail.
    pub fn new(case: Case, receiver: Receiver, runs: usize) -> Result<Self> {
        let at = |cn0_dbhz, count| {
            in_parallel(count, |seed| lost(case, receiver, cn0_dbhz, seed as u64))
        };
        let mut coarse_dbhz = HIGHEST_DBHZ;
        while coarse_dbhz > LOWEST_DBHZ && mean(&at(coarse_dbhz, COARSE_RUNS.min(runs))?) < 0.5 {
            coarse_dbhz -= COARSE_DB;
        }
        let mut points = Vec::new();
        let mut cn0_dbhz = coarse_dbhz - BELOW_DB;
        loop {
            let parts = at(cn0_dbhz, runs)?;
            let any: Vec<f64> = parts.iter().map(|part| Lost::Runs.of(*part)).collect();
            let is_last = mean(&any) < HARDLY || cn0_dbhz > HIGHEST_DBHZ;
            points.push((cn0_dbhz, parts));
            if is_last {
                points.reverse();
                return Ok(Self { points });
            }
            cn0_dbhz += POINT_DB;
        }
    }

    /// C/N0 of the last point, dB-Hz.
    #[must_use]
    pub fn lowest_dbhz(&self) -> f64 {
        self.points.last().map_or(HIGHEST_DBHZ, |(dbhz, _)| *dbhz)
    }

    /// C/N0, dB-Hz, at which half is lost, between the points by a straight line, counted
    /// over `runs`. `None` where it lies below the last point.
    #[must_use]
    pub fn threshold_dbhz(&self, lost: Lost, runs: &[usize]) -> Option<f64> {
        let parts: Vec<(f64, f64)> = self
            .points
            .iter()
            .map(|(cn0_dbhz, all)| {
                let of = |run: &usize| all.get(*run).copied().map_or(0.0, |part| lost.of(part));
                (
                    *cn0_dbhz,
                    runs.iter().map(of).sum::<f64>() / runs.len() as f64,
                )
            })
            .collect();
        let crossing = parts.windows(2).find(|w| w[0].1 < 0.5 && w[1].1 >= 0.5)?;
        let ((above_dbhz, above), (below_dbhz, below)) = (crossing[0], crossing[1]);
        Some(above_dbhz + (0.5 - above) / (below - above) * (below_dbhz - above_dbhz))
    }
}

/// What counts as lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lost {
    /// Each channel by itself.
    Channels,
    /// A run that loses any channel.
    Runs,
}

impl Lost {
    fn of(self, part: f64) -> f64 {
        match self {
            Self::Channels => part,
            Self::Runs => f64::from(u8::from(part > 0.0)),
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// A figure and its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The figure.
    pub value: f64,
    /// Its limits.
    pub from: f64,
    /// Upper one.
    pub to: f64,
}

/// `figure` of all `runs`, and its 95 % interval by resampling them; `None` where there is none.
#[must_use]
pub fn bootstrap(runs: usize, figure: impl Fn(&[usize]) -> Option<f64>) -> Option<Interval> {
    let all: Vec<usize> = (0..runs).collect();
    let value = figure(&all)?;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut figures: Vec<f64> = (0..RESAMPLINGS)
        .filter_map(|_| {
            let drawn: Vec<usize> = (0..runs).map(|_| rng.random_range(0..runs)).collect();
            figure(&drawn)
        })
        .collect();
    figures.sort_by(f64::total_cmp);
    let at = |part: f64| figures.get((part * figures.len() as f64) as usize).copied();
    Some(Interval {
        value,
        from: at(0.025)?,
        to: at(0.975)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threshold_lies_between_the_points() {
        let sweep = Sweep {
            points: vec![
                (20.0, vec![0.0, 0.0, 0.0, 0.2]),
                (19.0, vec![1.0, 0.0, 0.2, 0.0]),
                (18.0, vec![1.0, 1.0, 1.0, 0.2]),
            ],
        };
        let all = [0, 1, 2, 3];
        // Channels: 0.3 at 19, 0.8 at 18; runs: 0.25 at 20, 0.5 at 19.
        let channels = sweep.threshold_dbhz(Lost::Channels, &all).unwrap();
        assert!((channels - 18.6).abs() < 1e-12, "{channels}");
        assert_eq!(sweep.threshold_dbhz(Lost::Runs, &all), Some(19.0));
        assert_eq!(sweep.threshold_dbhz(Lost::Channels, &[0, 0]), Some(19.5));
        let interval = bootstrap(4, |runs| sweep.threshold_dbhz(Lost::Channels, runs)).unwrap();
        assert!(interval.from < interval.value && interval.value < interval.to);
    }

    #[test]
    fn strong_signals_are_kept() {
        for motion in [Motion::Rest, Motion::Vehicle] {
            let case = Case {
                satellites: 5,
                motion,
            };
            for receiver in [Receiver::Scalar, Receiver::Vector] {
                assert_eq!(lost(case, receiver, 40.0, 1).unwrap(), 0.0);
            }
        }
    }
}
