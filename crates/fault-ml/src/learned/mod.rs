//! Monitors that learn from examples which innovations are those of a faulty channel.
//!
//! [`ChannelStep`]s of many scenarios with the truth beside them make a [`Dataset`]. A [`FeatureSet`] says
//! which numbers of a step count, a [`Scaler`] brings them to like size, and [`Windows`] of successive
//! steps train a support-vector machine ([`svm`], Jiang2017) or a long short-term memory ([`lstm`],
//! Zhu2020): with the feature `train`, by linfa and candle. Scenarios that were held out give a
//! [`Calibration`] and an [`OperatingPoint`]. All of it together is a [`LearnedModel`], kept as safetensors with a
//! [`Card`], and run by a [`LearnedMonitor`], which needs neither library.

mod activation;
mod calibration;
mod card;
mod common;
mod csv;
mod dataset;
mod error;
mod evidence;
mod feature;
mod history;
pub mod lstm;
mod model;
mod monitor;
#[cfg(test)]
mod monitor_tests;
mod operating_point;
mod scaler;
mod step;
pub mod svm;
mod tensors;
mod usual;
mod windows;

pub use calibration::{Calibration, sigmoid};
pub use card::{Card, FORMAT, Mode, ModelKind, VERSION};
pub use common::{ChannelStrength, CommonStrength, StrengthChange};
pub use csv::{read_csv, write_csv};
pub use dataset::{Dataset, Label, LabelledStep, Sequence, Split};
pub use error::LearnedError;
pub use evidence::{Evidence, EvidenceRule};
pub use feature::{FeatureSet, FeatureTrack, Features};
pub use history::SlidingWindow;
pub use model::{LearnedModel, Network};
pub use monitor::LearnedMonitor;
pub use operating_point::{HealthyScores, OperatingPoint};
pub use scaler::Scaler;
pub use step::ChannelStep;
pub use windows::{WindowEnd, Windows, choose, cn0_class_dbhz, features, healthy_scaler};
