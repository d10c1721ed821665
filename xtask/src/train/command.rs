//! `cargo xtask train`: runs, fits, calibrates, writes.

use std::fmt;
use std::fs;
use std::io::{BufReader, BufWriter, Write as _};
use std::path::Path;

use anyhow::{Context, Result};
use clap::ValueEnum;
use fault_ml::learned::{Dataset, LearnedModel, ModelKind, read_csv, write_csv};
use serde_json::json;

use super::fit::{FALSE_ALARMS_PER_HOUR, Recipe, with_evidence};
use super::harvest::{Product, Unwatched, harvest, labelled_steps};
use super::plan::{KINDS, Plan, Series};
use super::quiet;
use crate::scenario::command::Which;
use crate::scenario::make::Level;

/// Scenarios learned from.
pub const RUNS: u32 = 400;
/// Scenarios that training stops by, and calibration and evidence are chosen by, for each that is learned from.
const VALIDATION_SHARE: f64 = 0.4;
/// Healthy channel-hours of the first threshold.
const CHANNEL_HOURS: f64 = 20.0;

/// Which model is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Trained {
    /// Support-vector machine.
    Svm,
    /// Long short-term memory.
    Lstm,
}

impl From<Trained> for ModelKind {
    fn from(trained: Trained) -> Self {
        match trained {
            Trained::Svm => Self::Svm,
            Trained::Lstm => Self::Lstm,
        }
    }
}

/// The first `count` of a series.
#[must_use]
pub fn plans(series: Series, count: u32) -> Vec<Plan> {
    (0..count).map(|number| Plan::new(number, series)).collect()
}

/// Labelled steps of `runs` scenarios to learn from.
///
/// # Errors
/// Where a run fails.
pub fn simulate(runs: u32) -> Result<Dataset> {
    harvest(&plans(Series::TRAINING, runs), Level::Correlator, &Product)
}

/// Of `runs` scenarios learned from, the plans of those that choices are made by.
#[must_use]
pub fn validation(runs: u32) -> Vec<Plan> {
    let count = (VALIDATION_SHARE * f64::from(runs)).ceil() as u32;
    plans(Series::VALIDATION, count)
}

/// Trains the default model of a kind on `training`; choices are made by scenarios of another series, `runs` times
/// 0.4.
///
/// # Errors
/// Where there is too little to learn from or a run fails.
pub fn train(trained: Trained, training: &Dataset, runs: u32) -> Result<LearnedModel> {
    let plans = validation(runs);
    let held_out = harvest(&plans, Level::Correlator, &Product)?;
    let model = Recipe::product(trained.into()).fit(training, &held_out)?;
    let unwatched = harvest(&plans, Level::Correlator, &Unwatched)?;
    let numbers = 0..quiet::runs(CHANNEL_HOURS);
    let interval_s = model.card().interval_s;
    let model = with_evidence(model, &unwatched, FALSE_ALARMS_PER_HOUR, |examinees| {
        let all = quiet::scores(Series::VALIDATION, numbers.clone(), examinees, interval_s)?;
        Ok(all.into_iter().map(|quiet| quiet.scores).collect())
    })?;
    let mut card = model.card().clone();
    card.training["data"] = json!({
        "generator": "xtask::train::plan", "kinds": KINDS, "level": "correlator",
        "training": { "seed": Series::TRAINING.seed, "week": Series::TRAINING.week,
            "scenarios": training.scenarios().len(), "steps": training.steps() },
        "validation": { "seed": Series::VALIDATION.seed, "week": Series::VALIDATION.week,
            "scenarios": held_out.scenarios().len(), "healthy_channel_hours": card.operating_point.channel_hours },
    });
    Ok(model.with_card(card)?)
}

/// Labelled steps as `cargo xtask train --save-data` has written them.
///
/// # Errors
/// Names file, line and column of what is wrong.
pub fn read(path: &Path) -> Result<Dataset> {
    let file = fs::File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    read_csv(BufReader::new(file)).with_context(|| path.display().to_string())
}

/// Writes labelled steps, a row each.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write(data: &Dataset, path: &Path) -> Result<()> {
    let file = fs::File::create(path);
    let mut file =
        BufWriter::new(file.with_context(|| format!("cannot write {}", path.display()))?);
    write_csv(data, &mut file)?;
    file.flush()
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Receives a scenario and writes what its monitors were shown into `steps.csv`, labelled with the truth; returns
/// what is to be said.
///
/// # Errors
/// Where the scenario is wrong, the receiver fails or the file cannot be written.
pub fn export(which: &Which) -> Result<String> {
    let data = labelled_steps(&which.scenario()?, 0, which.level, &Unwatched)?;
    let folder = &which.out;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let path = folder.join("steps.csv");
    write(&data, &path)?;
    Ok(format!(
        "{} steps are in {}\n",
        data.steps(),
        path.display()
    ))
}

/// Writes weights and card of `model` into `folder`, named after the kind.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write_model(model: &LearnedModel, folder: &Path) -> Result<()> {
    let (weights, card) = model.save()?;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let name = model.card().kind.name();
    for (end, bytes) in [
        ("safetensors", weights.as_slice()),
        ("json", card.as_bytes()),
    ] {
        let path = folder.join(format!("{name}.{end}"));
        fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The model of a kind in `folder`.
///
/// # Errors
/// Names the file that cannot be read, or what is wrong with it.
pub fn read_model(kind: ModelKind, folder: &Path) -> Result<LearnedModel> {
    let path = |end: &str| folder.join(format!("{}.{end}", kind.name()));
    let (weights, card) = (path("safetensors"), path("json"));
    let bytes = fs::read(&weights).with_context(|| format!("cannot read {}", weights.display()))?;
    let text =
        fs::read_to_string(&card).with_context(|| format!("cannot read {}", card.display()))?;
    LearnedModel::load(&bytes, &text).with_context(|| weights.display().to_string())
}

/// What people read of a training.
#[derive(Debug, Clone, Copy)]
pub struct Summary<'a>(pub &'a LearnedModel);

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let card = self.0.card();
        let point = &card.operating_point;
        writeln!(f, "{}: {}", card.kind.name(), card.training["fit"])?;
        writeln!(f, "evidence: {}", card.training["evidence"])?;
        writeln!(
            f,
            "threshold {:.2} (log-odds) for {} false alarms a channel and hour, from {:.1} channel-hours{}",
            point.threshold,
            point.false_alarms_per_hour,
            point.channel_hours,
            if point.extrapolated {
                ", by the tail"
            } else {
                ""
            }
        )
    }
}
