//! Runs of the receiver over scenarios, in memory and judged against the truth.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::Result;
use gnss_nav::Geodetic;
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_signal::sample::{ReaderSource, SampleSource};
use gnss_signal::{CorrelatorBank, IfCorrelatorBank, InstructionSet};
use nalgebra::{Matrix3, Vector3};
use receiver::pipeline::{self, Aiding, Settings};
use receiver::record::{ChannelRecord, Event, PvtRecord, Record, Status};

use crate::scenario::built::Scenario;
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::make::{Level, rough_place, rough_time};
use crate::scenario::spec::{IonosphereSpec, TroposphereSpec};

/// Samples a receiver keeps, s.
const HISTORY_S: f64 = 2.0;

/// What the receiver made of a scenario.
#[derive(Debug, Clone, Default)]
pub struct Judged {
    /// Its solutions, beside the truth.
    pub epochs: Vec<JudgedEpoch>,
    /// Every channel at every epoch.
    pub channels: Vec<ChannelRecord>,
    /// Everything that happened.
    pub events: Vec<Event>,
}

/// A solution and its error.
#[derive(Debug, Clone)]
pub struct JudgedEpoch {
    /// The solution.
    pub pvt: PvtRecord,
    /// Position error east, north, up, m.
    pub position_enu_m: Vector3<f64>,
    /// Velocity error east, north, up, m/s.
    pub velocity_enu_mps: Vector3<f64>,
}

impl JudgedEpoch {
    /// Horizontal position error, m.
    #[must_use]
    pub fn horizontal_m(&self) -> f64 {
        self.position_enu_m.xy().norm()
    }

    /// Position error, ECEF, m.
    #[must_use]
    pub fn position_ecef_m(&self) -> Vector3<f64> {
        self.ecef_from_enu() * self.position_enu_m
    }

    /// Velocity error, ECEF, m/s.
    #[must_use]
    pub fn velocity_ecef_mps(&self) -> Vector3<f64> {
        self.ecef_from_enu() * self.velocity_enu_mps
    }

    /// East, north and up turn by less than 1e-4 from the solution to the truth 600 m away.
    fn ecef_from_enu(&self) -> Matrix3<f64> {
        let here = Geodetic::from_ecef(&self.pvt.position_ecef_m);
        here.enu_from_ecef().transpose()
    }
}

impl Judged {
    /// Solutions from `begin_s` on, before `end_s`.
    pub fn between(&self, begin_s: f64, end_s: f64) -> impl Iterator<Item = &JudgedEpoch> + Clone {
        self.epochs
            .iter()
            .filter(move |e| e.pvt.time_s >= begin_s && e.pvt.time_s < end_s)
    }

    /// Part of the epochs due from the first fix to `end_s`, at `rate_hz`, that have a fix or a
    /// prediction.
    #[must_use]
    pub fn availability(&self, end_s: f64, rate_hz: f64) -> f64 {
        let good = |e: &&JudgedEpoch| e.pvt.status != Status::Unreliable;
        let first_s = self.epochs.iter().find(good).map(|e| e.pvt.time_s);
        first_s.map_or(0.0, |first_s| {
            let due = ((end_s - first_s) * rate_hz).round() + 1.0;
            self.epochs.iter().filter(good).count() as f64 / due
        })
    }
}

/// Root mean square.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (sum / n).sqrt()
}

/// What a receiver of `scenario` is told: which delays there are and, if it is assisted, the broadcast
/// ephemerides and a rough place and time.
#[must_use]
pub fn settings(scenario: &Scenario) -> Settings {
    let assisted = scenario.receiver.assisted;
    let ionosphere = scenario.propagation.ionosphere != IonosphereSpec::None;
    let aiding = Aiding {
        ephemerides: scenario.heard.iter().map(|h| h.broadcast).collect(),
        ionosphere: ionosphere.then_some(scenario.ionosphere),
        position_ecef_m: Some(rough_place(scenario).to_ecef()),
        time: Some(rough_time(scenario)),
    };
    Settings {
        ionosphere,
        troposphere: scenario.propagation.troposphere != TroposphereSpec::None,
        aiding: if assisted { aiding } else { Aiding::default() },
        ..Settings::default()
    }
}

/// Receives `scenario`, made at `level`.
///
/// # Errors
/// Where the signal cannot be made or the receiver fails.
pub fn receive(scenario: &Scenario, level: Level, settings: &Settings) -> Result<Judged> {
    let scene = scenario.scene();
    match level {
        Level::Correlator => run(scenario, CorrelatorLevelBank::new(scene)?, settings),
        Level::If => {
            let source = Synthesiser::new(scene)?;
            let bank = IfCorrelatorBank::new(source, HISTORY_S, InstructionSet::detect())?;
            run(scenario, bank, settings)
        }
    }
}

/// Receives `scenario`, made once at `level`, with each of `settings`.
///
/// Samples are kept in memory: 4 MB/s at 16 MHz and 2 bits.
///
/// # Errors
/// Where the signal cannot be made or a receiver fails.
pub fn receive_by_each(
    scenario: &Scenario,
    level: Level,
    settings: &[Settings],
) -> Result<Vec<Judged>> {
    if level == Level::Correlator {
        return settings
            .iter()
            .map(|s| receive(scenario, level, s))
            .collect();
    }
    let mut source = Synthesiser::new(scenario.scene())?;
    let description = source.description();
    let samples = all_bytes(&mut source)?;
    let receive = |settings| {
        let source = ReaderSource::new(samples.as_slice(), description);
        let bank = IfCorrelatorBank::new(source, HISTORY_S, InstructionSet::detect())?;
        run(scenario, bank, settings)
    };
    settings.iter().map(receive).collect()
}

fn all_bytes(source: &mut impl SampleSource) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut block = vec![0; 1 << 20];
    loop {
        match source.read(&mut block)? {
            0 => return Ok(bytes),
            n => bytes.extend_from_slice(&block[..n]),
        }
    }
}

fn run(scenario: &Scenario, bank: impl CorrelatorBank, settings: &Settings) -> Result<Judged> {
    let mut judged = Judged::default();
    pipeline::run(bank, settings, &mut |record| {
        match record {
            Record::Pvt(pvt) => judged.epochs.push(judge(scenario, pvt)),
            Record::Channel(channel) => judged.channels.push(channel),
            Record::Event(event) => judged.events.push(event),
            _ => {}
        }
        Ok(())
    })?;
    Ok(judged)
}

fn judge(scenario: &Scenario, pvt: PvtRecord) -> JudgedEpoch {
    let elapsed_s = scenario.elapsed_s(pvt.time_s);
    let (bias_m, _) = scenario.truth.clock.metres_at(elapsed_s);
    let at = scenario
        .truth
        .trajectory
        .at(elapsed_s - bias_m / SPEED_OF_LIGHT_MPS);
    let to_enu = Geodetic::from_ecef(&at.position_ecef_m).enu_from_ecef();
    JudgedEpoch {
        position_enu_m: to_enu * (pvt.position_ecef_m - at.position_ecef_m),
        // A velocity that is not known errs by all of it.
        velocity_enu_mps: to_enu
            * (pvt.velocity.map_or_else(Vector3::zeros, |v| v.ecef_mps) - at.velocity_ecef_mps),
        pvt,
    }
}

/// `run` of every number below `count`, on all cores; the results come in order.
///
/// # Errors
/// The first, by number, that `run` returns.
pub fn in_parallel<T: Send>(
    count: usize,
    run: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::with_capacity(count));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers.min(count) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        return;
                    }
                    let result = run(number);
                    let mut all = results.lock().unwrap_or_else(PoisonError::into_inner);
                    all.push((number, result));
                }
            });
        }
    });
    let mut all = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    all.sort_by_key(|(number, _)| *number);
    all.into_iter().map(|(_, result)| result).collect()
}
