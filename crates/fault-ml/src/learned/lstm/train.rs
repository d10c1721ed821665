//! Training by candle: AdamW on the cross-entropy, stopped when held-out scenarios no longer gain.

use std::collections::HashMap;

use candle_core::{DType, Device, Tensor, Var};
use candle_nn::rnn::{LSTM, LSTMConfig, LSTMState, RNN, lstm};
use candle_nn::{AdamW, Init, Linear, Module, Optimizer, ParamsAdamW, VarBuilder};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cell::LstmCell;
use super::weights::{GATES, LstmWeights};
use crate::learned::LearnedError;
use crate::learned::Mode;
use crate::learned::dataset::Label;
use crate::learned::windows::Windows;

/// How a layer is trained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LstmTraining {
    /// Units. Default 32.
    pub hidden: usize,
    /// What counts: the newest step of a window, or every one. Default: streaming, every one.
    pub mode: Mode,
    /// Steps after which streaming forgets how it came to remember (but not what). Default 50.
    pub chunk: usize,
    /// Steps from the state that remembers nothing that do not count in streaming. Default 25.
    pub unjudged: usize,
    /// Passes over the windows at most. Default 30.
    pub epochs: usize,
    /// Windows a step of the optimiser. Default 128.
    pub batch: usize,
    /// Rate at first; it falls as half a cosine over all passes. Default 0.005.
    pub learning_rate: f64,
    /// Decay of weights. Default 0.001.
    pub weight_decay: f64,
    /// Passes without gain on the held-out windows before it ends. Default 6.
    pub patience: usize,
    /// Of initial weights and order.
    pub seed: u64,
}

impl Default for LstmTraining {
    fn default() -> Self {
        Self {
            hidden: 32,
            mode: Mode::Streaming,
            chunk: 50,
            unjudged: 25,
            epochs: 30,
            batch: 128,
            learning_rate: 5e-3,
            weight_decay: 1e-3,
            patience: 6,
            seed: 1,
        }
    }
}

/// A trained layer.
#[derive(Debug, Clone)]
pub struct LstmFit {
    /// What runs.
    pub cell: LstmCell,
    /// Passes until the best one.
    pub epochs: usize,
    /// Mean cross-entropy on the held-out windows then, nats.
    pub validation_loss: f64,
}

impl LstmTraining {
    /// Trains on `training` and keeps what is best on `validation`, windows of other scenarios.
    ///
    /// # Errors
    /// [`LearnedError::Training`] for windows of one kind alone, or of different shapes.
    pub fn fit(&self, training: &Windows, validation: &Windows) -> Result<LstmFit, LearnedError> {
        for windows in [training, validation] {
            if !windows.has_both_kinds() {
                return Err(LearnedError::training(
                    "expected healthy and faulty windows",
                ));
            }
        }
        if validation.width() != training.width() {
            return Err(LearnedError::training("expected windows of one width"));
        }
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let network = Network::new(training.width(), self.hidden, &mut random)?;
        let settings = ParamsAdamW {
            lr: self.learning_rate,
            weight_decay: self.weight_decay,
            ..ParamsAdamW::default()
        };
        let mut optimiser = AdamW::new(network.variables(), settings)?;
        let mut order: Vec<usize> = (0..training.len()).collect();
        let mut best: Option<LstmFit> = None;
        for epoch in 0..self.epochs {
            let turn = std::f64::consts::PI * epoch as f64 / self.epochs as f64;
            optimiser
                .set_learning_rate(self.learning_rate * (0.02 + 0.98 * 0.5 * (1.0 + turn.cos())));
            order.shuffle(&mut random);
            for batch in order.chunks(self.batch) {
                self.descend(&network, &mut optimiser, training, batch)?;
            }
            let cell = LstmCell::new(network.weights()?)?;
            let validation_loss = self.loss(&cell, validation);
            if !best
                .as_ref()
                .is_some_and(|b| b.validation_loss <= validation_loss)
            {
                best = Some(LstmFit {
                    cell,
                    epochs: epoch + 1,
                    validation_loss,
                });
            }
            let since = best.as_ref().map_or(0, |b| epoch + 1 - b.epochs);
            if since >= self.patience {
                break;
            }
        }
        best.filter(|b| b.validation_loss.is_finite())
            .ok_or_else(|| LearnedError::training("no pass was of any use"))
    }

    /// Steps of the optimiser over one batch: one in window mode, one a chunk in streaming mode.
    fn descend(
        &self,
        network: &Network,
        optimiser: &mut AdamW,
        windows: &Windows,
        batch: &[usize],
    ) -> Result<(), LearnedError> {
        let (length, width) = (windows.length(), windows.width());
        let chunk = match self.mode {
            Mode::Window => length,
            Mode::Streaming => self.chunk.clamp(1, length),
        };
        let mut state = network.layer.zero_state(batch.len())?;
        for begin in (0..length).step_by(chunk) {
            let steps = chunk.min(length - begin);
            let picked = |k: &usize| {
                let from = k * windows.dimensions() + begin * width;
                windows
                    .values()
                    .iter()
                    .skip(from)
                    .take(steps * width)
                    .copied()
            };
            let values: Vec<f32> = batch.iter().flat_map(picked).collect();
            let input = Tensor::from_vec(values, (batch.len(), steps, width), &Device::Cpu)?;
            let states = network.layer.seq_init(&input, &state)?;
            let last = states
                .last()
                .ok_or_else(|| LearnedError::training("empty windows"))?;
            state = LSTMState::new(last.h().detach(), last.c().detach());
            let first = match self.mode {
                Mode::Window => steps - 1,
                Mode::Streaming => self.unjudged.saturating_sub(begin).min(steps),
            };
            let judged = states.get(first..).unwrap_or_default();
            if judged.is_empty() {
                continue;
            }
            let scores = network.scores(judged)?;
            let labels = labels(windows, batch, begin + first..begin + steps);
            optimiser.backward_step(&cross_entropy(&scores, labels)?)?;
        }
        Ok(())
    }

    /// Mean cross-entropy of what is judged of `windows`.
    fn loss(&self, cell: &LstmCell, windows: &Windows) -> f64 {
        let mut state = cell.zero_state();
        let (mut sum, mut count) = (0.0, 0.0);
        let rows = windows.values().chunks(windows.dimensions());
        for (row, labels) in rows.zip(windows.step_labels().chunks(windows.length())) {
            state.clear();
            let first = match self.mode {
                Mode::Window => windows.length() - 1,
                Mode::Streaming => self.unjudged,
            };
            for (index, (features, label)) in row.chunks(windows.width()).zip(labels).enumerate() {
                let z = f64::from(cell.step(&mut state, features));
                if index >= first {
                    let target = if label.is_faulty() { 1.0 } else { 0.0 };
                    sum += z.max(0.0) + (-z.abs()).exp().ln_1p() - target * z;
                    count += 1.0;
                }
            }
        }
        sum / count
    }
}

/// The variables of a layer and its output, in a fixed order.
struct Network {
    variables: Vec<(&'static str, Var)>,
    layer: LSTM,
    head: Linear,
}

impl Network {
    /// Drawn from `random`: candle's own generator has no seed. Weights are uniform within one over the root
    /// of the units, and what was remembered is kept at first: a bias of one on the gate that forgets.
    fn new(inputs: usize, hidden: usize, random: &mut ChaCha8Rng) -> Result<Self, LearnedError> {
        let bound = 1.0 / (hidden as f32).sqrt();
        let mut drawn = |rows: usize, columns: usize| -> Result<Var, LearnedError> {
            let draw = |_| random.random_range(-bound..bound);
            let values: Vec<f32> = (0..rows * columns).map(draw).collect();
            Ok(Var::from_vec(values, (rows, columns), &Device::Cpu)?)
        };
        let rows = GATES * hidden;
        let (from_input, from_hidden) = (drawn(rows, inputs)?, drawn(rows, hidden)?);
        let head = drawn(1, hidden)?;
        let forgets = |row: usize| if row / hidden == 1 { 1.0_f32 } else { 0.0 };
        let bias: Vec<f32> = (0..rows).map(forgets).collect();
        let variables = vec![
            ("weight_ih_l0", from_input),
            ("weight_hh_l0", from_hidden),
            ("bias_ih_l0", Var::from_vec(bias, rows, &Device::Cpu)?),
            ("head.weight", head),
            ("head.bias", Var::zeros(1, DType::F32, &Device::Cpu)?),
        ];
        let tensor = |(name, var): &(&str, Var)| ((*name).to_owned(), var.as_tensor().clone());
        let by_name: HashMap<_, _> = variables.iter().map(tensor).collect();
        let builder = VarBuilder::from_tensors(by_name, DType::F32, &Device::Cpu);
        let config = LSTMConfig {
            b_ih_init: Some(Init::Const(0.0)),
            b_hh_init: None,
            ..LSTMConfig::default()
        };
        let layer = lstm(inputs, hidden, config, builder.clone())?;
        let head = candle_nn::linear(hidden, 1, builder.pp("head"))?;
        Ok(Self {
            variables,
            layer,
            head,
        })
    }

    fn variables(&self) -> Vec<Var> {
        self.variables.iter().map(|(_, var)| var.clone()).collect()
    }

    /// Scores after each of `states`: by window, step.
    fn scores(&self, states: &[LSTMState]) -> Result<Tensor, LearnedError> {
        let hidden = self.layer.states_to_tensor(states)?;
        Ok(self.head.forward(&hidden)?.squeeze(2)?)
    }

    fn weights(&self) -> Result<LstmWeights, LearnedError> {
        let values = |name: &str| -> Result<Vec<f32>, LearnedError> {
            let found = self.variables.iter().find(|(n, _)| *n == name);
            let (_, var) = found.ok_or_else(|| LearnedError::training(name))?;
            Ok(var.as_tensor().flatten_all()?.to_vec1()?)
        };
        let head = values("head.weight")?;
        let hidden = head.len();
        let from_input = values("weight_ih_l0")?;
        Ok(LstmWeights {
            inputs: from_input.len() / (GATES * hidden),
            hidden,
            from_input,
            from_hidden: values("weight_hh_l0")?,
            bias: values("bias_ih_l0")?,
            head,
            head_bias: values("head.bias")?.first().copied().unwrap_or_default(),
        })
    }
}

/// Labels of `steps` of the windows of a batch: by window, step.
fn labels(windows: &Windows, batch: &[usize], steps: std::ops::Range<usize>) -> Vec<f32> {
    let of_window = |k: &usize| {
        let from = k * windows.length() + steps.start;
        windows.step_labels().iter().skip(from).take(steps.len())
    };
    let number = |label: &Label| if label.is_faulty() { 1.0 } else { 0.0 };
    batch.iter().flat_map(of_window).map(number).collect()
}

/// Mean cross-entropy of log-odds `scores`: max(z, 0) - y z + ln(1 + exp(-|z|)).
fn cross_entropy(scores: &Tensor, labels: Vec<f32>) -> Result<Tensor, LearnedError> {
    let labels = Tensor::from_vec(labels, scores.shape(), &Device::Cpu)?;
    let soft = (scores.abs()?.neg()?.exp()? + 1.0)?.log()?;
    let loss = ((scores.relu()? - (scores * labels)?)? + soft)?;
    Ok(loss.mean_all()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::windows::testing::swellings;

    fn small(mode: Mode) -> LstmTraining {
        LstmTraining {
            hidden: 8,
            mode,
            chunk: 10,
            unjudged: 5,
            epochs: 8,
            batch: 32,
            learning_rate: 0.02,
            ..LstmTraining::default()
        }
    }

    #[test]
    fn the_fused_cell_scores_as_candle_does() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let network = Network::new(4, 32, &mut random).unwrap();
        let cell = LstmCell::new(network.weights().unwrap()).unwrap();
        let values: Vec<f32> = (0..50 * 4)
            .map(|_| random.random_range(-3.0..3.0))
            .collect();
        let input = Tensor::from_vec(values.clone(), (1, 50, 4), &Device::Cpu).unwrap();
        let states = network.layer.seq(&input).unwrap();
        let theirs: Vec<f32> = network
            .scores(&states)
            .unwrap()
            .squeeze(0)
            .unwrap()
            .to_vec1()
            .unwrap();
        let mut state = cell.zero_state();
        for (features, theirs) in values.chunks(4).zip(theirs) {
            let ours = cell.step(&mut state, features);
            // Sums of 36 terms in single precision.
            assert!((ours - theirs).abs() < 1e-5, "{ours} {theirs}");
        }
    }

    #[test]
    fn a_growing_deviation_is_learned_in_both_modes() {
        let (training, validation) = (swellings(400, 20, 1), swellings(100, 20, 2));
        let test = swellings(400, 20, 3);
        for mode in [Mode::Window, Mode::Streaming] {
            let fit = small(mode).fit(&training, &validation).unwrap();
            let mut state = fit.cell.zero_state();
            let rows = test.values().chunks(test.dimensions()).zip(test.labels());
            let right = rows.filter(|(window, label)| {
                (fit.cell.window(&mut state, window) > 0.0) == label.is_faulty()
            });
            // Five steps and more of three times the deviation: hardly ever mistaken.
            assert!(right.count() > 360, "{mode:?}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let (training, validation) = (swellings(60, 20, 1), swellings(20, 20, 2));
        let mut settings = small(Mode::Streaming);
        settings.epochs = 2;
        let weights = |settings: &LstmTraining| {
            let fit = settings.fit(&training, &validation).unwrap();
            fit.cell.weights().clone()
        };
        let first = weights(&settings);
        assert_eq!(weights(&settings), first);
        settings.seed += 1;
        assert_ne!(weights(&settings), first);
        let one_kind = training.filtered(|label| label.is_faulty());
        assert!(settings.fit(&one_kind, &validation).is_err());
    }
}
