//! Integrity monitoring by particle filters (`Wang2016`), and what goes beyond the paper.
//!
//! ```
//! use fault_ml::Sight;
//! use fault_ml::particle::{Decision, ParticleParameters, ParticleRaim};
//! use rand_chacha::ChaCha8Rng;
//! use rand_chacha::rand_core::SeedableRng;
//!
//! let parameters = ParticleParameters::default().check()?;
//! let mut raim = ParticleRaim::new(parameters, ChaCha8Rng::seed_from_u64(1));
//! let directions = [[0.9, 0.0], [0.3, 0.8], [-0.6, 0.6], [-0.8, -0.3], [0.1, -0.7], [0.2, 0.1]];
//! let mut excluded = None;
//! for second in 0..60 {
//!     let sights: Vec<Sight> = (1..).zip(directions).map(|(id, [east, north])| Sight {
//!         id,
//!         design: [-east, -north, -(1.0 - east * east - north * north as f64).sqrt(), 1.0],
//!         residual_m: if id == 2 && second >= 40 { 40.0 } else { 0.0 },
//!         sigma_m: 3.0,
//!     }).collect();
//!     excluded = excluded.or(raim.epoch(f64::from(second), &sights)?.excluded);
//! }
//! assert_eq!(excluded, Some(2));
//! # Ok::<(), fault_ml::MonitorError>(())
//! ```

mod calibration;
mod cloud;
mod evidence;
mod filter;
#[cfg(test)]
mod filter_tests;
#[cfg(test)]
mod golden_tests;
mod likelihood;
mod monitor;
#[cfg(test)]
mod monitor_tests;
mod parameters;
mod proposal;
mod protection;
mod quadratic;
mod raim;
#[cfg(test)]
mod raim_tests;
mod swarm;

pub use calibration::Calibration;
pub use likelihood::Likelihood;
pub use monitor::ParticleMonitor;
pub use parameters::{
    CheckedParticleParameters, ClockState, Movement, ParticleParameters, RatioForm, Response,
};
pub use protection::{IntegrityRisk, ProtectionLevels};
pub use raim::{Decision, ParticleRaim, RaimEpoch};
pub use swarm::{SwarmOrder, SwarmSettings};
