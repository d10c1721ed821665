//! Settings of vector tracking.

use fault_ml::{InnovationTest, InnovationTestSettings};
use gnss_nav::dynamics::ProcessNoise;
use gnss_nav::filter::Gate;

use crate::ReceiverError;

/// Longest time between two updates, s: the steering of a car does not hold longer.
const LONGEST_INTERVAL_S: f64 = 1.0;

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
    /// What follows from its alarms. Default: exclusion.
    pub policy: Policy,
}

impl VectorSettings {
    /// The innovation test of a channel, where there is one, if all settings are possible.
    ///
    /// # Errors
    /// Naming the first value that is not.
    pub(in crate::pipeline) fn monitor(&self) -> Result<Option<InnovationTest>, ReceiverError> {
        self.process_noise.check()?;
        if !(self.interval_s > 0.0 && self.interval_s <= LONGEST_INTERVAL_S) {
            let given = self.interval_s;
            return Err(ReceiverError::Option {
                what: format!("the filter's interval is {given} s: expected above 0 and at most 1"),
            });
        }
        Ok(self.monitor.map(InnovationTest::new).transpose()?)
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
            interval_s,
            process_noise: ProcessNoise::default(),
            gate: Gate::Sigmas(4.0),
            noise: MeasurementNoise::Measured,
            monitor: Some(InnovationTestSettings {
                epoch_rate_hz: 1.0 / interval_s,
                ..InnovationTestSettings::default()
            }),
            policy: Policy::Exclude,
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
        assert!(VectorSettings::default().monitor().is_ok());
        let settings = VectorSettings {
            interval_s: f64::NAN,
            ..VectorSettings::default()
        };
        let text = settings.monitor().unwrap_err().to_string();
        assert!(text.starts_with("the filter's interval is NaN s"), "{text}");
        let settings = VectorSettings {
            monitor: Some(InnovationTestSettings {
                window: 1,
                ..InnovationTestSettings::default()
            }),
            ..VectorSettings::default()
        };
        assert!(settings.monitor().is_err());
    }
}
