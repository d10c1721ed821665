//! The receivers compared: single points of scalar loops, and the vector receiver in its modes.

use gnss_nav::dynamics::{AccelerationNoise, ProcessNoise};
use gnss_signal::tracking::loop_filter::CarrierBandwidth;
use gnss_signal::tracking::{SteeredSettings, TrackingSettings};
use receiver::pipeline::{FilterKind, Settings, VectorSettings};

use super::theory::Theory;
use crate::judged;
use crate::scenario::built::Scenario;

/// Length of a code period, s.
const PERIOD_S: f64 = 1e-3;
/// Settings of the frequency-locked loops of the comparison by bandwidth, Hz.
const LOOP_SETTINGS_HZ: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 12.0, 16.0];
/// Densities of acceleration of the same comparison, m^2/s^3, beside the default.
const DENSITIES_M2_PER_S3: [f64; 3] = [0.01, 0.1, 10.0];
/// With this one, m^2/s^3, nothing is left of the previous velocity after 20 ms: single intervals.
pub const NO_MEMORY_M2_PER_S3: f64 = 1e6;
/// The default.
pub const DENSITY_M2_PER_S3: f64 = 1.0;

/// Where a receiver's velocity comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Least squares of each epoch, range rates by phase-locked loops.
    PhaseLoops,
    /// Least squares of each epoch, range rates by frequency-locked loops.
    FrequencyLoops {
        /// The loops' setting, Hz.
        setting_hz: f64,
    },
    /// One filter steers all channels.
    Vector(Vector),
}

/// A vector receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vector {
    /// Filter.
    pub filter: FilterKind,
    /// Measuring interval, code periods.
    pub interval_periods: u32,
    /// Time between updates, s: the interval (direct) or longer (cascaded).
    pub update_s: f64,
    /// Whether locked carriers give range rates, or frequency discriminators alone.
    pub carrier_phase: bool,
    /// Density of acceleration, m^2/s^3.
    pub q_a_m2_per_s3: f64,
}

impl Vector {
    /// The product's.
    pub const PRODUCT: Self = Self {
        filter: FilterKind::Sequential,
        interval_periods: 20,
        update_s: 0.02,
        carrier_phase: true,
        q_a_m2_per_s3: DENSITY_M2_PER_S3,
    };

    /// The product's, by frequency discriminators alone.
    pub const DISCRIMINATORS: Self = Self {
        carrier_phase: false,
        ..Self::PRODUCT
    };
}

/// What a receiver is compared for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The table of receivers.
    Table,
    /// The curves over noise bandwidth.
    Curve,
}

/// One receiver.
#[derive(Debug, Clone, PartialEq)]
pub struct Receiver {
    /// Key in the summary.
    pub key: String,
    /// What people read.
    pub label: String,
    /// What it is.
    pub kind: Kind,
    /// Where it is shown.
    pub part: Part,
}

/// Position of receivers in [`all`].
pub mod place {
    /// Single points, phase-locked loops.
    pub const PHASE_LOOPS: usize = 0;
    /// Single points, frequency-locked loops of the product's bandwidth.
    pub const FREQUENCY_LOOPS: usize = 1;
    /// The product.
    pub const PRODUCT: usize = 2;
    /// The product with the batch filter.
    pub const BATCH: usize = 3;
    /// The product updated every 10 ms.
    pub const SHORT: usize = 4;
    /// The product cascaded.
    pub const CASCADED: usize = 5;
    /// By frequency discriminators alone.
    pub const DISCRIMINATORS: usize = 6;
    /// The same without memory of the velocity.
    pub const NO_MEMORY: usize = 9;
}

/// All receivers, those of the table first.
#[must_use]
pub fn all(theory: &Theory) -> Vec<Receiver> {
    let mut receivers = vec![
        Receiver {
            key: "single_points_phase_loops".to_owned(),
            label: "single points, PLL Doppler".to_owned(),
            kind: Kind::PhaseLoops,
            part: Part::Table,
        },
        frequency_loops(
            "single_points_frequency_loops",
            theory.loop_setting_hz,
            Part::Table,
        ),
    ];
    for (phase, name) in [(true, ""), (false, ", discriminators alone")] {
        let own = Vector {
            carrier_phase: phase,
            ..Vector::PRODUCT
        };
        receivers.extend(modes(own, name));
    }
    receivers.push(vector(
        "vector_discriminators_without_memory".to_owned(),
        "vector, discriminators of single intervals".to_owned(),
        Vector {
            q_a_m2_per_s3: NO_MEMORY_M2_PER_S3,
            ..Vector::DISCRIMINATORS
        },
        Part::Table,
    ));
    receivers.extend(curves());
    receivers
}

fn modes(own: Vector, name: &str) -> Vec<Receiver> {
    let short = Vector {
        interval_periods: 10,
        update_s: 0.01,
        ..own
    };
    let cascaded = Vector {
        update_s: 0.1,
        ..own
    };
    let batch = Vector {
        filter: FilterKind::Batch,
        ..own
    };
    let kinds = [
        ("sequential, direct 20 ms", own),
        ("batch, direct 20 ms", batch),
        ("sequential, direct 10 ms", short),
        ("sequential, cascaded 10 Hz", cascaded),
    ];
    let both = own.carrier_phase;
    let kinds = kinds.into_iter().filter(move |(_, v)| both || *v != batch);
    kinds
        .map(|(mode, of)| {
            let label = format!("vector, {mode}{name}");
            vector(key(&label), label, of, Part::Table)
        })
        .collect()
}

/// A key of a label: small letters, digits, and one low line between them.
fn key(label: &str) -> String {
    let words = label.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<_> = words.filter(|w| !w.is_empty()).collect();
    words.join("_").to_lowercase()
}

const fn vector(key: String, label: String, of: Vector, part: Part) -> Receiver {
    Receiver {
        key,
        label,
        kind: Kind::Vector(of),
        part,
    }
}

fn frequency_loops(key: &str, setting_hz: f64, part: Part) -> Receiver {
    Receiver {
        key: key.to_owned(),
        label: format!("single points, FLL set to {setting_hz:.1} Hz"),
        kind: Kind::FrequencyLoops { setting_hz },
        part,
    }
}

/// Receivers of other bandwidths.
fn curves() -> Vec<Receiver> {
    let loops = LOOP_SETTINGS_HZ.map(|hz| {
        let key = format!("single_points_frequency_loops_{hz}_hz");
        frequency_loops(&key, hz, Part::Curve)
    });
    let mut receivers = loops.to_vec();
    for (name, own) in [
        ("vector", Vector::PRODUCT),
        ("vector, discriminators alone", Vector::DISCRIMINATORS),
    ] {
        receivers.extend(DENSITIES_M2_PER_S3.map(|q_a_m2_per_s3| {
            let of = Vector {
                q_a_m2_per_s3,
                ..own
            };
            let label = format!("{name}, q_a = {q_a_m2_per_s3} m^2/s^3");
            vector(key(&label), label, of, Part::Curve)
        }));
    }
    receivers
}

impl Receiver {
    /// Settings of a run over `scenario`.
    #[must_use]
    pub fn settings(&self, scenario: &Scenario) -> Settings {
        let told = judged::settings(scenario);
        match self.kind {
            Kind::PhaseLoops => told,
            Kind::FrequencyLoops { setting_hz } => Settings {
                tracking: frequency_tracking(setting_hz),
                ..told
            },
            Kind::Vector(of) => Settings {
                tracking: TrackingSettings {
                    steered: SteeredSettings {
                        interval_periods: of.interval_periods,
                        carrier_phase: of.carrier_phase,
                        ..SteeredSettings::default()
                    },
                    ..TrackingSettings::default()
                },
                vector: Some(of.settings()),
                ..told
            },
        }
    }

    /// Whether one filter steers all channels.
    #[must_use]
    pub const fn is_vector(&self) -> bool {
        matches!(self.kind, Kind::Vector(_))
    }
}

/// A frequency-locked loop, and the code loop that goes with a locked phase elsewhere: positions are to
/// differ by the carrier alone.
fn frequency_tracking(setting_hz: f64) -> TrackingSettings {
    let own = TrackingSettings::default();
    TrackingSettings {
        locked_bandwidth: CarrierBandwidth {
            phase_hz: 0.0,
            frequency_hz: setting_hz,
        },
        code_unlocked_hz: own.code_locked_hz,
        ..own
    }
}

impl Vector {
    /// Measuring interval, s.
    #[must_use]
    pub fn interval_s(&self) -> f64 {
        f64::from(self.interval_periods) * PERIOD_S
    }

    /// Integration of its channels, s: their own, or half an interval.
    #[must_use]
    pub fn integration_s(&self) -> f64 {
        let own = TrackingSettings::default().integration_periods;
        f64::from(own.min(self.interval_periods / 2)) * PERIOD_S
    }

    fn settings(&self) -> VectorSettings {
        let own = VectorSettings::default();
        let monitor = own.monitor.map(|mut monitor| {
            monitor.epoch_rate_hz = 1.0 / self.update_s;
            monitor
        });
        VectorSettings {
            filter: self.filter,
            interval_s: self.update_s,
            process_noise: ProcessNoise {
                acceleration: AccelerationNoise::isotropic(self.q_a_m2_per_s3),
                ..own.process_noise
            },
            monitor,
            ..own
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_name_the_receivers_they_say() {
        let receivers = all(&Theory::default());
        let vector = |place: usize| match receivers[place].kind {
            Kind::Vector(of) => of,
            other => panic!("{other:?}"),
        };
        assert_eq!(receivers[place::PHASE_LOOPS].kind, Kind::PhaseLoops);
        assert!(!receivers[place::FREQUENCY_LOOPS].is_vector());
        assert_eq!(vector(place::PRODUCT), Vector::PRODUCT);
        assert_eq!(vector(place::BATCH).filter, FilterKind::Batch);
        assert_eq!(vector(place::SHORT).interval_periods, 10);
        assert_eq!(vector(place::CASCADED).update_s, 0.1);
        assert_eq!(vector(place::DISCRIMINATORS), Vector::DISCRIMINATORS);
        assert_eq!(vector(place::NO_MEMORY).q_a_m2_per_s3, NO_MEMORY_M2_PER_S3);
    }

    #[test]
    fn keys_differ_and_the_product_is_the_default() {
        let receivers = all(&Theory::default());
        let mut keys: Vec<_> = receivers.iter().map(|r| r.key.clone()).collect();
        assert!(
            keys.iter()
                .all(|k| k.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))
        );
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), receivers.len());
        assert_eq!(Vector::PRODUCT.settings(), VectorSettings::default());
    }
}
