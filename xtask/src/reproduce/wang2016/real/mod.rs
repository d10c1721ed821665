//! Steps on real pseudoranges: each satellite in turn, at several times, before every detector.

pub mod detector;
pub mod noise;
pub mod record;
#[cfg(test)]
mod tests;

use anyhow::{Context, Result};
use fault_ml::classical::GlrParameters;
use fault_ml::particle::{Calibration, Movement, ParticleParameters};
use fault_ml::{CorrelatedNoise, Sight};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use self::detector::{Detector, Kind};
use self::noise::Shape;
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
/// Share of clean records that may have a false alarm, under noise of any of the shapes known.
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
    /// Largest score of the clean record, the median over seeds.
    pub clean_largest: f64,
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
    /// The noise of other receivers.
    pub shapes: Vec<Shape>,
    /// Each detector at its own threshold.
    pub own: Vec<RealCase>,
    /// Each at the threshold that at most the stated share of clean records exceeds, whichever of the shapes the noise
    /// has, of the deviations that are stated; never below its own. Nothing is set on the data they are tried on.
    pub stated: Vec<RealCase>,
}

impl RealStudy {
    /// Runs everything; `None` where a recording is absent.
    ///
    /// # Errors
    /// Where a recording is damaged or a detector cannot be run.
    pub fn run() -> Result<Option<Self>> {
        let (Some(record), Some(shapes)) = (Record::read()?, noise::shapes()?) else {
            return Ok(None);
        };
        let mut study = Self {
            satellites: record.satellites(),
            seconds: record.epochs.len(),
            shapes,
            own: Vec::new(),
            stated: Vec::new(),
        };
        for plan in plans(&record)? {
            let told = record.told(plan.factor);
            let clean = clean_largest(&told, plan.kind)?;
            let runs = steps(&told, plan.kind)?;
            let case = |threshold: f64| RealCase {
                label: plan.label.to_owned(),
                threshold,
                clean_largest: clean[clean.len() / 2],
                false_alarm_records: clean.iter().filter(|c| **c > threshold).count() as f64
                    / clean.len() as f64,
                steps: results(&runs, threshold),
            };
            study.own.push(case(plan.threshold));
            let mut threshold = plan.threshold;
            for shape in &study.shapes {
                // The deviation the filters are told changes, the noise does not.
                let noise = shape.as_stated().scaled(1.0 / plan.factor);
                threshold = threshold.max(calibrated(&told, plan.kind, &noise)?);
            }
            study.stated.push(case(threshold));
        }
        Ok(Some(study))
    }
}

/// A detector to be tried.
struct Plan {
    label: &'static str,
    kind: Kind,
    /// It would be run with.
    threshold: f64,
    /// On the stated deviations.
    factor: f64,
}

fn plans(record: &Record) -> Result<Vec<Plan>> {
    let bootstrap = ParticleParameters::receiver(Movement::Bootstrap);
    let corrected = ParticleParameters::receiver(Movement::Swarm(super::study::SWARM));
    let printed = ParticleParameters {
        movement: Movement::Swarm(super::study::SWARM),
        ..corrected
    };
    let plan = |label, kind, threshold| Plan {
        label,
        kind,
        threshold,
        factor: 1.0,
    };
    let particle = |label, parameters: ParticleParameters| {
        plan(label, Kind::Particle(parameters), parameters.threshold)
    };
    let chi_square = fault_ml::classical::chi_square_threshold(record.satellites(), 1e-5)?;
    // Half a chi-square of one degree of freedom at the rate of the first.
    let white = 0.5 * 19.51;
    Ok(vec![
        particle("PF", bootstrap),
        Plan {
            factor: 1.5,
            ..particle("PF, deviations times 1.5", bootstrap)
        },
        particle("PSO-PF, corrected", corrected),
        particle("PSO-PF as printed", printed),
        plan("least squares, 1e-5 an epoch", Kind::ChiSquare, chi_square),
        plan(
            "GLR on residuals, white noise, 1e-5",
            Kind::ParityGlr,
            white,
        ),
        plan(
            "GLR on innovations",
            Kind::InnovationGlr,
            GlrParameters::default().threshold,
        ),
    ])
}

/// Threshold that the stated share of clean records exceeds under this noise.
fn calibrated(record: &Record, kind: Kind, noise: &CorrelatedNoise) -> Result<f64> {
    let calibration = Calibration {
        runs: 60,
        epochs: record.epochs.len() - WARM_UP,
        false_alarm_share: STATED,
    };
    let sights = record.epochs.first().context("an empty record")?;
    let mut random = ChaCha8Rng::seed_from_u64(2016);
    // Whether it can be made is known from the record itself.
    let start = |random| Detector::start(kind, random).ok();
    let score = |detector: &mut Option<Detector>, k: usize, sights: &[Sight]| {
        let mut sights = sights.to_vec();
        take_off_median(&mut sights);
        let decided = detector.as_mut().and_then(|d| d.epoch(k, &sights).ok());
        Ok(decided.map_or(f64::NEG_INFINITY, |(score, _)| score))
    };
    Ok(calibration.threshold_of((sights, noise, WARM_UP), &mut random, start, score)?)
}

/// Largest score of the clean record, by seed, in order.
fn clean_largest(record: &Record, kind: Kind) -> Result<Vec<f64>> {
    let seeds = if kind.has_chance() { CLEAN_SEEDS } else { 1 };
    let mut largest = (0..seeds)
        .map(|seed| {
            let mut detector = Detector::start(kind, ChaCha8Rng::seed_from_u64(seed))?;
            let mut largest = f64::NEG_INFINITY;
            for (k, sights) in record.epochs.iter().enumerate() {
                let (score, _) = detector.epoch(k, sights)?;
                if k >= WARM_UP {
                    largest = largest.max(score);
                }
            }
            Ok(largest)
        })
        .collect::<Result<Vec<f64>>>()?;
    largest.sort_by(f64::total_cmp);
    Ok(largest)
}

/// Scores after a step: by step size, then run by run its satellite and the decisions.
type Runs = [Vec<(usize, Vec<(f64, usize)>)>; 3];

fn steps(record: &Record, kind: Kind) -> Result<Runs> {
    let mut runs: Runs = Default::default();
    for (step_m, runs) in STEPS_M.into_iter().zip(&mut runs) {
        for satellite in 0..record.satellites() {
            for onset in ONSETS {
                let seed = (satellite * 1000 + onset) as u64;
                let mut detector = Detector::start(kind, ChaCha8Rng::seed_from_u64(seed))?;
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
