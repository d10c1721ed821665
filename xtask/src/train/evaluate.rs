//! One examination for every monitor: what it sees, how soon, and what it cries wolf at.

use anyhow::Result;
use fault_ml::learned::{Dataset, choose, cn0_class_dbhz};
use fault_ml::metrics::{BalancedAccuracy, Roc, Share};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::BTreeMap;

use super::scoring::Examinee;
use crate::order::quantile;

/// Windows that areas and accuracies are taken over, evenly by kind, fault and C/N0.
const EXAMINED: usize = 20_000;
/// Draws of the bootstrap.
const ROUNDS: usize = 200;

/// Places at which a ROC is drawn: false alarms of 0 to 1.
const DRAWN: usize = 51;

/// A decision on a window.
#[derive(Debug, Clone, Copy)]
struct Decision {
    scenario: u32,
    score: f64,
    faulty: bool,
    /// Whether the label changed within the window.
    new: bool,
    cn0_dbhz: i64,
}

/// What an alarm threshold does to one kind of fault.
#[derive(Debug, Clone, Default)]
pub struct OnFault {
    /// Faults in the test scenarios.
    pub faults: usize,
    /// Time from the true onset to the first alarm, s, of those that alarmed.
    pub delays_s: Vec<f64>,
}

impl OnFault {
    /// Part that was found, with its interval.
    #[must_use]
    pub fn detected(&self) -> Share {
        Share::of(self.delays_s.len(), self.faults)
    }

    /// Median time to the alarm, those never found counting as endless, s.
    #[must_use]
    pub fn median_delay_s(&self) -> f64 {
        self.delay_s(0.5)
    }

    /// Time by which that part of the faults has alarmed, s.
    fn delay_s(&self, part: f64) -> f64 {
        let mut delays = self.delays_s.clone();
        delays.resize(self.faults, f64::INFINITY);
        quantile(delays, part)
    }
}

/// Detections at one rate of false alarms.
#[derive(Debug, Clone, Copy)]
pub struct RocBand {
    /// Part of the healthy windows above the threshold.
    pub false_alarms: f64,
    /// Part of the faulty ones.
    pub detections: f64,
    /// Lower and upper end of that, over scenarios.
    pub band: (f64, f64),
}

/// The figures of one monitor.
#[derive(Debug, Clone)]
pub struct Examination {
    /// Name.
    pub name: String,
    /// Area under the ROC, and its band over scenarios.
    pub area: f64,
    /// Lower and upper end of the band.
    pub area_band: (f64, f64),
    /// The ROC and its band over scenarios.
    pub roc: Vec<RocBand>,
    /// Area of each fault against all healthy windows.
    pub area_by_fault: BTreeMap<String, f64>,
    /// Largest balanced accuracy of any threshold on the validation scenarios, applied to the test.
    pub balanced: BalancedAccuracy,
    /// The same without windows in which the label changed.
    pub balanced_steady: BalancedAccuracy,
    /// By class of C/N0, dB-Hz.
    pub balanced_by_cn0: BTreeMap<i64, BalancedAccuracy>,
    /// Alarm threshold.
    pub threshold: f64,
    /// By fault, at it.
    pub faults: BTreeMap<String, OnFault>,
}

/// Steps to examine a monitor on.
#[derive(Debug, Clone, Copy)]
pub struct Examined<'a> {
    /// By which the cut between windows is found.
    pub validation: &'a Dataset,
    /// By which areas and accuracies are found: the innovation test has left out what it found.
    pub watched: &'a Dataset,
    /// By which alarms are found: nothing was left out, as it is until a monitor's first alarm.
    pub unwatched: &'a Dataset,
}

/// Examines `examinee` on windows of so many steps, and by its alarms at `threshold`.
///
/// # Errors
/// Where a part is too small or holds no numbers.
pub fn examine(
    name: &str,
    examinee: &Examinee,
    examined: Examined,
    window: usize,
    threshold: f64,
) -> Result<Examination> {
    let (validation, test) = (examined.validation, examined.watched);
    let held_out = examinee.all_scores(validation)?;
    let scores = examinee.all_scores(test)?;
    let alarms = examinee.all_scores(examined.unwatched)?;
    let held_out = decisions(validation, &held_out, window);
    let plain: Vec<(f64, bool)> = held_out.iter().map(|d| (d.score, d.faulty)).collect();
    let cut = best_cut(&plain);
    let all = decisions(test, &scores, window);
    let accuracy = |keep: &dyn Fn(&Decision) -> bool| {
        let kept = all.iter().filter(|d| keep(d));
        BalancedAccuracy::of(kept.map(|d| (d.score > cut, d.faulty)))
    };
    let mut classes: Vec<i64> = all.iter().map(|d| d.cn0_dbhz).collect();
    classes.sort_unstable();
    classes.dedup();
    let plain: Vec<(f64, bool)> = all.iter().map(|d| (d.score, d.faulty)).collect();
    let mut by_scenario: BTreeMap<u32, Vec<(f64, bool)>> = BTreeMap::new();
    for d in &all {
        by_scenario
            .entry(d.scenario)
            .or_default()
            .push((d.score, d.faulty));
    }
    let groups: Vec<_> = by_scenario.into_values().collect();
    let (area_band, roc_bands) = bands(&groups);
    let roc = Roc::new(&plain);
    let at = |(k, band)| RocBand {
        false_alarms: false_alarms(k),
        detections: roc
            .as_ref()
            .map_or(f64::NAN, |roc| roc.detections_at(false_alarms(k))),
        band,
    };
    Ok(Examination {
        name: name.to_owned(),
        area: roc.as_ref().map_or(f64::NAN, Roc::area),
        area_band,
        roc: roc_bands.into_iter().enumerate().map(at).collect(),
        area_by_fault: area_by_fault(test, &scores, window),
        balanced: accuracy(&|_| true),
        balanced_steady: accuracy(&|d| !d.new),
        balanced_by_cn0: classes
            .iter()
            .map(|c| (*c, accuracy(&|d| d.cn0_dbhz == *c)))
            .collect(),
        threshold,
        faults: on_faults(examined.unwatched, &alarms, threshold),
    })
}

/// False alarms at place `k` of a drawn ROC.
fn false_alarms(k: usize) -> f64 {
    k as f64 / (DRAWN - 1) as f64
}

/// Bands of the area and of the detections at each place, over groups that hang together.
fn bands(groups: &[Vec<(f64, bool)>]) -> ((f64, f64), [(f64, f64); DRAWN]) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let unknown = (f64::NAN, f64::NAN);
    let area = Roc::bands(groups, ROUNDS, &mut random, |roc| [roc.area()]);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let detections = |roc: &Roc| std::array::from_fn(|k| roc.detections_at(false_alarms(k)));
    let detections = Roc::bands(groups, ROUNDS, &mut random, detections);
    (
        area.map_or(unknown, |[area]| area),
        detections.unwrap_or([unknown; DRAWN]),
    )
}

fn decisions(data: &Dataset, scores: &[Vec<Option<f64>>], window: usize) -> Vec<Decision> {
    let ends = choose(data, window, EXAMINED, 2);
    let decide = |end: &fault_ml::learned::WindowEnd| {
        let sequence = data.sequences.get(end.sequence)?;
        let step = sequence.steps.get(end.newest)?;
        Some(Decision {
            scenario: sequence.scenario,
            score: (*scores.get(end.sequence)?.get(end.newest)?)?,
            faulty: step.label.is_faulty(),
            new: sequence
                .since_change(end.newest)
                .is_some_and(|n| n < window),
            cn0_dbhz: cn0_class_dbhz(step.step.cn0_dbhz),
        })
    };
    ends.iter().filter_map(decide).collect()
}

/// The threshold of the largest balanced accuracy over scores and whether they are of faulty windows.
#[must_use]
pub fn best_cut(scores: &[(f64, bool)]) -> f64 {
    let roc = Roc::new(scores);
    let points = roc.iter().flat_map(|roc| roc.points());
    let best = points
        .max_by(|a, b| (a.detections - a.false_alarms).total_cmp(&(b.detections - b.false_alarms)));
    best.map_or(0.0, |point| point.threshold)
}

/// Scores of windows of `data`, drawn as those of an examination, and whether they are of faulty ones.
pub fn windows(
    data: &Dataset,
    scores: &[Vec<Option<f64>>],
    window: usize,
) -> impl Iterator<Item = (f64, bool)> {
    let all = decisions(data, scores, window);
    all.into_iter().map(|d| (d.score, d.faulty))
}

fn area_by_fault(
    data: &Dataset,
    scores: &[Vec<Option<f64>>],
    window: usize,
) -> BTreeMap<String, f64> {
    let mut faulty: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut quiet = Vec::new();
    for end in choose(data, window, EXAMINED, 2) {
        let sequence = &data.sequences[end.sequence];
        let Some(score) = scores[end.sequence][end.newest] else {
            continue;
        };
        if sequence.steps[end.newest].label.is_faulty() {
            faulty
                .entry(sequence.fault.clone())
                .or_default()
                .push(score);
        } else {
            quiet.push(score);
        }
    }
    let area = |(fault, scores): (String, Vec<f64>)| {
        let mut all: Vec<(f64, bool)> = scores.into_iter().map(|s| (s, true)).collect();
        all.extend(quiet.iter().map(|s| (*s, false)));
        (fault, Roc::new(&all).map_or(f64::NAN, |roc| roc.area()))
    };
    faulty.into_iter().map(area).collect()
}

/// The first alarm of every fault at `threshold`.
#[must_use]
pub fn on_faults(
    data: &Dataset,
    scores: &[Vec<Option<f64>>],
    threshold: f64,
) -> BTreeMap<String, OnFault> {
    // A channel may fall into several sequences: the fault is one.
    let mut first: BTreeMap<(String, u32), (f64, Option<f64>)> = BTreeMap::new();
    for (sequence, scores) in data.sequences.iter().zip(scores) {
        for (step, score) in sequence.steps.iter().zip(scores) {
            if !step.label.is_faulty() {
                continue;
            }
            let key = (sequence.fault.clone(), sequence.scenario);
            let entry = first.entry(key).or_insert((step.time_s, None));
            if entry.1.is_none() && score.is_some_and(|s| s > threshold) {
                entry.1 = Some(step.time_s - entry.0);
            }
        }
    }
    let mut faults: BTreeMap<String, OnFault> = BTreeMap::new();
    for ((fault, _), (_, delay_s)) in first {
        let on = faults.entry(fault).or_default();
        on.faults += 1;
        on.delays_s.extend(delay_s);
    }
    faults
}

impl Examination {
    /// All figures.
    #[must_use]
    pub fn figures(&self) -> Value {
        let accuracy = |b: &BalancedAccuracy| json!(b.value());
        let faults: serde_json::Map<String, Value> = self
            .faults
            .iter()
            .map(|(fault, on)| {
                let share = on.detected();
                let delay = |part| Some(on.delay_s(part)).filter(|d| d.is_finite());
                let value = json!({
                    "faults": on.faults, "detected": share.value, "detected_95": [share.low, share.high],
                    "median_delay_s": delay(0.5), "quartile_delays_s": [delay(0.25), delay(0.75)], "area": self.area_by_fault.get(fault),
                });
                (fault.clone(), value)
            })
            .collect();
        let classes: BTreeMap<String, Value> = self
            .balanced_by_cn0
            .iter()
            .map(|(c, b)| (c.to_string(), accuracy(b)))
            .collect();
        json!({
            "area": self.area, "area_95": [self.area_band.0, self.area_band.1],
            "balanced_accuracy": accuracy(&self.balanced),
            "balanced_accuracy_steady": accuracy(&self.balanced_steady),
            "balanced_accuracy_by_cn0_dbhz": classes,
            "threshold": self.threshold,
            "faults": faults,
        })
    }
}
