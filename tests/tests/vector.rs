//! Vector tracking on scenarios at the correlator level, judged against their truth.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use receiver::pipeline::{Settings, VectorSettings};
use receiver::record::{EventKind, Status};
use xtask::judged::{Judged, JudgedEpoch, receive, rms, settings};
use xtask::scenario::built::Scenario;
use xtask::scenario::catalogue;
use xtask::scenario::make::Level;

/// The receiver in vector mode, with the settings of its command line's defaults.
fn vector(scenario: &Scenario) -> Settings {
    Settings {
        vector: Some(VectorSettings::default()),
        ..settings(scenario)
    }
}

fn scenario(name: &str, overrides: &[&str], seed: Option<u64>) -> Scenario {
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
    let file = catalogue::find(name).unwrap().with(&overrides).unwrap();
    Scenario::new(&file, seed).unwrap()
}

fn run(scenario: &Scenario) -> Judged {
    receive(scenario, Level::Correlator, &vector(scenario)).unwrap()
}

fn horizontal_rms_m(judged: &Judged) -> f64 {
    rms(judged.epochs.iter().map(JudgedEpoch::horizontal_m))
}

fn velocity_rms_mps(judged: &Judged, axis: usize) -> f64 {
    rms(judged.epochs.iter().map(|e| e.velocity_enu_mps[axis]))
}

#[test]
fn it_follows_a_car_through_turns_of_one_g() {
    let scenario = scenario("vehicle-turns", &[], None);
    let judged = run(&scenario);
    assert!(judged.availability(scenario.duration_s, 10.0) >= 0.99);
    // The limits asked for: 0.8 m, and 0.05, 0.05 and 0.2 m/s with the carrier's phase.
    assert!(horizontal_rms_m(&judged) <= 0.8);
    for (axis, limit_mps) in [(0, 0.05), (1, 0.05), (2, 0.2)] {
        let rms_mps = velocity_rms_mps(&judged, axis);
        assert!(rms_mps <= limit_mps, "axis {axis}: {rms_mps} m/s");
    }
}

#[test]
fn the_frequency_discriminator_alone_follows_it_too() {
    let scenario = scenario("vehicle-turns", &[], None);
    let mut settings = vector(&scenario);
    settings.tracking.steered.carrier_phase = false;
    let judged = receive(&scenario, Level::Correlator, &settings).unwrap();
    assert!(judged.availability(scenario.duration_s, 10.0) >= 0.99);
    assert!(horizontal_rms_m(&judged) <= 0.8);
    for axis in [0, 1] {
        let rms_mps = velocity_rms_mps(&judged, axis);
        assert!(rms_mps <= 0.15, "axis {axis}: {rms_mps} m/s");
    }
}

/// Whether an epoch is a fix whose horizontal error is below 10 m.
fn is_good(epoch: &JudgedEpoch) -> bool {
    epoch.pvt.status == Status::Fix && epoch.horizontal_m() < 10.0
}

/// Holds an outage from 60 s on, of which no epoch is lost.
fn assert_bridged(judged: &Judged, outage_s: f64, back_s: f64, error_m: f64) {
    let end_s = 60.0 + outage_s;
    let during = judged.between(60.15, end_s - 0.05);
    assert!(during.clone().count() > 0);
    for epoch in during {
        let pvt = &epoch.pvt;
        assert_eq!(pvt.status, Status::Predicted, "at {} s", pvt.time_s);
        assert!(epoch.horizontal_m() < error_m, "at {} s", pvt.time_s);
        // Inside what is reported: four deviations of each axis.
        for axis in 0..3 {
            assert!(epoch.position_enu_m[axis].abs() < 4.0 * pvt.sigma_enu_m[axis]);
        }
    }
    let first = judged.between(end_s, f64::INFINITY).find(|e| is_good(e));
    let first_s = first.unwrap().pvt.time_s;
    assert!(first_s - end_s <= back_s + 1e-6, "good from {first_s} s");
    let mut after = judged.between(first_s, f64::INFINITY);
    assert!(after.all(is_good));
}

#[test]
fn it_bridges_outages_at_rest() {
    for (name, outage_s, back_s) in [("outage-2s", 2.0, 0.2), ("outage-10s", 10.0, 1.0)] {
        let scenario = scenario(name, &[], None);
        let judged = run(&scenario);
        assert!(judged.availability(scenario.duration_s, 10.0) >= 0.99);
        assert_bridged(&judged, outage_s, back_s, 10.0);
    }
}

#[test]
fn it_bridges_an_outage_of_a_car_on_a_straight() {
    let outage = "fault=[{kind=\"outage\",begin_s=60,end_s=70}]";
    let scenario = scenario("vehicle-turns", &[outage], None);
    let judged = run(&scenario);
    assert!(judged.availability(scenario.duration_s, 10.0) >= 0.99);
    assert_bridged(&judged, 10.0, 1.0, 50.0);
}

#[test]
fn a_blocked_satellite_is_noticed_and_harmless() {
    for (name, blocked_s) in [("jiang2017-1", 22.0), ("jiang2017-2", 20.0)] {
        let judged = run(&scenario(name, &[], None));
        // From ten seconds on, when the start has settled.
        for epoch in judged.between(10.0, f64::INFINITY) {
            let error_m = epoch.position_enu_m.norm();
            assert!(
                error_m <= 3.0,
                "{name} at {} s: {error_m} m",
                epoch.pvt.time_s
            );
        }
        let lost = judged.events.iter().find(|e| {
            let lost = receiver::record::Lock::Lost;
            e.time_s >= blocked_s
                && matches!(e.kind, EventKind::LockChanged { to, .. } if to == lost)
        });
        assert!(lost.unwrap().time_s - blocked_s <= 0.1);
    }
}

#[test]
fn batch_and_sequential_filter_go_the_same_way() {
    use receiver::pipeline::FilterKind;
    let scenario = scenario("vehicle-turns", &["duration_s=40"], None);
    let by = |filter| {
        let mut settings = vector(&scenario);
        settings.vector = Some(VectorSettings {
            filter,
            ..VectorSettings::default()
        });
        receive(&scenario, Level::Correlator, &settings).unwrap()
    };
    let (batch, sequential) = (by(FilterKind::Batch), by(FilterKind::Sequential));
    assert_eq!(batch.epochs.len(), sequential.epochs.len());
    for (a, b) in batch.epochs.iter().zip(&sequential.epochs) {
        // Rounding, through the same noise: steered a nanometre apart, discriminators differ as little.
        let apart_m = (a.pvt.position_ecef_m - b.pvt.position_ecef_m).norm();
        assert!(apart_m < 1e-3, "{apart_m} m at {} s", a.pvt.time_s);
    }
}
