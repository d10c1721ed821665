//! Monitors of `fault_ml` that carry something from epoch to epoch.

use fault_ml::classical::{GlrMonitor, GlrParameters};
use fault_ml::particle::{
    IntegrityRisk, Movement, ParticleMonitor, ParticleParameters, SwarmSettings,
};
use fault_ml::{Health, IntegrityMonitor, IntegrityReport, Judgement, SatelliteMeasurement};
use gnss_nav::integrity::{
    self, Assured, IntegritySettings, Misfit, Place, ProtectionLevels, gross,
};
use gnss_nav::least_squares::Consistency;
use gnss_nav::{Measurement, MeasurementModel, NavError, SatelliteId, Solution, least_squares};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::Raim;
use crate::ReceiverError;

/// Epochs closer than this are not judged anew, s: the error of a pseudorange lasts about as long, and
/// windows and process noise are set for epochs a second apart.
const SPACING_S: f64 = 0.999;

/// Square of the deviations by which a velocity exceeds its noise in a receiver that moves.
const SIGNIFICANT: f64 = 9.0;

#[derive(Debug)]
enum Monitor {
    Particle(Box<ParticleMonitor>),
    Glr(Box<GlrMonitor>),
}

impl Monitor {
    fn any(&mut self) -> &mut dyn IntegrityMonitor {
        match self {
            Self::Particle(monitor) => monitor.as_mut(),
            Self::Glr(monitor) => monitor.as_mut(),
        }
    }

    fn displace(&mut self, offset_ecef_m: [f64; 3]) {
        match self {
            Self::Particle(monitor) => monitor.displace(&offset_ecef_m),
            Self::Glr(monitor) => monitor.displace(&offset_ecef_m),
        }
    }
}

/// A monitor, and how the epoch is solved without what it has set aside.
#[derive(Debug)]
pub(super) struct Monitored {
    monitor: Monitor,
    settings: IntegritySettings,
    /// The last epoch given to the monitor, s.
    last_s: Option<f64>,
    /// The last epoch of all, s, and the velocity in it, ECEF, m/s.
    moving: Option<(f64, Vector3<f64>)>,
    /// How far the receiver has moved since the monitor last saw an epoch, ECEF, m.
    moved_m: Vector3<f64>,
    /// Score and threshold of the last epoch judged.
    judged: Option<Judgement>,
    /// The same of the last alarm.
    alarm: Option<Judgement>,
    /// Satellites the monitor does not believe.
    set_aside: Vec<u32>,
}

impl Monitored {
    /// The monitor `raim` stands for; none where there is none that carries anything on.
    ///
    /// # Errors
    /// [`ReceiverError::Monitor`]; the parameters are those of the library.
    pub(super) fn new(raim: Raim, seed: u64) -> Result<Option<Self>, ReceiverError> {
        let particle = |movement| -> Result<Monitor, ReceiverError> {
            let parameters = ParticleParameters::receiver(movement).check()?;
            let random = ChaCha8Rng::seed_from_u64(seed);
            let monitor = ParticleMonitor::new(parameters, random);
            Ok(Monitor::Particle(Box::new(monitor)))
        };
        let monitor = match raim {
            Raim::None | Raim::LeastSquares(_) => return Ok(None),
            Raim::LikelihoodRatio(_) => {
                Monitor::Glr(Box::new(GlrMonitor::new(GlrParameters::default())?))
            }
            Raim::Particles => particle(Movement::Bootstrap)?,
            Raim::Swarm => particle(Movement::Swarm(SwarmSettings::default()))?,
        };
        // Where particle filters decide, residuals only tell whether what is left agrees.
        let untouched = IntegritySettings {
            most_faults: 0,
            ..IntegritySettings::default()
        };
        Ok(Some(Self {
            monitor,
            settings: raim.settings().unwrap_or(untouched),
            last_s: None,
            moving: None,
            moved_m: Vector3::zeros(),
            judged: None,
            alarm: None,
            set_aside: Vec::new(),
        }))
    }

    /// Score and threshold of the last epoch, where it could be judged.
    pub(super) const fn judged(&self) -> Option<Judgement> {
        self.judged
    }

    /// Whether the monitor does not believe `satellite`.
    pub(super) fn sets_aside(&self, satellite: SatelliteId) -> bool {
        self.set_aside.contains(&u32::from(satellite.prn))
    }

    /// Takes an epoch, solved from `start_ecef_m`, and solves it again without what is not believed.
    ///
    /// # Errors
    /// As least squares.
    pub(super) fn epoch(
        &mut self,
        time_s: f64,
        measurements: &[Measurement],
        model: &MeasurementModel,
        start_ecef_m: &Vector3<f64>,
    ) -> Result<Assured, NavError> {
        // An error of thousands of kilometres would turn the lines of sight.
        let gross = gross::search(
            measurements,
            start_ecef_m,
            IntegritySettings::default().most_faults,
        );
        let start_ecef_m = &gross.place_ecef_m.unwrap_or(*start_ecef_m);
        let all = least_squares::solve(&gross.sound, model, start_ecef_m)?;
        self.move_on(time_s, &all);
        if self
            .last_s
            .is_none_or(|last_s| time_s - last_s >= SPACING_S)
        {
            self.last_s = Some(time_s);
            let is_used = |m: &&Measurement| {
                let mut satellites = all.satellites.iter();
                satellites.any(|s| s.satellite == m.satellite)
            };
            let used = gross.sound.iter().filter(is_used);
            let seen: Vec<SatelliteMeasurement> = used
                .map(|m| reduced(m, model, &all.position_ecef_m))
                .collect();
            self.judge(time_s, &seen);
        }
        let (aside, rest): (Vec<Measurement>, Vec<Measurement>) = gross
            .sound
            .iter()
            .partition(|m| self.sets_aside(m.satellite));
        let mut assured = integrity::solve(&rest, model, start_ecef_m, &self.settings)?;
        let misfits = aside
            .iter()
            .map(|m| self.misfit(m, model, &assured.solution));
        assured.misfits.splice(0..0, misfits.collect::<Vec<_>>());
        let misfits = gross.misfits(model, &assured.solution);
        assured.misfits.splice(0..0, misfits);
        let out = aside.iter().chain(&gross.wrong).map(|m| m.satellite);
        assured.solution.excluded.extend(out);
        if let Monitor::Particle(monitor) = &self.monitor {
            assured.protection = Some(&assured.solution)
                .filter(|s| s.consistency == Consistency::Passed && gross.is_unique)
                .and_then(|_| levels(monitor));
        }
        Ok(assured)
    }

    /// Adds up how far the receiver moves, by its Dopplers, where they stand out of their noise.
    fn move_on(&mut self, time_s: f64, solution: &Solution) {
        let now_mps = solution.velocity.as_ref().map(|velocity| {
            let variance = velocity.covariance_m2_s2.fixed_view::<3, 3>(0, 0).trace();
            let is_moving = velocity.velocity_ecef_mps.norm_squared() > SIGNIFICANT * variance;
            velocity.velocity_ecef_mps * f64::from(u8::from(is_moving))
        });
        if let (Some((before_s, before_mps)), Some(now_mps)) = (self.moving, now_mps) {
            self.moved_m += (now_mps + before_mps) * (0.5 * (time_s - before_s));
        }
        self.moving = now_mps.map(|now_mps| (time_s, now_mps));
    }

    /// Gives the monitor an epoch; numbers it cannot take leave the epoch unjudged.
    fn judge(&mut self, time_s: f64, seen: &[SatelliteMeasurement]) {
        let moved_m = std::mem::replace(&mut self.moved_m, Vector3::zeros());
        self.monitor.displace(moved_m.into());
        let monitor = self.monitor.any();
        self.judged = match monitor.epoch(time_s, seen) {
            Ok(IntegrityReport::Judged { judgement, .. }) => Some(judgement),
            Ok(IntegrityReport::WarmingUp | IntegrityReport::Unavailable) | Err(_) => None,
        };
        self.set_aside = monitor.set_aside().to_vec();
        let alarmed = self.judged.filter(|j| j.health() == Health::Faulty);
        self.alarm = alarmed.or(self.alarm);
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
}

/// Protection levels of the clouds, where they have any.
fn levels(monitor: &ParticleMonitor) -> Option<ProtectionLevels> {
    let levels = monitor
        .protection_levels(&IntegrityRisk::default())
        .ok()??;
    Some(ProtectionLevels {
        horizontal_m: levels.horizontal_m,
        vertical_m: levels.vertical_m,
    })
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
