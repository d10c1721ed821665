//! Settings of vector tracking.

use std::sync::Arc;

use fault_ml::learned::{LearnedModel, LearnedMonitor};
use fault_ml::{InnovationTest, InnovationTestSettings};
use gnss_nav::dynamics::ProcessNoise;
use gnss_nav::filter::Gate;

use super::monitors::Monitor;
use crate::ReceiverError;

/// Longest time between two updates, s: the steering of a car does not hold longer.
const LONGEST_INTERVAL_S: f64 = 1.0;

/// Longest time that is taken back, s: the filter takes it in again within one epoch.
const LONGEST_HINDSIGHT_S: f64 = 60.0;

/// Which filter, by how it takes in an epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilterKind {
    /// All measurements at once.
    Batch,
    /// Measurement by measurement (Li2019).
    Sequential,
}

/// Where the variance of measurements comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeasurementNoise {
    /// Each channel's C/N0, as measured.
    Measured,
    /// The same for every channel and for ever, signal or no signal.
    Fixed {
        /// Of a pseudorange, m^2.
        pseudorange_m2: f64,
        /// Of a range rate, (m/s)^2.
        range_rate_m2_s2: f64,
    },
}

/// What is done with a channel that a monitor finds faulty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Policy {
    /// It is reported, and used all the same.
    Observe,
    /// Its variance is multiplied.
    Deweight {
        /// Factor on the variance.
        variance_factor: f64,
    },
    /// It is left out.
    Exclude,
}

/// Settings of vector tracking.
#[derive(Debug, Clone, PartialEq)]
pub struct VectorSettings {
    /// Filter. Default: sequential.
    pub filter: FilterKind,
    /// Signal that channels follow by their own loops at least, before the filter takes over, s. Default 0.
    pub from_s: f64,
    /// Time between two updates of the filter, s. Default 0.02: a data bit.
    pub interval_s: f64,
    /// How receiver and clock may move beside the acceleration that the filter has seen in the last
    /// 0.2 s. Default: 1 m^2/s^3, which follows a car through turns of 1 g, and a TCXO.
    pub process_noise: ProcessNoise,
    /// When the filter skips a measurement. Default: beyond 4 standard deviations.
    pub gate: Gate,
    /// Variance of measurements. Default: measured.
    pub noise: MeasurementNoise,
    /// The innovation test of every channel, once per update. Default: at 0.01 false alarms per channel
    /// and hour.
    pub monitor: Option<InnovationTestSettings>,
    /// Trained monitors of every channel beside it. Default: none.
    pub learned: Vec<Arc<LearnedModel>>,
    /// What follows from its alarms. Default: exclusion.
    pub policy: Policy,
    /// For how long before an alarm the filter takes back what the satellite said, s; with 0 it lets it be. Default 10: a ramp
    /// that is just slow enough for the gate is found within that.
    pub hindsight_s: f64,
}

impl Policy {
    /// Usual factor on the variance of what is deweighted.
    pub const VARIANCE_FACTOR: f64 = 100.0;
}

impl VectorSettings {
    /// The monitors of a channel, if all settings are possible.
    ///
    /// # Errors
    /// Naming the first value that is not.
    pub(in crate::pipeline) fn monitors(&self) -> Result<Vec<Monitor>, ReceiverError> {
        self.process_noise.check()?;
        if !(self.interval_s > 0.0 && self.interval_s <= LONGEST_INTERVAL_S) {
            let given = self.interval_s;
            return Err(ReceiverError::Option {
                what: format!("the filter's interval is {given} s: expected above 0 and at most 1"),
            });
        }
        if !(self.from_s >= 0.0 && self.from_s.is_finite()) {
            let given = self.from_s;
            return Err(ReceiverError::Option {
                what: format!("the filter takes over from {given} s on: expected 0 or more"),
            });
        }
        if !(0.0..=LONGEST_HINDSIGHT_S).contains(&self.hindsight_s) {
            let given = self.hindsight_s;
            return Err(ReceiverError::Option {
                what: format!("the filter takes back {given} s: expected 0 to 60"),
            });
        }
        let test = self.monitor.map(InnovationTest::new).transpose()?;
        let mut monitors = Vec::from_iter(test.map(|t| Monitor::Innovation(Box::new(t))));
        for model in &self.learned {
            self.fits(model)?;
            let monitor = LearnedMonitor::new(Arc::clone(model));
            monitors.push(Monitor::Learned(Box::new(monitor)));
        }
        Ok(monitors)
    }

    /// Refuses a model that has learned at another rate.
    fn fits(&self, model: &LearnedModel) -> Result<(), ReceiverError> {
        let (card, ours_s) = (model.card(), self.interval_s);
        if (card.interval_s - ours_s).abs() < 1e-6 {
            return Ok(());
        }
        Err(ReceiverError::Option {
            what: format!(
                "the monitor {} has learned from updates every {} s: the filter's interval is {ours_s} s",
                card.kind.name(),
                card.interval_s
            ),
        })
    }

    /// Whether an alarm changes what the filter took in before it.
    pub(super) fn takes_back(&self) -> bool {
        self.hindsight_s > 0.0 && self.policy != Policy::Observe
    }

    /// Whether an update is due `since_s` after the last, give or take the rounding of ticks.
    pub(super) fn is_due(&self, since_s: f64) -> bool {
        since_s > self.interval_s * (1.0 - 1e-3)
    }
}

impl Default for VectorSettings {
    fn default() -> Self {
        let interval_s = 0.02;
        Self {
            filter: FilterKind::Sequential,
            from_s: 0.0,
            interval_s,
            process_noise: ProcessNoise::default(),
            gate: Gate::Sigmas(4.0),
            noise: MeasurementNoise::Measured,
            monitor: Some(InnovationTestSettings {
                epoch_rate_hz: 1.0 / interval_s,
                ..InnovationTestSettings::default()
            }),
            learned: Vec::new(),
            policy: Policy::Exclude,
            hindsight_s: 10.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn updates_are_an_interval_apart() {
        let settings = VectorSettings {
            interval_s: 0.1,
            ..VectorSettings::default()
        };
        assert!(!settings.is_due(0.08));
        // A sample early.
        assert!(settings.is_due(0.1 - 1.0 / 2.6e6));
    }

    #[test]
    fn impossible_settings_are_named() {
        assert!(VectorSettings::default().monitors().is_ok());
        let settings = VectorSettings {
            interval_s: f64::NAN,
            ..VectorSettings::default()
        };
        let text = settings.monitors().unwrap_err().to_string();
        assert!(text.starts_with("the filter's interval is NaN s"), "{text}");
        for from_s in [-1.0, f64::INFINITY, f64::NAN] {
            let settings = VectorSettings {
                from_s,
                ..VectorSettings::default()
            };
            let text = settings.monitors().unwrap_err().to_string();
            assert!(text.starts_with("the filter takes over from"), "{text}");
        }
        for hindsight_s in [-1.0, 61.0, f64::NAN] {
            let settings = VectorSettings {
                hindsight_s,
                ..VectorSettings::default()
            };
            let text = settings.monitors().unwrap_err().to_string();
            assert!(text.starts_with("the filter takes back"), "{text}");
        }
        let settings = VectorSettings {
            monitor: Some(InnovationTestSettings {
                window: 1,
                ..InnovationTestSettings::default()
            }),
            ..VectorSettings::default()
        };
        assert!(settings.monitors().is_err());
    }
}
