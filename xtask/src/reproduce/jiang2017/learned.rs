//! The same receivers watched by trained monitors: those of the papers on the paper's receiver, those that come with
//! the product on the product's.

use std::sync::Arc;

use anyhow::{Context, Result};
use fault_ml::learned::{LearnedModel, ModelKind};
use receiver::models::default_model;
use receiver::pipeline::{Policy, Settings, VectorSettings};

use super::receivers::Variant;
use super::study::{BLOCKAGES, Blockage, FIRST_SEED, Run};
use crate::judged;
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;
use crate::train::paper;

/// Runs of every class of C/N0 that the monitors of the paper's receiver learn from.
const LESSONS: usize = 16;

/// A receiver and the monitor that watches it alone.
#[derive(Debug, Clone)]
pub struct Watched {
    /// Key in the summary.
    pub key: &'static str,
    /// What people read.
    pub label: &'static str,
    base: Variant,
    model: Arc<LearnedModel>,
}

impl Watched {
    /// All of them, trained.
    ///
    /// # Errors
    /// Where a training fails or a model that comes with the receiver is damaged.
    pub fn all() -> Result<[Self; 4]> {
        let lessons = paper::lessons(LESSONS)?;
        let of_paper = |kind| paper::monitor(kind, &lessons).map(Arc::new);
        let new = |key, label, base, model| Self {
            key,
            label,
            base,
            model,
        };
        Ok([
            new(
                "paper_baseline_with_svm",
                "paper baseline, SVM of 30",
                Variant::Paper,
                of_paper(ModelKind::Svm)?,
            ),
            new(
                "paper_baseline_with_lstm",
                "paper baseline, LSTM of 50",
                Variant::Paper,
                of_paper(ModelKind::Lstm)?,
            ),
            new(
                "product_with_svm",
                "product, its SVM",
                Variant::Product,
                default_model(ModelKind::Svm)?,
            ),
            new(
                "product_with_lstm",
                "product, its LSTM",
                Variant::Product,
                default_model(ModelKind::Lstm)?,
            ),
        ])
    }

    fn settings(&self, scenario: &Scenario) -> Settings {
        let base = self.base.settings(scenario);
        let vector = base.vector.map(|vector| VectorSettings {
            monitor: None,
            learned: vec![Arc::clone(&self.model)],
            policy: Policy::Exclude,
            ..vector
        });
        Settings { vector, ..base }
    }
}

/// The runs of one receiver over one scenario, by seed.
#[derive(Debug, Clone)]
pub struct WatchedRuns {
    /// The scenario.
    pub blockage: Blockage,
    /// The receiver.
    pub key: &'static str,
    /// What people read.
    pub label: &'static str,
    /// Runs.
    pub runs: Vec<Run>,
}

/// Runs every watched receiver over both scenarios with `seeds` seeds each: by scenario, then receiver.
///
/// # Errors
/// Where a signal cannot be made, a training or a receiver fails.
pub fn runs(level: Level, seeds: usize) -> Result<Vec<WatchedRuns>> {
    let watched = Watched::all()?;
    let mut all = Vec::new();
    for blockage in BLOCKAGES {
        let by_seed = judged::in_parallel(seeds, |number| {
            let seed = FIRST_SEED + number as u64;
            let scenario = Scenario::new(&catalogue::find(blockage.name)?, Some(seed))?;
            let settings: Vec<Settings> = watched.iter().map(|w| w.settings(&scenario)).collect();
            let judged = judged::receive_by_each(&scenario, level, &settings)?;
            Ok(judged
                .iter()
                .map(|j| Run::new(j, &blockage))
                .collect::<Vec<_>>())
        })?;
        for (number, receiver) in watched.iter().enumerate() {
            let of_seed = |runs: &Vec<Run>| runs.get(number).cloned().context("no run");
            all.push(WatchedRuns {
                blockage,
                key: receiver.key,
                label: receiver.label,
                runs: by_seed.iter().map(of_seed).collect::<Result<_>>()?,
            });
        }
    }
    Ok(all)
}
