//! A trained model: card, scaler and network, from and to files.

use super::card::{Card, ModelKind, fnv1a};
use super::lstm::LstmCell;
use super::svm::SvmPredictor;
use super::tensors::{Tensors, write};
use super::{LearnedError, Scaler};

/// What scores the steps.
#[derive(Debug, Clone, PartialEq)]
pub enum Network {
    /// Support-vector machine.
    Svm(SvmPredictor),
    /// Long short-term memory.
    Lstm(LstmCell),
}

/// A model that is whole and fits together.
#[derive(Debug, Clone, PartialEq)]
pub struct LearnedModel {
    card: Card,
    scaler: Scaler,
    network: Network,
}

impl LearnedModel {
    /// Puts a model together; the check sum of the card is set.
    ///
    /// # Errors
    /// [`LearnedError::Model`] where the parts do not fit.
    pub fn new(mut card: Card, scaler: Scaler, network: Network) -> Result<Self, LearnedError> {
        card.weights_fnv1a = fnv1a(&write(&scaler, &network)?);
        let model = Self {
            card,
            scaler,
            network,
        };
        model.check()?;
        Ok(model)
    }

    /// Loads a model from the bytes of its weights (safetensors) and the text of its card.
    ///
    /// # Errors
    /// [`LearnedError::Model`] naming the part that is damaged, foreign, newer than this program or of
    /// another model.
    pub fn load(weights: &[u8], card: &str) -> Result<Self, LearnedError> {
        let card = Card::parse(card)?;
        let tensors = Tensors::read(weights)?;
        let found = fnv1a(weights);
        if found != card.weights_fnv1a {
            let expected = &card.weights_fnv1a;
            let what = format!("check sum {found}: the card is of weights with {expected}");
            return Err(LearnedError::model("weights", what));
        }
        let model = Self {
            scaler: tensors.scaler()?,
            network: match card.kind {
                ModelKind::Svm => Network::Svm(tensors.svm()?),
                ModelKind::Lstm => Network::Lstm(tensors.lstm()?),
            },
            card,
        };
        model.check()?;
        Ok(model)
    }

    /// The bytes of the weights and the text of the card.
    ///
    /// # Errors
    /// [`LearnedError::Model`] where they cannot be written.
    pub fn save(&self) -> Result<(Vec<u8>, String), LearnedError> {
        Ok((write(&self.scaler, &self.network)?, self.card.to_text()))
    }

    fn check(&self) -> Result<(), LearnedError> {
        let width = self.card.features.width();
        let refuse = |name: &str, found: usize, expected: usize| {
            let what = format!("{name} is {found}: by the card {expected}");
            Err(LearnedError::model("weights", what))
        };
        if self.scaler.width() != width {
            return refuse("width of the scaler", self.scaler.width(), width);
        }
        match &self.network {
            Network::Svm(svm) if svm.dimensions() != self.card.window * width => {
                let expected = self.card.window * width;
                refuse("length of support vectors", svm.dimensions(), expected)
            }
            Network::Lstm(cell) if cell.weights().inputs != width => {
                refuse("number of inputs", cell.weights().inputs, width)
            }
            _ => Ok(()),
        }
    }

    /// Its card.
    #[must_use]
    pub const fn card(&self) -> &Card {
        &self.card
    }

    /// Its scaler.
    #[must_use]
    pub const fn scaler(&self) -> &Scaler {
        &self.scaler
    }

    /// What scores.
    #[must_use]
    pub const fn network(&self) -> &Network {
        &self.network
    }

    /// The same with another card: another calibration or operating point.
    ///
    /// # Errors
    /// As [`LearnedModel::new`].
    pub fn with_card(self, card: Card) -> Result<Self, LearnedError> {
        Self::new(card, self.scaler, self.network)
    }
}
