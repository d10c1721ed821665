//! From labelled steps to a model with calibration, threshold and figures.

use std::sync::Arc;

use anyhow::Result;
use fault_ml::learned::lstm::LstmTraining;
use fault_ml::learned::svm::SvmTraining;
use fault_ml::learned::{
    Calibration, Card, Dataset, FORMAT, FeatureSet, Features, LearnedModel, Mode, ModelKind,
    Network, OperatingPoint, Scaler, Split, VERSION, Windows, choose, features, healthy_scaler,
};
use serde_json::{Value, json};

use super::scoring::{Examinee, healthy};

/// False alarms of a channel an hour that thresholds are found for.
pub const FALSE_ALARMS_PER_HOUR: f64 = 0.01;
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
    /// Windows trained on.
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
            window: 10,
            mode: Mode::Window,
            decide_every: 5,
            interval_s: 0.02,
            windows: 6000,
            length: 10,
            svm: SvmTraining::default(),
            lstm: LstmTraining::default(),
            seed: 1,
        };
        match kind {
            ModelKind::Svm => base,
            ModelKind::Lstm => Self {
                window: 50,
                mode: Mode::Streaming,
                decide_every: 1,
                windows: 8000,
                length: 150,
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

    /// Trains on the training part of `split`; calibrates and finds the threshold on the validation part.
    ///
    /// # Errors
    /// Where a part is too small or of one kind alone.
    pub fn fit(&self, split: &Split) -> Result<LearnedModel> {
        let rows = features(&split.training, self.features)?;
        let scaler = healthy_scaler(&split.training, &rows)?;
        let training = self.windows((&split.training, &rows), &scaler, self.windows);
        let (network, how) = match self.kind {
            ModelKind::Svm => {
                let fit = self.svm.fit(&training)?;
                let how = json!({
                    "windows": training.len(), "cost": self.svm.cost, "relative_gamma": self.svm.relative_gamma,
                    "support_vectors": fit.predictor.count(), "support_vectors_before_pruning": fit.unpruned,
                });
                (Network::Svm(fit.predictor), how)
            }
            ModelKind::Lstm => {
                let validation = {
                    let rows = features(&split.validation, self.features)?;
                    self.windows((&split.validation, &rows), &scaler, self.windows / 4)
                };
                let settings = LstmTraining {
                    mode: self.mode,
                    ..self.lstm
                };
                let fit = settings.fit(&training, &validation)?;
                let how = json!({
                    "windows": training.len(), "steps": self.length, "units": settings.hidden,
                    "seed": settings.seed, "batch": settings.batch, "learning_rate": settings.learning_rate,
                    "weight_decay": settings.weight_decay, "passes": fit.epochs,
                    "validation_loss_nats": fit.validation_loss,
                });
                (Network::Lstm(fit.cell), how)
            }
        };
        let raw = LearnedModel::new(self.card(how), scaler, network)?;
        calibrated(raw, &split.validation, FALSE_ALARMS_PER_HOUR)
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

/// The model with the calibration and threshold that held-out scenarios give, for `per_hour` false alarms of a
/// channel an hour.
///
/// # Errors
/// Where they hold too little.
pub fn calibrated(model: LearnedModel, held_out: &Dataset, per_hour: f64) -> Result<LearnedModel> {
    let mut card = model.card().clone();
    let interval_s = card.interval_s;
    let examinee = Examinee::Learned(Arc::new(model.clone()));
    let mut scores = examinee.all_scores(held_out)?;
    let ends = choose(held_out, card.window, CALIBRATED_ON, 1);
    let rows: Vec<(f64, bool)> = ends
        .iter()
        .filter_map(|end| {
            let score = (*scores.get(end.sequence)?.get(end.newest)?)?;
            let label = held_out
                .sequences
                .get(end.sequence)?
                .steps
                .get(end.newest)?
                .label;
            Some((score, label.is_faulty()))
        })
        .collect();
    card.calibration = Calibration::fit(&rows)?;
    for score in scores.iter_mut().flatten().flatten() {
        *score = card.calibration.log_odds(*score);
    }
    let healthy = healthy(held_out, &scores, interval_s);
    card.operating_point = healthy.operating_point(per_hour)?;
    Ok(model.with_card(card)?)
}
