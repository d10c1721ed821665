//! The whole receiver on the bank, and its position error against that on samples.

use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_nav::lnav::LnavEncoder;
use gnss_nav::prediction::{ReceiverState, predict};
use gnss_nav::{Geodetic, GpsTime};
use gnss_signal::sample::SampleFormat;
use gnss_signal::{CorrelatorBank, IfCorrelatorBank, InstructionSet, SignalId};
use nalgebra::Vector3;
use receiver::pipeline::{Aiding, Settings, run};
use receiver::record::{EventKind, PvtRecord, Record};

use super::support::reception;
use crate::constellation::nominal;
use crate::scenario::antenna::{Emitter, Scene};
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::emitter::PlainEmitter;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::message::Message;
use crate::scenario::path::{Atmosphere, OrbitPath, ReceiverMotion};

const MASK_DEG: f64 = 10.0;

fn truth(drift: f64) -> ReceiverMotion {
    ReceiverMotion {
        start: GpsTime::new(2350, 392_400.25),
        position_ecef_m: Geodetic::from_degrees(52.3, 10.5, 120.0).to_ecef(),
        velocity_ecef_mps: Vector3::zeros(),
        clock_drift: drift,
    }
}

/// All satellites in view of a static receiver, each at `cn0_dbhz`, without atmosphere.
fn static_scene(cn0_dbhz: f64, bandwidth: Option<f64>, duration_s: f64, seed: u64) -> Scene {
    let truth = truth(2e-7);
    let state = ReceiverState {
        time: truth.start,
        position_ecef_m: truth.position_ecef_m,
        velocity_ecef_mps: truth.velocity_ecef_mps,
        clock_drift_mps: truth.clock_drift * SPEED_OF_LIGHT_MPS,
    };
    let ephemerides = nominal(truth.start).unwrap();
    let up = ephemerides.iter().filter(|e| {
        predict(e, &state).unwrap().look.elevation_rad > MASK_DEG.to_radians()
    });
    let emitters = up.map(|ephemeris| {
        let path = OrbitPath {
            ephemeris: *ephemeris,
            receiver: truth,
            atmosphere: Atmosphere::default(),
        };
        let signal = SignalId::gps_l1_ca(ephemeris.satellite.prn).unwrap();
        let message = Message::Lnav(Box::new(LnavEncoder::new(ephemeris).unwrap()));
        Box::new(PlainEmitter::new(signal, cn0_dbhz, Box::new(path), message)) as Box<dyn Emitter>
    });
    Scene {
        reception: reception(SampleFormat::Ci8, 2.6e6, bandwidth),
        duration_s,
        emitters: emitters.collect(),
        interference: vec![],
        gaps: vec![],
        seed,
    }
}

fn settings(assisted: bool) -> Settings {
    let truth = truth(0.0);
    let aiding = if assisted {
        Aiding {
            ephemerides: nominal(truth.start).unwrap(),
            ionosphere: None,
            position_ecef_m: Some(truth.position_ecef_m + Vector3::new(9e3, -5e3, 2e3)),
            time: Some(truth.start + 3.0),
        }
    } else {
        Aiding::default()
    };
    Settings {
        ionosphere: false,
        troposphere: false,
        aiding,
        ..Settings::default()
    }
}

/// Solutions and acquisitions of a run.
fn receive(bank: impl CorrelatorBank, settings: &Settings) -> (Vec<PvtRecord>, usize) {
    let (mut solutions, mut acquired) = (Vec::new(), 0);
    run(bank, settings, &mut |record| {
        match record {
            Record::Pvt(pvt) => solutions.push(pvt),
            Record::Event(event) => {
                acquired += usize::from(matches!(event.kind, EventKind::Acquired(_)));
            }
            _ => {}
        }
        Ok(())
    })
    .unwrap();
    (solutions, acquired)
}

fn error_m(solution: &PvtRecord) -> f64 {
    (solution.position_ecef_m - truth(0.0).position_ecef_m).norm()
}

#[test]
fn the_receiver_finds_its_place_with_help() {
    let scene = static_scene(45.0, Some(0.8), 3.0, 1);
    let satellites = scene.emitters.len();
    let bank = CorrelatorLevelBank::new(scene).unwrap();
    let (solutions, acquired) = receive(bank, &settings(true));
    assert_eq!(acquired, satellites);
    // 0.3 m of code noise behind a loop of 0.05 Hz after 3 s, times a PDOP of two.
    assert!(error_m(solutions.last().unwrap()) < 5.0);
}

#[test]
fn the_receiver_finds_its_place_alone() {
    let scene = static_scene(45.0, Some(0.8), 50.0, 2);
    let satellites = scene.emitters.len();
    let bank = CorrelatorLevelBank::new(scene).unwrap();
    let (solutions, acquired) = receive(bank, &settings(false));
    assert_eq!(acquired, satellites);
    assert!(error_m(solutions.last().unwrap()) < 5.0);
}

/// Mean and standard error of the mean square error of the last second's solutions, by run.
fn mean_square(errors: &[f64]) -> (f64, f64) {
    let n = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / n;
    let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Mean square position error of one run after its first second, m^2.
fn run_error_m2(bank: impl CorrelatorBank) -> f64 {
    let (solutions, _) = receive(bank, &settings(true));
    let late: Vec<f64> = solutions
        .iter()
        .filter(|s| s.time_s > 1.0)
        .map(|s| error_m(s).powi(2))
        .collect();
    assert!(late.len() >= 5, "{} solutions", late.len());
    late.iter().sum::<f64>() / late.len() as f64
}

/// Root mean square errors of both levels (drawn, sampled), each with its standard error, m.
fn compare(seeds: u64, cn0_dbhz: f64, bandwidth: Option<f64>) -> [(f64, f64); 2] {
    let (mut drawn, mut sampled) = (Vec::new(), Vec::new());
    for seed in 0..seeds {
        let scene = |seed| static_scene(cn0_dbhz, bandwidth, 2.0, seed);
        drawn.push(run_error_m2(CorrelatorLevelBank::new(scene(seed)).unwrap()));
        let source = Synthesiser::new(scene(1000 + seed)).unwrap();
        let bank = IfCorrelatorBank::new(source, 2.0, InstructionSet::detect()).unwrap();
        sampled.push(run_error_m2(bank));
    }
    [drawn, sampled].map(|squares| {
        let (mean, error) = mean_square(&squares);
        (mean.sqrt(), 0.5 * error / mean.sqrt())
    })
}

fn assert_alike([(a, error_a), (b, error_b)]: [(f64, f64); 2]) {
    let error = error_a.hypot(error_b);
    assert!(
        (a - b).abs() < 3.0 * error,
        "rms {a} m (standard error {error_a}) and {b} m ({error_b})"
    );
}

#[test]
fn positions_err_as_on_samples() {
    assert_alike(compare(6, 45.0, None));
}

/// Each rms known to 4 %: `cargo test --release -p xtask --lib positions_err -- --ignored --nocapture`.
#[test]
#[ignore = "two minutes of samples in a release build"]
fn positions_err_as_on_samples_to_4_percent() {
    for (cn0_dbhz, bandwidth) in [(45.0, None), (38.0, Some(0.8))] {
        let [drawn, sampled] = compare(120, cn0_dbhz, bandwidth);
        println!("{cn0_dbhz} dB-Hz, {bandwidth:?}: drawn {drawn:?} m, sampled {sampled:?} m");
        for (rms, error) in [drawn, sampled] {
            assert!(error < 0.04 * rms, "{error} of {rms} m");
        }
        assert_alike([drawn, sampled]);
    }
}
