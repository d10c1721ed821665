//! Monitors that decide whether a channel is to be believed. Plain numbers in, verdicts out.
//!
//! A [`ChannelMonitor`] watches one channel, step by step; an [`IntegrityMonitor`] judges one epoch
//! of all satellites. Both state a score and the threshold it is held against: faulty is exactly
//! a score above its threshold. What to do about it is for others to decide.
//!
//! [`InnovationTest`] is the first monitor: it needs no training. [`shape`] watches the correlation itself by a control chart. [`learned`] holds those that do,
//! [`metrics`] the figures by which all are compared.
//!
//! [`particle`] holds integrity monitoring by particle filters, [`classical`] the detectors it is
//! measured against. Both take [`Sight`]s, lines of sight and residuals about a reference point, and
//! know nothing of orbits or signals.
//!
//! ```
//! use fault_ml::{Cadence, ChannelMonitor, ChannelVerdict, Innovation, Judgement, MonitorError};
//!
//! /// Holds a code innovation against a fixed multiple of its standard deviation.
//! struct FixedLimit {
//!     sigmas: f64,
//! }
//!
//! impl ChannelMonitor for FixedLimit {
//!     type Input = Innovation;
//!
//!     fn name(&self) -> &str {
//!         "fixed-limit"
//!     }
//!
//!     fn cadence(&self) -> Cadence {
//!         Cadence::NavigationEpoch
//!     }
//!
//!     fn step(&mut self, input: &Innovation) -> Result<ChannelVerdict, MonitorError> {
//!         let score = (input.code_m / input.code_sigma_m).abs();
//!         Ok(ChannelVerdict::Judged(Judgement::new(score, self.sigmas)?))
//!     }
//!
//!     fn reset(&mut self) {}
//! }
//!
//! let mut monitor = FixedLimit { sigmas: 5.0 };
//! let innovation = Innovation {
//!     code_m: 31.0,
//!     code_sigma_m: 4.0,
//!     rate_mps: 0.1,
//!     rate_sigma_mps: 0.2,
//! };
//! assert!(monitor.step(&innovation)?.is_faulty());
//! # Ok::<(), MonitorError>(())
//! ```
#![cfg_attr(doctest, doc = include_str!("../README.md"))]

mod channel;
pub mod classical;
mod crossing_rate;
mod error;
#[cfg(test)]
mod golden;
mod innovation_test;
mod integrity;
mod judgement;
pub mod learned;
mod linearise;
pub mod metrics;
mod noise_fit;
mod noise_model;
pub mod particle;
mod readmission;
pub mod shape;
mod sight;
#[cfg(test)]
mod test_sky;
mod window;

pub use channel::{Cadence, ChannelMonitor, ChannelVerdict, Innovation};
pub use error::MonitorError;
pub use innovation_test::{InnovationStatistic, InnovationTest, InnovationTestSettings};
pub use integrity::{IntegrityMonitor, IntegrityReport, SatelliteMeasurement};
pub use judgement::{Health, Judgement};
pub use linearise::Reference;
pub use noise_model::{CorrelatedNoise, NoiseGenerator};
pub use sight::{STATES, Sight, check_sights};
pub use window::CumulativeRatio;
