//! Settings of vector tracking.

use fault_ml::InnovationTestSettings;
use gnss_nav::dynamics::ProcessNoise;
use gnss_nav::filter::Gate;

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
