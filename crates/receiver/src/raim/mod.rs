//! Receiver autonomous integrity monitoring: what `--raim` chooses between, in `run` and `solve`
//! alike.

mod monitored;

use fault_ml::Judgement;
use gnss_nav::integrity::{self, Assured, IntegritySettings, Misfit, Place};
use gnss_nav::{Measurement, MeasurementModel, NavError, least_squares};
use nalgebra::Vector3;

use crate::ReceiverError;
use crate::record::{EventKind, ScoreRecord};
use monitored::Monitored;

/// What tests the pseudoranges of an epoch, and takes out those that do not fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Raim {
    /// Nothing.
    None,
    /// Residuals and parity space, each epoch by itself.
    LeastSquares(IntegritySettings),
    /// The same, after a likelihood ratio over a window of innovations.
    LikelihoodRatio(IntegritySettings),
    /// Bootstrap particle filters.
    Particles,
    /// Particle filters proposed to by a swarm.
    Swarm,
}

impl Raim {
    /// Name in options.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::LeastSquares(_) => "ls",
            Self::LikelihoodRatio(_) => "glr",
            Self::Particles => "pf",
            Self::Swarm => "pso-pf",
        }
    }

    /// How the residuals of an epoch are tested.
    pub(crate) const fn settings(self) -> Option<IntegritySettings> {
        match self {
            Self::LeastSquares(settings) | Self::LikelihoodRatio(settings) => Some(settings),
            Self::None | Self::Particles | Self::Swarm => None,
        }
    }

    /// The name under which scores are written, of what has a score for the whole epoch.
    pub(crate) const fn scored(self) -> Option<&'static str> {
        match self {
            Self::None | Self::LeastSquares(_) => None,
            Self::LikelihoodRatio(_) | Self::Particles | Self::Swarm => Some(self.name()),
        }
    }
}

/// The monitoring at work.
#[derive(Debug)]
pub(crate) struct RaimWatch {
    raim: Raim,
    monitored: Option<Monitored>,
}

impl RaimWatch {
    /// # Errors
    /// [`ReceiverError::Monitor`]; the parameters are those of the library.
    pub(crate) fn new(raim: Raim, seed: u64) -> Result<Self, ReceiverError> {
        let monitored = Monitored::new(raim, seed)?;
        Ok(Self { raim, monitored })
    }

    /// Solves the epoch `time_s` from `start_ecef_m`, any place, without what does not fit.
    ///
    /// # Errors
    /// As [`least_squares::solve`].
    pub(crate) fn epoch(
        &mut self,
        time_s: f64,
        measurements: &[Measurement],
        model: &MeasurementModel,
        start_ecef_m: &Vector3<f64>,
    ) -> Result<Assured, NavError> {
        if let Some(monitored) = &mut self.monitored {
            return monitored.epoch(time_s, measurements, model, start_ecef_m);
        }
        match self.raim.settings() {
            Some(settings) => integrity::solve(measurements, model, start_ecef_m, &settings),
            None => least_squares::solve(measurements, model, start_ecef_m).map(unassured),
        }
    }

    /// Score and threshold of the last epoch judged, of what judges whole epochs.
    pub(crate) fn score(&self) -> Option<ScoreRecord> {
        let judged: Judgement = self.monitored.as_ref()?.judged()?;
        Some(ScoreRecord {
            monitor: self.raim.name().to_owned(),
            score: judged.score(),
            threshold: judged.threshold(),
        })
    }

    /// Why a satellite is left out, as an event.
    pub(crate) fn exclusion(&self, misfit: &Misfit) -> EventKind {
        let by_monitor = |m: &&Monitored| m.sets_aside(misfit.satellite);
        let monitor = match (misfit.place, self.monitored.as_ref().filter(by_monitor)) {
            (Place::InUse, Some(_)) => self.raim.name(),
            (Place::InUse, None) => "parity",
            (Place::Unused, _) => "residual_below_mask",
        };
        EventKind::Excluded {
            monitor: monitor.to_owned(),
            score: misfit.score,
            threshold: misfit.threshold,
            residual_m: Some(misfit.residual_m).filter(|m| m.is_finite()),
        }
    }
}

/// A solution nothing vouches for.
fn unassured(solution: gnss_nav::Solution) -> Assured {
    Assured {
        solution,
        misfits: Vec::new(),
        protection: None,
    }
}
