//! Long short-term memory of one layer (Zhu2020).

mod cell;
#[cfg(feature = "train")]
mod train;
mod weights;

#[cfg(test)]
pub(super) use cell::tests::weights as test_weights;
pub use cell::{LstmCell, LstmState};
#[cfg(feature = "train")]
pub use train::{LstmFit, LstmTraining};
pub use weights::LstmWeights;
