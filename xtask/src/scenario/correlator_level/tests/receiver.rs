//! The whole receiver on the bank, and its position error against that on samples.

use std::path::Path;

use gnss_signal::{CorrelatorBank, IfCorrelatorBank, InstructionSet};
use receiver::pipeline::{Aiding, Settings, run};
use receiver::record::{EventKind, PvtRecord, Record};

use crate::scenario::built::Scenario;
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::spec::ScenarioFile;

/// A receiver at rest under satellites of one C/N0, without atmosphere.
fn at_rest(duration_s: f64, seed: u64) -> Scenario {
    let text = format!(
        "description = 'at rest'
start = {{ week = 2350, tow_s = 392400 }}
duration_s = {duration_s:?}
constellation = {{ elevation_mask_deg = 10 }}
trajectory = {{ kind = 'static', at = {{ lat_deg = 52.3, lon_deg = 10.5, height_m = 120 }} }}
clock = {{ drift = 2e-7 }}
propagation = {{ ionosphere = 'none', troposphere = 'none' }}
cn0 = {{ fixed_dbhz = 45 }}
front_end = {{ format = 'ci8', sample_rate_hz = 2.6e6, bandwidth_hz = 2.08e6 }}"
    );
    let file = ScenarioFile::parse("at rest", "at rest", Path::new(""), text).unwrap();
    Scenario::new(&file, Some(seed)).unwrap()
}

fn settings(scenario: &Scenario, assisted: bool) -> Settings {
    let place = scenario.truth.trajectory.at(0.0).position_ecef_m;
    let aiding = if assisted {
        Aiding {
            ephemerides: scenario.heard.iter().map(|h| h.broadcast).collect(),
            ionosphere: None,
            position_ecef_m: Some(place.add_scalar(5e3)),
            time: Some(scenario.truth.start + 3.0),
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

fn error_m(scenario: &Scenario, solution: &PvtRecord) -> f64 {
    let place = scenario.truth.trajectory.at(0.0).position_ecef_m;
    (solution.position_ecef_m - place).norm()
}

#[test]
fn the_receiver_finds_its_place_alone() {
    let scenario = at_rest(40.0, 2);
    let bank = CorrelatorLevelBank::new(scenario.scene()).unwrap();
    let (solutions, acquired) = receive(bank, &settings(&scenario, false));
    assert_eq!(acquired, scenario.heard.len());
    // 0.3 m of code noise behind a loop of 0.05 Hz, times a PDOP of two; 5 m leave room for a loop
    // that has not come to rest.
    assert!(error_m(&scenario, solutions.last().unwrap()) < 5.0);
}

/// Mean square position error of one assisted run after its first second, m^2.
fn run_error_m2(scenario: &Scenario, bank: impl CorrelatorBank) -> f64 {
    let (solutions, acquired) = receive(bank, &settings(scenario, true));
    assert_eq!(acquired, scenario.heard.len());
    let late: Vec<f64> = solutions
        .iter()
        .filter(|s| s.time_s > 1.0)
        .map(|s| error_m(scenario, s).powi(2))
        .collect();
    assert!(late.len() >= 5, "{} solutions", late.len());
    late.iter().sum::<f64>() / late.len() as f64
}

/// Root mean square and its standard error, m, of mean squares.
fn rms(squares: &[f64]) -> (f64, f64) {
    let n = squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / n;
    let variance = squares.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean.sqrt(), 0.5 * (variance / n / mean).sqrt())
}

/// Six short runs of each level.
#[test]
fn positions_err_as_on_samples() {
    let (mut drawn, mut sampled) = (Vec::new(), Vec::new());
    for seed in 0..6 {
        let (one, other) = (at_rest(2.0, seed), at_rest(2.0, 1000 + seed));
        let bank = CorrelatorLevelBank::new(one.scene()).unwrap();
        drawn.push(run_error_m2(&one, bank));
        let source = Synthesiser::new(other.scene()).unwrap();
        let bank = IfCorrelatorBank::new(source, 2.0, InstructionSet::detect()).unwrap();
        sampled.push(run_error_m2(&other, bank));
    }
    let ((a, error_a), (b, error_b)) = (rms(&drawn), rms(&sampled));
    assert!(
        (a - b).abs() < 3.0 * error_a.hypot(error_b),
        "rms {a} m (standard error {error_a}) and {b} m ({error_b})"
    );
}

#[test]
fn a_quantiser_that_is_not_modelled_is_refused() {
    let mut scene = at_rest(1.0, 0).scene();
    scene.reception.bits = Some(2);
    let error = CorrelatorLevelBank::new(scene).err().unwrap().to_string();
    assert!(error.starts_with("bits: "), "{error}");
}
