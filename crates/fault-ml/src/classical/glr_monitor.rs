//! The windowed likelihood ratio on innovations as an integrity monitor.

use super::glr::InnovationGlr;
use super::kalman::KalmanParameters;
use crate::error::{check_later, within};
use crate::linearise::{Reference, check_measurements};
use crate::readmission::Readmission;
use crate::{
    IntegrityMonitor, IntegrityReport, Judgement, MonitorError, STATES, SatelliteMeasurement, Sight,
};

/// Fewest satellites the first position is taken from, and an epoch is judged with.
const FEWEST_TO_JUDGE: usize = STATES + 1;
/// Fewest with which the faulty one can be told.
const FEWEST_TO_NAME: usize = STATES + 2;
/// Width of the uniform fault density a satellite's recovery is weighed against, m, and the logarithm of
/// the odds that take it back: as for the particle filters.
const FAULT_WIDTH_M: f64 = 100.0;
const RECOVERY: f64 = 20.0;
/// Elapsed before the first epoch, s.
const FIRST_ELAPSED_S: f64 = 1.0;

/// Parameters of [`GlrMonitor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlrParameters {
    /// The filter. Default 3 m at first, 0.5 m per square root of a second: the median of residuals, which
    /// the clock of the reference follows, moves by about that.
    pub filter: KalmanParameters,
    /// Steps are sought that began up to so many epochs ago, 1 to 1000. Default 30.
    pub window_epochs: usize,
    /// First epochs, which bring the filter to rest and count for nothing. Default 20.
    pub warm_up_epochs: usize,
    /// A ratio above this is an alarm. Default 35: what lasts with a satellite is no news in every epoch,
    /// though a window of thirty counts it so, and a bias of one and a half stated deviations comes to
    /// 0.5 x 30 x 1.5^2 = 34.
    pub threshold: f64,
}

impl Default for GlrParameters {
    fn default() -> Self {
        Self {
            filter: KalmanParameters {
                initial_sigma_m: 3.0,
                process_noise_m: 0.5,
            },
            window_epochs: 30,
            warm_up_epochs: 20,
            threshold: 35.0,
        }
    }
}

impl GlrParameters {
    fn check(self) -> Result<Self, MonitorError> {
        self.filter.check()?;
        let epochs = ((1.0, 1e3), "1 to 1000");
        within(
            "window (epochs)",
            self.window_epochs as f64,
            epochs.0,
            epochs.1,
        )?;
        within("threshold", self.threshold, (1e-3, 1e6), "0.001 to 1e6")?;
        Ok(self)
    }
}

/// A step sought on the innovations of one Kalman filter (`Willsky1976`), about a reference point that
/// follows the receiver.
///
/// A satellite alarmed on is set aside, and what its step has done to the filter is taken out. It is
/// taken back when its residuals speak for its health.
#[derive(Debug, Clone)]
pub struct GlrMonitor {
    parameters: GlrParameters,
    running: Option<(InnovationGlr, Reference)>,
    last_time_s: Option<f64>,
    epochs: usize,
    aside: Readmission,
}

impl GlrMonitor {
    /// Nothing seen yet.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a parameter is not possible.
    pub fn new(parameters: GlrParameters) -> Result<Self, MonitorError> {
        Ok(Self {
            parameters: parameters.check()?,
            running: None,
            last_time_s: None,
            epochs: 0,
            aside: Readmission::default(),
        })
    }

    /// The receiver has moved by `offset_ecef_m` (ECEF, m) since the last epoch.
    pub fn displace(&mut self, offset_ecef_m: &[f64; 3]) {
        if let Some((_, reference)) = &mut self.running {
            reference.displace(offset_ecef_m);
        }
    }

    fn start(&mut self, measurements: &[SatelliteMeasurement]) {
        if self.running.is_none() && measurements.len() >= FEWEST_TO_JUDGE {
            let parameters = &self.parameters;
            let glr = || InnovationGlr::new(&parameters.filter, parameters.window_epochs);
            self.running = Reference::solve(measurements).map(|reference| (glr(), reference));
        }
    }

    /// The verdict on the ratios of the satellites in use.
    fn judge(&mut self, used: &[Sight], ratios: &[f64]) -> Result<IntegrityReport, MonitorError> {
        self.epochs += 1;
        if self.epochs <= self.parameters.warm_up_epochs {
            return Ok(IntegrityReport::WarmingUp);
        }
        let pairs = used.iter().zip(ratios);
        let largest = pairs.max_by(|a, b| a.1.total_cmp(b.1));
        let Some((sight, score)) = largest.filter(|_| used.len() >= FEWEST_TO_JUDGE) else {
            return Ok(IntegrityReport::Unavailable);
        };
        Ok(IntegrityReport::Judged {
            judgement: Judgement::new(*score, self.parameters.threshold)?,
            worst: (used.len() >= FEWEST_TO_NAME).then_some(sight.id),
        })
    }
}

impl IntegrityMonitor for GlrMonitor {
    fn name(&self) -> &str {
        "glr"
    }

    fn epoch(
        &mut self,
        time_s: f64,
        measurements: &[SatelliteMeasurement],
    ) -> Result<IntegrityReport, MonitorError> {
        check_measurements(measurements)?;
        let elapsed_s = check_later(time_s, self.last_time_s)?.unwrap_or(FIRST_ELAPSED_S);
        self.start(measurements);
        self.last_time_s = Some(time_s);
        let Some((glr, reference)) = &mut self.running else {
            return Ok(IntegrityReport::Unavailable);
        };
        let (used, aside): (Vec<_>, Vec<_>) = measurements
            .iter()
            .partition(|m| !self.aside.ids().contains(&m.id));
        reference.follow_clock(used.iter().copied(), &glr.state_m());
        let sights = |of: &[&SatelliteMeasurement]| -> Vec<Sight> {
            of.iter().map(|m| reference.sight(m)).collect()
        };
        let (used, aside) = (sights(&used), sights(&aside));
        let ratios = glr.epoch(elapsed_s, &used);
        for sight in aside {
            let log_healthy = glr.log_expectation(&sight);
            self.aside.weigh(sight.id, log_healthy, FAULT_WIDTH_M);
        }
        if let Some(shift_m) = reference.follow_position(&glr.state_m()) {
            glr.shift(&shift_m);
        }
        let report = self.judge(&used, &ratios)?;
        if let (Some(id), Some((glr, _))) = (report.faulty_satellite(), &mut self.running) {
            glr.compensate(id);
            self.aside.insert(id);
        }
        self.aside.take_back(RECOVERY);
        Ok(report)
    }

    fn set_aside(&self) -> &[u32] {
        self.aside.ids()
    }

    fn reset(&mut self) {
        self.running = None;
        self.last_time_s = None;
        self.epochs = 0;
        self.aside = Readmission::default();
    }
}
