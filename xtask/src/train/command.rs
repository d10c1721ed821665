//! `cargo xtask train`: runs, fits, examines, writes.

use std::fmt;
use std::fs;
use std::io::{BufReader, BufWriter, Write as _};
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use clap::ValueEnum;
use fault_ml::learned::{Dataset, LearnedModel, ModelKind, Split, read_csv, write_csv};
use fault_ml::{InnovationTest, InnovationTestSettings};
use receiver::pipeline::VectorSettings;
use serde_json::json;

use super::evaluate::{Examination, examine};
use super::fit::{FALSE_ALARMS_PER_HOUR, Recipe};
use super::harvest::{Product, harvest};
use super::plan::{KINDS, Plan};
use super::scoring::Examinee;

/// Seed of the scenarios.
const SEED: u64 = 1;
/// Parts of the scenarios held out for validation and test.
const VALIDATION: f64 = 0.25;
const TEST: f64 = 0.2;

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

/// A model and how it fared, beside the innovation test.
#[derive(Debug, Clone)]
pub struct Report {
    /// The model.
    pub model: LearnedModel,
    /// Its figures, then those of the innovation test.
    pub examinations: [Examination; 2],
}

/// Labelled steps of `runs` scenarios.
///
/// # Errors
/// Where a run fails.
pub fn simulate(runs: u32) -> Result<Dataset> {
    let plans: Vec<Plan> = (0..runs).map(|number| Plan::new(number, SEED)).collect();
    harvest(&plans, SEED, &Product)
}

/// Labelled steps as `cargo xtask train data` has written them.
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

/// Trains the default model of a kind and examines it, on parts of `data` that share no scenario.
///
/// # Errors
/// Where there is too little to learn from.
pub fn train(trained: Trained, data: Dataset) -> Result<Report> {
    let split = data.split(VALIDATION, TEST, SEED);
    report(&split, &Recipe::product(trained.into()))
}

/// Fits `recipe` to `split` and examines what comes of it.
///
/// # Errors
/// Where there is too little to learn from.
pub fn report(split: &Split, recipe: &Recipe) -> Result<Report> {
    let model = recipe.fit(split)?;
    let parts = (&split.validation, &split.test);
    let shape = (recipe.window, recipe.interval_s);
    let examined = |name: &str, examinee: &Examinee| {
        examine(name, examinee, parts, shape, FALSE_ALARMS_PER_HOUR)
    };
    let learned = examined(
        recipe.kind.name(),
        &Examinee::Learned(Arc::new(model.clone())),
    )?;
    let test = InnovationTest::new(VectorSettings::default().monitor.unwrap_or(
        InnovationTestSettings {
            epoch_rate_hz: 1.0 / recipe.interval_s,
            ..InnovationTestSettings::default()
        },
    ))?;
    let innovation = examined("innovation", &Examinee::Innovation(test))?;
    let mut card = model.card().clone();
    let scenarios = |data: &Dataset| data.scenarios().len();
    card.training["data"] = json!({
        "generator": "xtask::train::plan", "seed": SEED, "kinds": KINDS,
        "level": "correlator", "steps": split.training.steps(),
        "scenarios_training": scenarios(&split.training),
        "scenarios_validation": scenarios(&split.validation), "scenarios_test": scenarios(&split.test),
    });
    card.training["test"] = json!({
        recipe.kind.name(): learned.figures(), "innovation": innovation.figures(),
    });
    Ok(Report {
        model: model.with_card(card)?,
        examinations: [learned, innovation],
    })
}

impl Report {
    /// Writes weights and card into `folder`, named after the kind.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let (weights, card) = self.model.save()?;
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let name = self.model.card().kind.name();
        for (end, bytes) in [
            ("safetensors", weights.as_slice()),
            ("json", card.as_bytes()),
        ] {
            let path = folder.join(format!("{name}.{end}"));
            fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let point = &self.model.card().operating_point;
        writeln!(
            f,
            "threshold {:.2} (log-odds) for {} false alarms a channel and hour, from {:.2} channel-hours{}",
            point.threshold,
            point.false_alarms_per_hour,
            point.channel_hours,
            if point.extrapolated {
                ", by the tail"
            } else {
                ""
            }
        )?;
        for e in &self.examinations {
            writeln!(
                f,
                "{}: area {:.4} ({:.4} to {:.4}), balanced accuracy {:.4}, steady {:.4}; {} false alarms, {:.3} ({:.3} to {:.3}) an hour",
                e.name,
                e.area,
                e.area_band.0,
                e.area_band.1,
                e.balanced.value(),
                e.balanced_steady.value(),
                e.false_alarms.events,
                e.false_alarms.per_hour,
                e.false_alarms.low,
                e.false_alarms.high
            )?;
            for (class, accuracy) in &e.balanced_by_cn0 {
                write!(f, "  {class} dB-Hz {:.3}", accuracy.value())?;
            }
            writeln!(f)?;
            for (fault, on) in &e.faults {
                writeln!(
                    f,
                    "  {fault}: {} of {} found, median delay {:.2} s, area {:.4}",
                    on.delays_s.len(),
                    on.faults,
                    on.median_delay_s(),
                    e.area_by_fault.get(fault).copied().unwrap_or(f64::NAN)
                )?;
            }
        }
        Ok(())
    }
}
