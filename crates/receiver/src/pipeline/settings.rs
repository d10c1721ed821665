//! What a run is told: valid values, no text and no files.

use fault_ml::shape::ShapeSettings;
use gnss_nav::atmosphere::Klobuchar;
use gnss_nav::integrity::IntegritySettings;
use gnss_nav::measurement::ErrorModel;
use gnss_nav::{Ephemeris, GpsTime};
use gnss_signal::SignalId;
use gnss_signal::tracking::TrackingSettings;
use nalgebra::Vector3;

use super::vector::{Policy, VectorSettings};
use crate::raim::Raim;

/// Settings of a run.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Signals to look for.
    pub signals: Vec<SignalId>,
    /// Half of the Doppler range searched, Hz. 12 kHz covers 5 kHz of satellite, 5 ppm of
    /// oscillator.
    pub doppler_half_width_hz: f64,
    /// Probability that noise alone yields any acquisition in one search.
    pub false_alarm_probability: f64,
    /// Tracking of every channel.
    pub tracking: TrackingSettings,
    /// Navigation epochs per second.
    pub rate_hz: f64,
    /// Satellites below are not used, rad. Default 0: low ones weigh little by their own.
    pub elevation_mask_rad: f64,
    /// Whether the broadcast ionosphere model is applied where its parameters are known.
    pub ionosphere: bool,
    /// Whether the troposphere model is applied.
    pub troposphere: bool,
    /// What measurements err by beyond tracking noise. Default: as real ones do.
    pub errors: ErrorModel,
    /// What tests the pseudoranges of an epoch while every channel has its own loops.
    pub raim: Raim,
    /// Seed of everything random.
    pub seed: u64,
    /// What is known from elsewhere.
    pub aiding: Aiding,
    /// End of the run, s of signal.
    pub duration_s: Option<f64>,
    /// Whether every integration's sums are reported.
    pub dump_taps: bool,
    /// The chart on the shape of every channel's correlation; its taps are asked for beside early, prompt and
    /// late. Default: none.
    pub shape: Option<ShapeWatching>,
    /// Vector tracking once there is a consistent fix; `None`: scalar tracking throughout.
    pub vector: Option<VectorSettings>,
}

impl Settings {
    /// Settings of the filter where it may take over after `time_s` of signal.
    pub(super) fn filter_at(&self, time_s: f64) -> Option<&VectorSettings> {
        self.vector.as_ref().filter(|v| time_s >= v.from_s)
    }
}

/// How the shape of correlations is watched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeWatching {
    /// The chart.
    pub chart: ShapeSettings,
    /// What follows from its alarms in scalar tracking. In vector tracking the policy of all monitors does.
    pub policy: Policy,
}

/// What is known from elsewhere before the first sample.
#[derive(Debug, Clone, Default)]
pub struct Aiding {
    /// Ephemerides.
    pub ephemerides: Vec<Ephemeris>,
    /// Ionosphere model.
    pub ionosphere: Option<Klobuchar>,
    /// Rough position, ECEF, m (to 100 km).
    pub position_ecef_m: Option<Vector3<f64>>,
    /// Rough time of the first sample (to a minute).
    pub time: Option<GpsTime>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            signals: (1..=32)
                .filter_map(|prn| SignalId::gps_l1_ca(prn).ok())
                .collect(),
            doppler_half_width_hz: 12e3,
            false_alarm_probability: 1e-3,
            tracking: TrackingSettings::default(),
            rate_hz: 10.0,
            elevation_mask_rad: 0.0,
            ionosphere: true,
            troposphere: true,
            errors: ErrorModel::default(),
            raim: Raim::LeastSquares(IntegritySettings::default()),
            seed: 0,
            aiding: Aiding::default(),
            duration_s: None,
            dump_taps: false,
            shape: None,
            vector: None,
        }
    }
}
