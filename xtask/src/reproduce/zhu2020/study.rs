//! The trainings, and the flight with and without what was trained.

use std::sync::Arc;

use anyhow::Result;
use fault_ml::learned::{Dataset, LearnedModel, ModelKind, Split};
use gnss_nav::SatelliteId;
use receiver::pipeline::{Policy, Settings, VectorSettings};
use receiver::record::{EventKind, LoopMembership};

use crate::judged;
use crate::reproduce::jiang2017::receivers::Variant;
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;
use crate::train::paper::{self, Accuracy, Lessons};

/// Scalar tracking before the filter takes over, s.
pub const SCALAR_S: f64 = 60.0;
/// When the satellite is switched off, s, and which.
pub const OFF_S: f64 = 80.0;
const OFF_PRN: u8 = 17;
/// Errors count from so long after the filter took over, s.
pub const SETTLING_S: f64 = 5.0;

/// Trainings of one kind and length.
#[derive(Debug, Clone)]
pub struct Cell {
    /// Kind.
    pub kind: ModelKind,
    /// Innovations of a window.
    pub length: usize,
    /// Accuracy by training.
    pub trainings: Vec<Accuracy>,
}

impl Cell {
    /// Mean and standard deviation of the balanced accuracy over trainings, over all windows or only those
    /// in which nothing changes.
    #[must_use]
    pub fn mean_and_deviation(&self, value: impl Fn(&Accuracy) -> f64) -> (f64, f64) {
        let count = self.trainings.len() as f64;
        let mean = self.trainings.iter().map(&value).sum::<f64>() / count;
        let square = self
            .trainings
            .iter()
            .map(|t| (value(t) - mean).powi(2))
            .sum::<f64>();
        (mean, (square / (count - 1.0).max(1.0)).sqrt())
    }
}

/// The flight as one receiver had it.
#[derive(Debug, Clone)]
pub struct Flight {
    /// What people read.
    pub label: &'static str,
    /// Time, s, and error east and north, m.
    pub errors: Vec<(f64, [f64; 2])>,
    /// Largest horizontal error before and after the satellite is switched off, m.
    pub largest_m: [f64; 2],
    /// First exclusion of the satellite after it was switched off, s.
    pub excluded_s: Option<f64>,
    /// Exclusions of healthy satellites.
    pub healthy_excluded: usize,
}

/// Everything.
#[derive(Debug, Clone)]
pub struct Study {
    /// How signals were made.
    pub level: Level,
    /// Runs of every class.
    pub seeds: usize,
    /// Curve by kind, then length.
    pub cells: Vec<Cell>,
    /// Without detection, with each monitor.
    pub flights: Vec<Flight>,
}

impl Study {
    /// Learns from `seeds` runs of every class at the correlator level and judges by as many others made at
    /// `level`; trains every kind and length `trainings` times; then flies.
    ///
    /// # Errors
    /// Where a run or a training fails.
    pub fn run(level: Level, seeds: usize, lengths: &[usize], trainings: u64) -> Result<Self> {
        let split = paper::lessons_of(paper::Flight::Blocked, seeds)?;
        let judging = seeds.div_ceil(2);
        let judges = paper::harvest(paper::Flight::Blocked, judging, paper::JUDGED_BY, level)?;
        let cells = curve(&split, &judges, lengths, trainings)?;
        Ok(Self {
            level,
            seeds,
            cells,
            flights: flights(&paper::lessons(seeds)?, level)?,
        })
    }

    /// The trainings of a kind and length.
    #[must_use]
    pub fn cell(&self, kind: ModelKind, length: usize) -> Option<&Cell> {
        self.cells
            .iter()
            .find(|c| c.kind == kind && c.length == length)
    }
}

fn curve(split: &Split, judges: &Dataset, lengths: &[usize], trainings: u64) -> Result<Vec<Cell>> {
    let kinds = [ModelKind::Lstm, ModelKind::Svm];
    let all: Vec<_> = kinds
        .iter()
        .flat_map(|k| lengths.iter().map(|l| (*k, *l)))
        .collect();
    judged::in_parallel(all.len(), |number| {
        let (kind, length) = all[number];
        let train = |seed| {
            let model = paper::fit(kind, length, split, seed)?;
            paper::accuracy(&model, &split.validation, judges)
        };
        let trainings = (1..=trainings).map(train).collect::<Result<_>>()?;
        Ok(Cell {
            kind,
            length,
            trainings,
        })
    })
}

/// The paper's receiver, watched by `model` alone where there is one.
fn settings(scenario: &Scenario, model: Option<LearnedModel>) -> Settings {
    let base = Variant::Paper.settings(scenario);
    let policy = if model.is_some() {
        Policy::Exclude
    } else {
        Policy::Observe
    };
    let vector = base.vector.map(|vector| VectorSettings {
        from_s: SCALAR_S,
        monitor: None,
        learned: model.into_iter().map(Arc::new).collect(),
        policy,
        ..vector
    });
    Settings { vector, ..base }
}

fn flights(lessons: &Lessons, level: Level) -> Result<Vec<Flight>> {
    let scenario = Scenario::new(&catalogue::find("zhu2020")?, None)?;
    let monitors = [
        ("without detection", None),
        (
            "LSTM of 50",
            Some(paper::monitor(ModelKind::Lstm, lessons)?),
        ),
        ("SVM of 30", Some(paper::monitor(ModelKind::Svm, lessons)?)),
    ];
    let (labels, models): (Vec<_>, Vec<_>) = monitors.into_iter().unzip();
    let settings: Vec<Settings> = models.into_iter().map(|m| settings(&scenario, m)).collect();
    let judged = judged::receive_by_each(&scenario, level, &settings)?;
    Ok(labels
        .into_iter()
        .zip(&judged)
        .map(|(label, j)| flight(label, j))
        .collect())
}

fn flight(label: &'static str, judged: &judged::Judged) -> Flight {
    let to = LoopMembership::Vector;
    let is_switch = |kind: &EventKind| *kind == EventKind::ModeSwitched { to };
    let switched_s = judged
        .events
        .iter()
        .find(|e| is_switch(&e.kind))
        .map(|e| e.time_s);
    let from_s = switched_s.unwrap_or(f64::INFINITY) + SETTLING_S;
    let largest = |begin_s: f64, end_s| {
        let errors = judged.between(begin_s.max(from_s), end_s);
        errors
            .map(judged::JudgedEpoch::horizontal_m)
            .fold(0.0, f64::max)
    };
    let off = Some(SatelliteId::gps(OFF_PRN));
    let exclusions: Vec<_> = judged
        .events
        .iter()
        .filter(|e| matches!(e.kind, EventKind::Excluded { .. }) && e.time_s >= from_s)
        .collect();
    let right = |e: &&&receiver::record::Event| e.satellite == off && e.time_s >= OFF_S;
    Flight {
        label,
        errors: judged
            .between(from_s, f64::INFINITY)
            .map(|e| (e.pvt.time_s, [e.position_enu_m.x, e.position_enu_m.y]))
            .collect(),
        largest_m: [largest(0.0, OFF_S), largest(OFF_S, f64::INFINITY)],
        excluded_s: exclusions.iter().find(right).map(|e| e.time_s),
        healthy_excluded: exclusions.iter().filter(|e| !right(e)).count(),
    }
}
