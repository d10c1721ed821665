//! Integrity monitoring by particle filters, for a receiver at rest.

use fault_ml::particle::{
    CheckedParticleParameters, IntegrityRisk, Movement, ParticleMonitor, ParticleParameters,
    SwarmSettings,
};
use fault_ml::{Health, IntegrityMonitor, IntegrityReport, Judgement, SatelliteMeasurement};
use gnss_nav::integrity::{self, Misfit, Place, ProtectionLevels};
use gnss_nav::{Measurement, MeasurementModel, Solution};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::single_point::{self, Chosen, Fix};
use crate::ReceiverError;

/// Which particle filters watch the pseudoranges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParticleRaim {
    /// Bootstrap filters.
    Bootstrap,
    /// Filters moved by a particle swarm.
    Swarm,
}

impl ParticleRaim {
    /// Name in options and results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bootstrap => "pf",
            Self::Swarm => "pso-pf",
        }
    }

    fn parameters(self) -> Result<CheckedParticleParameters, ReceiverError> {
        let movement = match self {
            Self::Bootstrap => Movement::Bootstrap,
            Self::Swarm => Movement::Swarm(SwarmSettings::default()),
        };
        Ok(ParticleParameters::receiver(movement).check()?)
    }
}

/// The filters at work.
#[derive(Debug)]
pub(super) struct ParticleWatch {
    which: ParticleRaim,
    monitor: ParticleMonitor,
    /// Score and threshold of the last epoch judged.
    judged: Option<Judgement>,
    /// The same of the last alarm.
    alarm: Option<Judgement>,
}

impl ParticleWatch {
    /// # Errors
    /// [`ReceiverError::Monitor`]; the parameters are those of the library.
    pub(super) fn new(which: ParticleRaim, seed: u64) -> Result<Self, ReceiverError> {
        let random = ChaCha8Rng::seed_from_u64(seed);
        Ok(Self {
            which,
            monitor: ParticleMonitor::new(which.parameters()?, random),
            judged: None,
            alarm: None,
        })
    }

    pub(super) const fn name(&self) -> &'static str {
        self.which.name()
    }

    /// Score and threshold of the last epoch, where it could be judged.
    pub(super) const fn judged(&self) -> Option<Judgement> {
        self.judged
    }

    /// Takes an epoch, solved from `start_ecef_m`, and solves it again without what is not believed.
    ///
    /// # Errors
    /// [`ReceiverError::Nav`] as least squares, [`ReceiverError::Monitor`] for numbers no filter can
    /// take.
    pub(super) fn epoch(
        &mut self,
        time_s: f64,
        chosen: &Chosen,
        model: &MeasurementModel,
        start_ecef_m: &Vector3<f64>,
        most_pdop: f64,
    ) -> Result<Fix, ReceiverError> {
        let all = single_point::untested(chosen, model, start_ecef_m, most_pdop)?;
        let is_used = |m: &&Measurement| {
            let mut satellites = all.solution.satellites.iter();
            satellites.any(|s| s.satellite == m.satellite)
        };
        let seen: Vec<SatelliteMeasurement> = chosen
            .used
            .iter()
            .filter(is_used)
            .map(|m| reduced(m, model, &all.solution.position_ecef_m))
            .collect();
        self.judge(time_s, &seen)?;
        let mut rest = chosen.clone();
        rest.used.retain(|m| !self.sets_aside(m));
        let mut fix = if rest.used.len() == chosen.used.len() {
            all
        } else {
            single_point::untested(&rest, model, start_ecef_m, most_pdop)?
        };
        let aside = chosen.used.iter().filter(|m| self.sets_aside(m));
        fix.misfits = aside
            .map(|m| self.misfit(m, model, &fix.solution))
            .collect();
        fix.solution.excluded = fix.misfits.iter().map(|m| m.satellite).collect();
        fix.protection = self.protection()?;
        Ok(fix)
    }

    fn judge(&mut self, time_s: f64, seen: &[SatelliteMeasurement]) -> Result<(), ReceiverError> {
        self.judged = match self.monitor.epoch(time_s, seen)? {
            IntegrityReport::Judged { judgement, .. } => Some(judgement),
            IntegrityReport::WarmingUp | IntegrityReport::Unavailable => None,
        };
        let alarmed = self.judged.filter(|j| j.health() == Health::Faulty);
        self.alarm = alarmed.or(self.alarm);
        Ok(())
    }

    fn sets_aside(&self, measurement: &Measurement) -> bool {
        let id = u32::from(measurement.satellite.prn);
        self.monitor.set_aside().contains(&id)
    }

    fn misfit(
        &self,
        measurement: &Measurement,
        model: &MeasurementModel,
        solution: &Solution,
    ) -> Misfit {
        Misfit {
            satellite: measurement.satellite,
            residual_m: integrity::residual(measurement, model, solution)
                .map_or(f64::NAN, |(residual_m, _)| residual_m),
            score: self.alarm.map_or(f64::NAN, |a| a.score()),
            threshold: self.alarm.map_or(f64::NAN, |a| a.threshold()),
            place: Place::InUse,
        }
    }

    /// Levels of the cloud; a swarm draws its cloud together, which bounds nothing.
    fn protection(&self) -> Result<Option<ProtectionLevels>, ReceiverError> {
        if self.which == ParticleRaim::Swarm {
            return Ok(None);
        }
        let levels = self.monitor.protection_levels(&IntegrityRisk::default())?;
        Ok(levels.map(|levels| ProtectionLevels {
            horizontal_m: levels.horizontal_m,
            vertical_m: levels.vertical_m,
        }))
    }
}

/// A measurement without satellite clock and delays, as a monitor takes it.
fn reduced(
    measurement: &Measurement,
    model: &MeasurementModel,
    position_ecef_m: &Vector3<f64>,
) -> SatelliteMeasurement {
    let predicted = model.predict(
        &measurement.state,
        position_ecef_m,
        measurement.receive_time,
    );
    let path = predicted.line_of_sight;
    let variance_m2 = model.variance_m2(
        measurement.pseudorange_variance_m2,
        measurement.user_range_accuracy_m,
        &predicted,
    );
    SatelliteMeasurement {
        id: u32::from(measurement.satellite.prn),
        position_ecef_m: path.satellite_position_ecef_m.into(),
        pseudorange_m: measurement.pseudorange_m - (predicted.pseudorange_m - path.range_m),
        variance_m2,
    }
}
