//! Positions from the observations of another receiver: what `receiver solve` does.
//!
//! Observations come in as plain values ([`crate::rinex_obs`]), epoch by epoch; records go out, as
//! from [`crate::pipeline`], to the same sinks.

mod fault;
mod kinematic;
mod noise;
mod report;
mod session;
mod single_point;
mod solver;
#[cfg(test)]
mod tests;

use gnss_nav::Klobuchar;
use gnss_nav::integrity::IntegritySettings;

use crate::raim::Raim;

pub use fault::{FaultShape, InjectedFault};
pub use kinematic::KinematicSettings;
pub use noise::Weights;
pub use session::SolveSession;
pub use solver::{SolveOutcome, Solver};

/// Settings of [`Solver`].
#[derive(Debug, Clone, PartialEq)]
pub struct SolveSettings {
    /// Ionosphere by these parameters; `None`: not modelled.
    pub ionosphere: Option<Klobuchar>,
    /// Whether the troposphere is modelled.
    pub troposphere: bool,
    /// Satellites below are not used, rad.
    pub elevation_mask_rad: f64,
    /// Satellites weaker than this are not used, dB-Hz. Default 25: about where a receiver loses a
    /// carrier without help (`Kaplan2017`, 8.9); what is weaker is often a reflection.
    pub cn0_mask_dbhz: f64,
    /// Solutions of a larger dilution of precision are not relied on. Default 15: a range error of 2 m
    /// is one of 30 m in position.
    pub most_pdop: f64,
    /// What a pseudorange's variance is taken from.
    pub weights: Weights,
    /// What tests the pseudoranges, and takes out those that do not fit.
    pub raim: Raim,
    /// Seed of everything random.
    pub seed: u64,
    /// Filter from epoch to epoch; `None`: each epoch by itself.
    pub kinematic: Option<KinematicSettings>,
    /// Errors added to pseudoranges.
    pub faults: Vec<InjectedFault>,
}

impl Default for SolveSettings {
    fn default() -> Self {
        Self {
            ionosphere: None,
            troposphere: true,
            elevation_mask_rad: 10f64.to_radians(),
            cn0_mask_dbhz: 25.0,
            most_pdop: 15.0,
            weights: Weights::default(),
            raim: Raim::LeastSquares(IntegritySettings::default()),
            seed: 0,
            kinematic: None,
            faults: Vec::new(),
        }
    }
}
