//! The receivers compared: as the paper has it and as the product is, each with and without exclusion.

use fault_ml::{InnovationStatistic, InnovationTestSettings};
use gnss_nav::dynamics::{AccelerationNoise, ClockNoise, ProcessNoise};
use gnss_nav::filter::Gate;
use gnss_nav::tracking_noise;
use gnss_signal::tracking::loop_filter::CarrierBandwidth;
use gnss_signal::tracking::{FrequencyPairs, Silence, SteeredSettings, TrackingSettings};
use receiver::pipeline::{MeasurementNoise, Policy, Settings, VectorSettings};

use crate::judged;
use crate::scenario::built::Scenario;

/// C/N0 of every satellite before the blockage, dB-Hz.
pub const CN0_DBHZ: f64 = 45.0;
/// Integration and navigation interval of the paper's receiver, code periods and s.
const INTERVAL_PERIODS: u32 = 10;
/// The same, s.
pub const INTERVAL_S: f64 = 0.01;
/// Early to late of the paper's receiver, chips (equation (5)).
const SPACING_CHIPS: f64 = 1.0;
/// Process noise: acceleration, m^2/s^3.
const ACCELERATION_M2_PER_S3: f64 = 1.0;
/// The clock of the scenario.
const CLOCK: ClockNoise = ClockNoise {
    white_m2_per_s: 0.01,
    random_walk_m2_per_s3: 0.04,
};
/// Carrier loop of the receiver's own channels, Hz, and their integration, code periods: with 10 Hz the
/// white frequency noise of this clock alone makes phases scatter by 30 degrees, and the loops slip.
pub const CARRIER_HZ: f64 = 30.0;
const OWN_PERIODS: u32 = 5;

/// One receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// The paper's, without detection.
    Paper,
    /// The paper's, the innovation test excluding.
    PaperExcluding,
    /// The product's, without exclusion.
    Product,
    /// The product's, the innovation test excluding.
    ProductExcluding,
}

impl Variant {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Paper,
        Self::PaperExcluding,
        Self::Product,
        Self::ProductExcluding,
    ];

    /// Key in the summary.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::Paper => "paper_baseline",
            Self::PaperExcluding => "paper_baseline_with_exclusion",
            Self::Product => "product_baseline",
            Self::ProductExcluding => "product_with_exclusion",
        }
    }

    /// What people read.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Paper => "paper baseline",
            Self::PaperExcluding => "paper baseline, exclusion",
            Self::Product => "product baseline",
            Self::ProductExcluding => "product, exclusion",
        }
    }

    /// Whether a satellite found faulty is left out.
    #[must_use]
    pub const fn excludes(self) -> bool {
        matches!(self, Self::PaperExcluding | Self::ProductExcluding)
    }

    /// Settings of a run over `scenario`.
    #[must_use]
    pub fn settings(self, scenario: &Scenario) -> Settings {
        let policy = if self.excludes() {
            Policy::Exclude
        } else {
            Policy::Observe
        };
        let vector = match self {
            Self::Paper | Self::PaperExcluding => paper(self.excludes()),
            Self::Product | Self::ProductExcluding => product(),
        };
        let tracking = match self {
            Self::Paper | Self::PaperExcluding => paper_tracking(),
            Self::Product | Self::ProductExcluding => own_loops(),
        };
        Settings {
            tracking,
            vector: Some(VectorSettings { policy, ..vector }),
            ..judged::settings(scenario)
        }
    }
}

/// Nothing protects the filter of the paper: no gate, and noise as large as it was before the blockage.
fn paper(excludes: bool) -> VectorSettings {
    let test = InnovationTestSettings {
        epoch_rate_hz: 1.0 / INTERVAL_S,
        statistic: InnovationStatistic::CodeAndRate,
        ..InnovationTestSettings::default()
    };
    VectorSettings {
        interval_s: INTERVAL_S,
        process_noise: process_noise(),
        gate: Gate::Off,
        noise: MeasurementNoise::Fixed {
            pseudorange_m2: tracking_noise::code_variance_m2(CN0_DBHZ, INTERVAL_S, SPACING_CHIPS),
            range_rate_m2_s2: tracking_noise::sum_pair_rate_variance_m2_s2(CN0_DBHZ, INTERVAL_S),
        },
        monitor: excludes.then_some(test),
        ..VectorSettings::default()
    }
}

fn paper_tracking() -> TrackingSettings {
    TrackingSettings {
        spacing_chips: SPACING_CHIPS,
        steered: SteeredSettings {
            interval_periods: INTERVAL_PERIODS,
            pairs: FrequencyPairs::Successive,
            carrier_phase: false,
            silence: Silence::Measured,
        },
        ..own_loops()
    }
}

/// The receiver's loops before the filter takes over.
fn own_loops() -> TrackingSettings {
    TrackingSettings {
        integration_periods: OWN_PERIODS,
        locked_bandwidth: CarrierBandwidth {
            phase_hz: CARRIER_HZ,
            frequency_hz: 0.0,
        },
        ..TrackingSettings::default()
    }
}

/// The receiver of this tree, its filter told how this receiver moves.
fn product() -> VectorSettings {
    let settings = VectorSettings::default();
    VectorSettings {
        process_noise: process_noise(),
        ..settings
    }
}

/// How all of them are told that receiver and clock move.
const fn process_noise() -> ProcessNoise {
    ProcessNoise {
        acceleration: AccelerationNoise::isotropic(ACCELERATION_M2_PER_S3),
        clock: CLOCK,
    }
}
