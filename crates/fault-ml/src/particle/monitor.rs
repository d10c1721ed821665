//! Particle-filter integrity monitoring of a receiver at rest, from its pseudoranges.

use rand_chacha::ChaCha8Rng;

use super::parameters::{CheckedParticleParameters, Movement};
use super::protection::{IntegrityRisk, ProtectionLevels};
use super::raim::{Decision, ParticleRaim, RaimEpoch};
use crate::error::check_later;
use crate::linearise::{Reference, check_measurements};
use crate::{
    IntegrityMonitor, IntegrityReport, Judgement, MonitorError, STATES, SatelliteMeasurement, Sight,
};

/// Fewest satellites the first position is taken from: one more than needed.
const FEWEST_TO_START: usize = STATES + 1;

/// A [`ParticleRaim`] about a reference point of its own.
///
/// The first epoch with five satellites gives the reference by least squares. The clock of the
/// reference follows the receiver's: every epoch the median residual, which one fault moves
/// little, is taken off, so that any drift or jump common to all satellites is gone before a particle
/// meets it. A receiver that moves says by how much ([`Self::displace`]); particles are errors of that. The process noise of the clock has to cover the error of that median, about
/// 0.5 sigma for eight satellites ([`ParticleParameters::receiver`](super::ParticleParameters)).
#[derive(Debug, Clone)]
pub struct ParticleMonitor {
    parameters: CheckedParticleParameters,
    random: ChaCha8Rng,
    running: Option<(ParticleRaim, Reference)>,
    last_time_s: Option<f64>,
    last: Option<RaimEpoch>,
    sights: Vec<Sight>,
    set_aside: Vec<u32>,
}

impl ParticleMonitor {
    /// Nothing seen yet; `random` is all the chance it takes.
    #[must_use]
    pub const fn new(parameters: CheckedParticleParameters, random: ChaCha8Rng) -> Self {
        Self {
            parameters,
            random,
            running: None,
            last_time_s: None,
            last: None,
            sights: Vec::new(),
            set_aside: Vec::new(),
        }
    }

    /// What the bank said of the last epoch it took.
    #[must_use]
    pub const fn last_epoch(&self) -> Option<&RaimEpoch> {
        self.last.as_ref()
    }

    /// Position and clock by the main filter, once it runs.
    #[must_use]
    pub fn solution(&self) -> Option<Reference> {
        let (_, reference) = self.running.as_ref()?;
        Some(reference.moved(&self.last.as_ref()?.estimate_m))
    }

    /// Protection levels of [`solution`](Self::solution); up is away from the centre of the earth,
    /// 0.2 degrees at most from the vertical.
    ///
    /// # Errors
    /// Where `risk` is not possible.
    pub fn protection_levels(
        &self,
        risk: &IntegrityRisk,
    ) -> Result<Option<ProtectionLevels>, MonitorError> {
        let Some((raim, reference)) = &self.running else {
            return Ok(None);
        };
        let norm = reference
            .position_ecef_m
            .iter()
            .map(|p| p * p)
            .sum::<f64>()
            .sqrt();
        raim.protection_levels(&reference.position_ecef_m.map(|p| p / norm), risk)
    }

    /// The receiver has moved by `offset_ecef_m` (ECEF, m) since the last epoch.
    pub fn displace(&mut self, offset_ecef_m: &[f64; 3]) {
        if let Some((_, reference)) = &mut self.running {
            reference.displace(offset_ecef_m);
        }
    }

    /// The bank, started where this epoch allows it.
    fn start(&mut self, measurements: &[SatelliteMeasurement]) {
        if self.running.is_none() && measurements.len() >= FEWEST_TO_START {
            let random = self.random.clone();
            let raim = ParticleRaim::new(self.parameters, random);
            self.running = Reference::solve(measurements).map(|reference| (raim, reference));
        }
    }

    /// Takes the clock of this epoch into the reference.
    fn follow_clock(&mut self, measurements: &[SatelliteMeasurement]) {
        let at = self.last.map_or([0.0; STATES], |last| last.estimate_m);
        let aside = &self.set_aside;
        let used = measurements.iter().filter(|m| !aside.contains(&m.id));
        if let Some((_, reference)) = &mut self.running {
            reference.follow_clock(used, &at);
        }
    }
}

impl IntegrityMonitor for ParticleMonitor {
    fn name(&self) -> &str {
        match self.parameters.get().movement {
            Movement::Bootstrap => "pf",
            Movement::Swarm(_) => "pso-pf",
        }
    }

    fn epoch(
        &mut self,
        time_s: f64,
        measurements: &[SatelliteMeasurement],
    ) -> Result<IntegrityReport, MonitorError> {
        check_measurements(measurements)?;
        check_later(time_s, self.last_time_s)?;
        self.start(measurements);
        self.follow_clock(measurements);
        self.last_time_s = Some(time_s);
        let Some((raim, reference)) = &mut self.running else {
            return Ok(IntegrityReport::Unavailable);
        };
        self.sights.clear();
        self.sights
            .extend(measurements.iter().map(|m| reference.sight(m)));
        let mut epoch = raim.epoch(time_s, &self.sights)?;
        self.set_aside.clear();
        self.set_aside.extend_from_slice(raim.set_aside());
        if let Some(shift_m) = reference.follow_position(&epoch.estimate_m) {
            raim.shift(&shift_m);
            epoch.estimate_m = std::array::from_fn(|d| epoch.estimate_m[d] + shift_m[d]);
        }
        self.last = Some(epoch);
        let threshold = self.parameters.get().threshold;
        Ok(match epoch.decision {
            Decision::WarmingUp => IntegrityReport::WarmingUp,
            Decision::Unavailable => IntegrityReport::Unavailable,
            Decision::Judged { score, worst } => IntegrityReport::Judged {
                judgement: Judgement::new(score, threshold)?,
                worst,
            },
        })
    }

    fn set_aside(&self) -> &[u32] {
        &self.set_aside
    }

    fn reset(&mut self) {
        *self = Self::new(self.parameters, self.random.clone());
    }
}
