//! Coarse-time solution of the recorded flight, from an independent acquisition of it.

use gnss_nav::coarse_time::{Prior, SnapshotMeasurement, SnapshotSolution, solve};
use gnss_nav::constants::CA_CODE_RATE_HZ;
use gnss_nav::{Geodetic, GpsTime, MeasurementModel};
use nalgebra::Vector3;
use serde_json::Value;

use crate::data::text;
use crate::rinex;

const POSITION_M: [f64; 3] = [3_839_479.7, 721_777.3, 5_025_349.9];
const VELOCITY_MPS: [f64; 3] = [18.19, -79.33, -11.43];
const TOW_S: f64 = 391_558.056;

fn measurements(reference: &str) -> Vec<SnapshotMeasurement> {
    let json: Value = serde_json::from_str(reference).unwrap();
    let satellites = json["braunschweig_flight"]["sats"].as_array().unwrap();
    satellites.iter().map(measurement).collect()
}

fn measurement(one: &Value) -> SnapshotMeasurement {
    let value = |name: &str| one[name].as_f64().unwrap();
    let cn0_hz = 10f64.powf(value("cn0_dbhz") / 10.0);
    // Early minus late at half a chip over 100 ms; the reference is rounded to 0.001 chip.
    let code_sigma_m = 293.05 * (0.5 / (4.0 * 0.1 * cn0_hz)).sqrt() + 1.0;
    SnapshotMeasurement {
        satellite: format!("G{:02}", one["prn"]).parse().unwrap(),
        transmit_fraction_s: value("code_phase_chips_at_sample0") / CA_CODE_RATE_HZ,
        doppler_hz: value("doppler_hz"),
        code_variance_m2: code_sigma_m.powi(2),
        // 0.1 Hz of rounding, and the noise of a coherent 100 ms.
        doppler_variance_hz2: 0.1f64.powi(2) + 3.0 / (cn0_hz * 0.1f64.powi(3)) / 39.5,
    }
}

fn check(found: &SnapshotSolution) {
    let solution = &found.solution;
    let error_m = (solution.position_ecef_m - Vector3::from(POSITION_M)).norm();
    let velocity = solution.velocity.unwrap();
    let miss = velocity.velocity_ecef_mps - Vector3::from(VELOCITY_MPS);
    let late_s = solution.receive_time - GpsTime::new(1672, TOW_S);
    eprintln!(
        "{} satellites without {:?}: {error_m:.1} m, {:.2?} m/s, {late_s:.4} s (sigma {:.4})",
        solution.satellites.len(),
        solution.excluded,
        miss.as_slice(),
        found.time_sigma_s,
    );
    // What the recording's own documentation and this receiver's requirement ask for.
    assert!(error_m < 15.0 && late_s.abs() < 0.1);
    assert!(miss.iter().all(|axis| axis.abs() < 0.5));
    assert!(solution.satellites.len() >= 10);
}

#[test]
fn the_flight_is_where_it_was() {
    let (Some(nav), Some(reference)) = (
        text("if/braunschweig_flight/sxnsr_test_data_flight.12n"),
        text("if/reference_acquisition.json"),
    ) else {
        return;
    };
    let navigation = rinex::read(&nav);
    let measurements = measurements(&reference);
    let model = MeasurementModel {
        ionosphere: navigation.klobuchar,
        troposphere: true,
        ..MeasurementModel::default()
    };
    let run = |prior: &Prior| {
        let found = solve(&measurements, &navigation.store, prior, &model, 1e-4).unwrap();
        check(&found);
        found.solution.position_ecef_m
    };
    let truth = Vector3::from(POSITION_M);
    let near = run(&Prior::new(GpsTime::new(1672, 391_558.0), Some(truth)));
    let sky = Geodetic::from_ecef(&truth).enu_from_ecef().transpose();
    for (enu, late_s) in [
        ([19e3, 19e3, 0.0], 15.0),
        ([-27e3, 0.0, 0.0], -15.0),
        ([0.0, 100e3, 0.0], 60.0),
        ([-70e3, -70e3, -490.0], -60.0),
    ] {
        let position = truth + sky * Vector3::from(enu);
        let far = run(&Prior::new(
            GpsTime::new(1672, 391_558.0 + late_s),
            Some(position),
        ));
        // The prior pulls by its error times (10 m / 100 km)^2.
        assert!((far - near).norm() < 0.1);
    }
    // No position at all: an aeroplane, so the Dopplers are good for some hundred kilometres.
    let mut nowhere = Prior::new(GpsTime::new(1672, 391_558.0), None);
    nowhere.time_uncertainty_s = 10.0;
    assert!((run(&nowhere) - near).norm() < 0.1);
}
