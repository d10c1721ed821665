//! From labelled steps to a model with calibration, threshold and figures.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Context, Result};
use fault_ml::learned::lstm::LstmTraining;
use fault_ml::learned::svm::SvmTraining;
use fault_ml::learned::{
    Calibration, Card, Dataset, EvidenceRule, FORMAT, FeatureSet, Features, HealthyScores,
    LearnedModel, Mode, ModelKind, Network, OperatingPoint, Scaler, VERSION, Windows, choose,
    features, healthy_scaler,
};
use serde_json::{Value, json};

use super::evaluate::{OnFault, on_faults};
use super::scoring::Examinee;

/// False alarms of a channel an hour that thresholds are found for.
pub const FALSE_ALARMS_PER_HOUR: f64 = 0.01;
/// Offsets of the evidence that are tried, log-odds, and the most that counts of a step.
const OFFSETS: [f64; 4] = [0.0, 0.5, 1.0, 2.0];
const MOST: [f64; 3] = [1.0, 2.0, 4.0];
/// A fault that is not found counts as found after so long, s.
const MISSED_S: f64 = 10.0;
/// Windows that the calibration is fitted to.
const CALIBRATED_ON: usize = 4000;

/// How a model is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recipe {
    /// Which kind.
    pub kind: ModelKind,
    /// What it looks at.
    pub features: FeatureSet,
    /// Steps of its window.
    pub window: usize,
    /// Whether it carries a state.
    pub mode: Mode,
    /// Steps from one decision to the next.
    pub decide_every: usize,
    /// Time between steps, s.
    pub interval_s: f64,
    /// Windows trained on, half healthy and half faulty where there are so many.
    pub windows: usize,
    /// Steps of what is trained on: the window, or longer for a state that is carried.
    pub length: usize,
    /// Of the machine.
    pub svm: SvmTraining,
    /// Of the layer.
    pub lstm: LstmTraining,
    /// Of the choice of windows.
    pub seed: u64,
}

impl Recipe {
    /// The default of `kind` for the receiver as it comes.
    #[must_use]
    pub fn product(kind: ModelKind) -> Self {
        let base = Self {
            kind,
            features: FeatureSet::Full,
            // The features remember what was: a window of more steps only hides it among more numbers.
            window: 1,
            mode: Mode::Window,
            decide_every: 1,
            interval_s: 0.02,
            windows: 8000,
            length: 1,
            svm: SvmTraining {
                cost: 1.0,
                relative_gamma: 0.3,
                ..SvmTraining::default()
            },
            lstm: LstmTraining {
                epochs: 2,
                learning_rate: 2e-3,
                ..LstmTraining::default()
            },
            seed: 1,
        };
        match kind {
            ModelKind::Svm => base,
            ModelKind::Lstm => Self {
                window: 50,
                mode: Mode::Streaming,
                windows: 80_000,
                length: 100,
                ..base
            },
        }
    }

    /// Windows of `data` for training, drawn evenly.
    fn windows(
        &self,
        (data, features): (&Dataset, &[Vec<Features>]),
        scaler: &Scaler,
        count: usize,
    ) -> Windows {
        let ends = choose(data, self.length, count, self.seed);
        Windows::gather(data, features, scaler, self.length, &ends)
    }

    /// Trains on `training`; stops and calibrates by `held_out`.
    ///
    /// # Errors
    /// Where a part is too small or of one kind alone.
    pub fn fit(&self, training: &Dataset, held_out: &Dataset) -> Result<LearnedModel> {
        let rows = features(training, self.features)?;
        let scaler = healthy_scaler(training, &rows)?;
        let training = self.windows((training, &rows), &scaler, self.windows);
        let (network, how) = match self.kind {
            ModelKind::Svm => {
                let fit = self.svm.fit(&training)?;
                let how = json!({
                    "windows": training.len(), "faulty_windows": training.faulty(), "cost": self.svm.cost, "relative_gamma": self.svm.relative_gamma,
                    "support_vectors": fit.predictor.count(), "support_vectors_before_pruning": fit.unpruned,
                });
                (Network::Svm(fit.predictor), how)
            }
            ModelKind::Lstm => {
                let validation = {
                    let rows = features(held_out, self.features)?;
                    self.windows((held_out, &rows), &scaler, self.windows / 4)
                };
                let settings = LstmTraining {
                    mode: self.mode,
                    ..self.lstm
                };
                let fit = settings.fit(&training, &validation)?;
                let how = json!({
                    "windows": training.len(), "faulty_windows": training.faulty(), "steps": self.length, "units": settings.hidden,
                    "seed": settings.seed, "batch": settings.batch, "learning_rate": settings.learning_rate,
                    "weight_decay": settings.weight_decay, "passes": fit.epochs,
                    "validation_loss_nats": fit.validation_loss,
                });
                (Network::Lstm(fit.cell), how)
            }
        };
        let raw = LearnedModel::new(self.card(how), scaler, network)?;
        calibrated(raw, held_out)
    }

    fn card(&self, how: Value) -> Card {
        Card {
            format: FORMAT.to_owned(),
            version: VERSION,
            kind: self.kind,
            features: self.features,
            window: self.window,
            mode: self.mode,
            interval_s: self.interval_s,
            decide_every: self.decide_every,
            calibration: Calibration::NONE,
            evidence: None,
            operating_point: OperatingPoint {
                threshold: 0.0,
                false_alarms_per_hour: FALSE_ALARMS_PER_HOUR,
                channel_hours: 0.0,
                extrapolated: true,
            },
            weights_fnv1a: String::new(),
            training: json!({ "fit": how }),
        }
    }
}

/// `model` with the calibration that held-out scenarios give.
///
/// # Errors
/// Where they hold too little.
pub fn calibrated(model: LearnedModel, held_out: &Dataset) -> Result<LearnedModel> {
    let mut card = model.card().clone();
    let scores = Examinee::Learned(Arc::new(model.clone())).all_scores(held_out)?;
    let ends = choose(held_out, card.window, CALIBRATED_ON, 1);
    let rows: Vec<(f64, bool)> = ends
        .iter()
        .filter_map(|end| {
            let score = (*scores.get(end.sequence)?.get(end.newest)?)?;
            let step = held_out
                .sequences
                .get(end.sequence)?
                .steps
                .get(end.newest)?;
            Some((score, step.label.is_faulty()))
        })
        .collect();
    card.calibration = Calibration::fit(&rows)?;
    Ok(model.with_card(card)?)
}

/// Every rule that is tried.
fn rules() -> Vec<EvidenceRule> {
    let with = |offset| MOST.map(|most| EvidenceRule { offset, most });
    let all = OFFSETS.into_iter().flat_map(with);
    all.filter(|rule| rule.most > rule.offset).collect()
}

/// `model` with the rule of its evidence, and the threshold that belongs to it, that find the faults of `held_out`
/// soonest at `per_hour` false alarms of a channel; `quiet` gives the scores of healthy channels.
///
/// # Errors
/// Where a run fails or a part is too small.
pub fn with_evidence(
    model: LearnedModel,
    held_out: &Dataset,
    per_hour: f64,
    quiet: impl Fn(&[Examinee]) -> Result<Vec<HealthyScores>>,
) -> Result<LearnedModel> {
    let rules = rules();
    let candidates: Vec<LearnedModel> = rules
        .iter()
        .map(|rule| unbounded(&model, Some(*rule)))
        .collect::<Result<_>>()?;
    let examinees: Vec<Examinee> = candidates
        .into_iter()
        .map(|model| Examinee::Learned(Arc::new(model)))
        .collect();
    let quiet = quiet(&examinees)?;
    let mut best: Option<(f64, Card)> = None;
    let mut tried = Vec::new();
    for ((rule, examinee), healthy) in rules.iter().zip(&examinees).zip(&quiet) {
        let point = healthy.operating_point(per_hour)?;
        let faults = on_faults(held_out, &examinee.all_scores(held_out)?, point.threshold);
        let delay_s = mean_delay_s(&faults);
        tried.push(json!({ "rule": rule, "threshold": point.threshold, "mean_delay_s": delay_s }));
        if best.as_ref().is_none_or(|(least, _)| delay_s < *least) {
            let card = Card {
                evidence: Some(*rule),
                operating_point: point,
                ..model.card().clone()
            };
            best = Some((delay_s, card));
        }
    }
    let (_, mut card) = best.context("no rule of the evidence")?;
    card.training["evidence"] = json!({ "tried": tried, "never_found_counts_s": MISSED_S });
    Ok(model.with_card(card)?)
}

/// `model` with that rule of its evidence, and no end to it.
///
/// # Errors
/// None in practice.
pub fn unbounded(model: &LearnedModel, rule: Option<EvidenceRule>) -> Result<LearnedModel> {
    let mut card = model.card().clone();
    card.evidence = rule;
    card.operating_point.threshold = f64::MAX / 4.0;
    Ok(model.clone().with_card(card)?)
}

/// Mean delay over all faults, s.
fn mean_delay_s(faults: &BTreeMap<String, OnFault>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for on in faults.values() {
        let found = on.delays_s.iter().map(|delay_s| delay_s.min(MISSED_S));
        sum += found.sum::<f64>() + MISSED_S * (on.faults - on.delays_s.len()) as f64;
        count += on.faults;
    }
    sum / f64::from(count as u32)
}
