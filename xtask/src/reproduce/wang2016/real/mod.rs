//! Steps on real pseudoranges: each satellite in turn, at several times, before every detector.

pub mod detector;
pub mod record;
#[cfg(test)]
mod tests;

use anyhow::{Context, Result};
use fault_ml::particle::{Calibration, Movement, ParticleParameters};
use fault_ml::{CorrelatedNoise, Sight};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use self::detector::{Detector, Kind};
use self::record::{Record, take_off_median};
use super::setting::STEPS_M;

/// Seconds before a step, which bring every memory of a detector to rest.
const BEFORE: usize = 100;
/// Seconds within which a step has to be found.
const AFTER: usize = 60;
/// Times of the steps, s.
const ONSETS: [usize; 4] = [200, 400, 600, 800];
/// Clean seconds that count for nothing: detectors warm up.
const WARM_UP: usize = 60;
/// Seeds of a detector with chance over the clean record.
const CLEAN_SEEDS: u64 = 10;
/// Share of clean records that may have a false alarm, by the fitted noise.
pub const STATED: f64 = 0.05;

/// What a detector makes of steps of one size.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct StepResult {
    /// Share of the steps found within a minute.
    pub detected: f64,
    /// Share of these whose satellite is named in the epoch of the alarm.
    pub named: f64,
    /// Median seconds to the alarm, a minute for what was not found.
    pub delay_median_s: f64,
}

/// One detector at one threshold.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RealCase {
    /// What people read.
    pub label: String,
    /// Its threshold.
    pub threshold: f64,
    /// Share of clean records, over seeds, with a false alarm.
    pub false_alarm_records: f64,
    /// By step.
    pub steps: [StepResult; 3],
}

/// Everything on real data.
#[derive(Debug, Clone)]
pub struct RealStudy {
    /// Satellites in view throughout.
    pub satellites: usize,
    /// Seconds of the recording.
    pub seconds: usize,
    /// Noise fitted to it.
    pub noise: CorrelatedNoise,
    /// Each detector at its own threshold.
    pub own: Vec<RealCase>,
    /// Each at the largest value of its clean record: none has a false alarm.
    pub equal: Vec<RealCase>,
}

impl RealStudy {
    /// Runs everything; `None` where the recording is absent.
    ///
    /// # Errors
    /// Where the recording is damaged or a detector cannot be run.
    pub fn run() -> Result<Option<Self>> {
        let Some(record) = Record::read()? else {
            return Ok(None);
        };
        let noise = fit(&record)?;
        let mut study = Self {
            satellites: record.satellites(),
            seconds: record.epochs.len(),
            noise,
            own: Vec::new(),
            equal: Vec::new(),
        };
        // The record as filters see it that are told the deviation of the fit, not that of the model.
        let told = record.with_sigma(noise.sigma_m());
        for (label, kind, threshold, is_told) in plans(&record, &noise)? {
            let record = if is_told { &told } else { &record };
            let clean = clean_largest(record, kind)?;
            let alarms = clean.iter().filter(|c| **c > threshold).count();
            let share = alarms as f64 / clean.len() as f64;
            let runs = steps(record, kind)?;
            let case = |threshold: f64, false_alarm_records: f64| RealCase {
                label: label.to_owned(),
                threshold,
                false_alarm_records,
                steps: results(&runs, threshold),
            };
            study.own.push(case(threshold, share));
            let largest = clean.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            study.equal.push(case(largest, 0.0));
        }
        Ok(Some(study))
    }
}

/// Label, detector, threshold it would be run with, and whether it is told the fitted deviation.
type Plan = (&'static str, Kind, f64, bool);

fn plans(record: &Record, noise: &CorrelatedNoise) -> Result<Vec<Plan>> {
    let bootstrap = ParticleParameters::receiver(Movement::Bootstrap);
    let swarm = ParticleParameters::receiver(Movement::Swarm(super::study::SWARM));
    let satellites = record.satellites();
    let chi_square = fault_ml::classical::chi_square_threshold(satellites, 1e-5)?;
    Ok(vec![
        ("PF", Kind::Particle(bootstrap), bootstrap.threshold, false),
        (
            "PF, deviation and threshold for the fitted noise",
            Kind::Particle(bootstrap),
            calibrated(record, &bootstrap, noise)?,
            true,
        ),
        ("PSO-PF", Kind::Particle(swarm), swarm.threshold, false),
        (
            "least squares, 1e-5 an epoch",
            Kind::ChiSquare,
            chi_square,
            false,
        ),
        // Half a chi-square of one degree of freedom at the same rate.
        ("GLR on residuals", Kind::ParityGlr, 0.5 * 19.51, false),
        (
            "GLR on innovations",
            Kind::InnovationGlr,
            0.5 * 19.51,
            false,
        ),
    ])
}

/// Threshold that the stated share of clean records exceeds under the fitted noise.
fn calibrated(
    record: &Record,
    parameters: &ParticleParameters,
    noise: &CorrelatedNoise,
) -> Result<f64> {
    let first = record.epochs.first().context("an empty record")?;
    let designs: Vec<_> = first.iter().map(|s| s.design).collect();
    let calibration = Calibration {
        runs: 200,
        epochs: record.epochs.len() - WARM_UP,
        false_alarm_share: STATED,
    };
    let mut random = ChaCha8Rng::seed_from_u64(2016);
    let sigma_m = noise.sigma_m();
    Ok(calibration.threshold(&parameters.check()?, &designs, sigma_m, noise, &mut random)?)
}

/// Noise of the record: what a mean position and a clock of each epoch leave of it.
fn fit(record: &Record) -> Result<CorrelatedNoise> {
    let mut rows = vec![Vec::new(); record.satellites()];
    for sights in &record.epochs {
        for (row, sight) in rows.iter_mut().zip(sights) {
            row.push(sight.residual_m);
        }
    }
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    Ok(CorrelatedNoise::fit(&rows, 1.0)?)
}

/// Largest score of the clean record, by seed.
fn clean_largest(record: &Record, kind: Kind) -> Result<Vec<f64>> {
    let seeds = if kind.has_chance() { CLEAN_SEEDS } else { 1 };
    (0..seeds)
        .map(|seed| {
            let mut detector = Detector::start(kind, record.satellites(), seed)?;
            let mut largest = f64::NEG_INFINITY;
            for (k, sights) in record.epochs.iter().enumerate() {
                let (score, _) = detector.epoch(k, sights)?;
                if k >= WARM_UP {
                    largest = largest.max(score);
                }
            }
            Ok(largest)
        })
        .collect()
}

/// Scores after a step: by step size, then run by run its satellite and the decisions.
type Runs = [Vec<(usize, Vec<(f64, usize)>)>; 3];

fn steps(record: &Record, kind: Kind) -> Result<Runs> {
    let mut runs: Runs = Default::default();
    for (step_m, runs) in STEPS_M.into_iter().zip(&mut runs) {
        for satellite in 0..record.satellites() {
            for onset in ONSETS {
                let seed = (satellite * 1000 + onset) as u64;
                let mut detector = Detector::start(kind, record.satellites(), seed)?;
                let mut decisions = Vec::with_capacity(AFTER);
                for k in onset - BEFORE..onset + AFTER {
                    let mut sights: Vec<Sight> = record.epochs[k].clone();
                    if k >= onset {
                        sights[satellite].residual_m += step_m;
                        take_off_median(&mut sights);
                    }
                    let decision = detector.epoch(k, &sights)?;
                    if k >= onset {
                        decisions.push(decision);
                    }
                }
                runs.push((satellite, decisions));
            }
        }
    }
    Ok(runs)
}

fn results(runs: &Runs, threshold: f64) -> [StepResult; 3] {
    [0, 1, 2].map(|step| {
        let (mut delays, mut named) = (Vec::new(), 0);
        let all = &runs[step];
        for (satellite, decisions) in all {
            let alarm = decisions.iter().position(|(score, _)| *score > threshold);
            if let Some(at) = alarm {
                named += usize::from(decisions[at].1 == *satellite);
            }
            delays.push(alarm.unwrap_or(AFTER));
        }
        let detected = delays.iter().filter(|d| **d < AFTER).count();
        delays.sort_unstable();
        StepResult {
            detected: detected as f64 / all.len() as f64,
            named: named as f64 / detected.max(1) as f64,
            delay_median_s: delays[delays.len() / 2] as f64,
        }
    })
}
