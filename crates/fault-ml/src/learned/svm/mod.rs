//! Support-vector machine with a Gaussian kernel (Jiang2017).

mod predictor;
#[cfg(feature = "train")]
mod prune;
#[cfg(feature = "train")]
mod train;

pub use predictor::SvmPredictor;
#[cfg(feature = "train")]
pub use train::{SvmFit, SvmTraining};
