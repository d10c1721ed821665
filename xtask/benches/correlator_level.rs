//! Speed of drawn correlator sums: time for ten milliseconds of nine channels with three taps, for
//! a millisecond with eleven, and for a second of the whole receiver.

mod cpu_time;

use std::hint::black_box;

use anyhow::{Result, ensure};
use criterion::{Criterion, criterion_group, criterion_main};
use gnss_nav::GpsTime;
use gnss_nav::lnav::LnavEncoder;
use gnss_signal::sample::{SampleDescription, SampleFormat};
use gnss_signal::{CorrelatorBank, Replica, SignalId, TapOffsets, Taps};
use receiver::pipeline::{Aiding, Settings, VectorSettings, run};
use receiver::record::Record;
use xtask::scenario::antenna::{Emitter, Gain, Reception, Scene};
use xtask::scenario::built::Scenario;
use xtask::scenario::catalogue;
use xtask::scenario::constellation::nominal;
use xtask::scenario::correlator_level::CorrelatorLevelBank;
use xtask::scenario::emitter::PlainEmitter;
use xtask::scenario::message::Message;
use xtask::scenario::path::UniformPath;

use cpu_time::CpuTime;

const RATE_HZ: f64 = 2.6e6;
const CHANNELS: usize = 9;

fn start() -> GpsTime {
    GpsTime::new(2350, 392_400.25)
}

fn scene(emitters: Vec<Box<dyn Emitter>>, duration_s: f64) -> Scene {
    Scene {
        reception: Reception {
            samples: SampleDescription {
                format: SampleFormat::Ci8,
                sample_rate_hz: RATE_HZ,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            bandwidth_hz: Some(0.8 * RATE_HZ),
            bits: None,
            gain: Gain::Fixed,
        },
        duration_s,
        emitters,
        interference: vec![],
        gaps: vec![],
        seed: 1,
    }
}

/// Satellites of constant Doppler.
fn uniform() -> Result<Scene> {
    let ephemerides = nominal(start())?;
    let emitters = ephemerides.iter().take(CHANNELS).map(|ephemeris| {
        let prn = ephemeris.satellite.prn;
        let path = UniformPath {
            code_time: start() - 0.07 - 1e-4 * f64::from(prn),
            doppler_hz: 300.0 * f64::from(prn),
        };
        let message = Message::Lnav(Box::new(LnavEncoder::new(ephemeris)?));
        let signal = SignalId::gps_l1_ca(prn)?;
        Ok(Box::new(PlainEmitter::new(signal, 45.0, Box::new(path), message)) as Box<dyn Emitter>)
    });
    Ok(scene(emitters.collect::<Result<_>>()?, 1e5))
}

/// One interval of every channel, from `tick` on.
fn replicas(scene: &Scene, tick: u64, ticks: u64, taps: TapOffsets) -> Vec<Replica> {
    let channels = scene.emitters.iter().map(|emitter| {
        let signal = emitter.signal();
        let prn = f64::from(signal.prn());
        Replica {
            signal,
            start_tick: tick,
            end_tick: tick + ticks,
            code_phase_chips: 0.0,
            code_rate_hz: 1.023e6 + 300.0 * prn / 1540.0,
            carrier_phase_cycles: 0.3,
            carrier_frequency_hz: 300.0 * prn + 4.0,
            tap_offsets: taps,
        }
    });
    channels.collect()
}

fn bank_alone(
    criterion: &mut Criterion<CpuTime>,
    name: &str,
    period_s: f64,
    offsets: &[f64],
) -> Result<()> {
    let scene = uniform()?;
    let ticks = (period_s * RATE_HZ) as u64;
    let mut all = replicas(&scene, 0, ticks, TapOffsets::new(offsets)?);
    let mut bank = CorrelatorLevelBank::new(scene)?;
    let mut taps: Vec<Taps> = Vec::new();
    let mut failed = None;
    criterion.bench_function(name, |bencher| {
        bencher.iter(|| {
            for replica in &mut all {
                replica.start_tick += ticks;
                replica.end_tick += ticks;
            }
            let end = all.first().map_or(0, |r| r.end_tick);
            let done = bank
                .advance_to(end)
                .and_then(|_| bank.correlate(&all, &mut taps));
            failed = failed.take().or(done.err());
            black_box(&taps);
        });
    });
    failed.map_or(Ok(()), |error| Err(error.into()))
}

/// Receives a scenario; that it was received to its end with a solution is checked.
fn solutions(scenario: &Scenario, settings: &Settings) -> Result<usize> {
    let bank = CorrelatorLevelBank::new(scenario.scene())?;
    let mut solutions = 0;
    let outcome = run(bank, settings, &mut |record| {
        solutions += usize::from(matches!(record, Record::Pvt(_)));
        Ok(())
    })?;
    ensure!(
        solutions > 0 && (outcome.signal_s - scenario.duration_s).abs() < 1e-3,
        "{solutions} solutions in {} s of signal",
        outcome.signal_s
    );
    Ok(solutions)
}

fn whole_receiver(criterion: &mut Criterion<CpuTime>) -> Result<()> {
    let file = catalogue::find("static-open-sky")?;
    let mut group = criterion.benchmark_group("receiver");
    group.sample_size(10);
    for (mode, vector, duration_s) in [
        ("scalar", None, 2.0),
        ("scalar", None, 22.0),
        ("vector", Some(VectorSettings::default()), 22.0),
    ] {
        let scenario = Scenario::new(&file.with(&[format!("duration_s={duration_s:?}")])?, None)?;
        let settings = Settings {
            aiding: Aiding {
                ephemerides: scenario.heard.iter().map(|heard| heard.broadcast).collect(),
                ionosphere: Some(scenario.ionosphere),
                position_ecef_m: Some(scenario.truth.trajectory.at(0.0).position_ecef_m),
                time: Some(scenario.truth.start),
            },
            vector,
            ..Settings::default()
        };
        let mut failed = None;
        group.bench_function(format!("{mode}, {duration_s} s"), |bencher| {
            bencher.iter(|| {
                let done = solutions(&scenario, &settings);
                failed = failed.take().or(black_box(done).err());
            });
        });
        failed.map_or(Ok(()), Err)?;
    }
    group.finish();
    Ok(())
}

fn all(criterion: &mut Criterion<CpuTime>) -> Result<()> {
    let eleven: [f64; 11] = std::array::from_fn(|k| (k as f64 - 5.0) / 10.0);
    bank_alone(
        criterion,
        "9 channels, 10 ms, 3 taps",
        0.01,
        &[-0.25, 0.0, 0.25],
    )?;
    bank_alone(criterion, "9 channels, 1 ms, 11 taps", 0.001, &eleven)?;
    whole_receiver(criterion)
}

#[allow(clippy::panic)] // A benchmark that cannot run has nothing to report.
fn bench(criterion: &mut Criterion<CpuTime>) {
    if let Err(error) = all(criterion) {
        panic!("{error:#}");
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime);
    targets = bench
}
criterion_main!(benches);
