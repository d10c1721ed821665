//! Least squares on made-up satellites.

use super::*;
use crate::SatelliteState;
use crate::geodesy::Geodetic;
use crate::measurement::ErrorModel;

const RECEIVER_VELOCITY: [f64; 3] = [30.0, -80.0, 12.0];
const CLOCK_M: f64 = 123_456.0;
const DRIFT_MPS: f64 = -77.0;

fn receiver() -> Vector3<f64> {
    Geodetic::from_degrees(52.3, 10.6, 500.0).to_ecef()
}

/// Satellites at 2.66e7 m over directions spread through the sky, measured without noise.
fn measurements(count: usize) -> Vec<Measurement> {
    let sky = Geodetic::from_degrees(52.3, 10.6, 0.0)
        .enu_from_ecef()
        .transpose();
    (0..count)
        .map(|k| {
            let (azimuth, elevation) = (2.4 * k as f64, 0.2 + 0.11 * k as f64);
            let up = Vector3::new(
                azimuth.sin() * elevation.cos(),
                azimuth.cos() * elevation.cos(),
                elevation.sin(),
            );
            let state = SatelliteState {
                position_ecef_m: receiver() + sky * up * 2.2e7,
                velocity_ecef_mps: sky * Vector3::new(3e3 * azimuth.cos(), 900.0, 500.0),
                clock_bias_s: 1e-4,
                clock_drift: 1e-11,
            };
            measure(k, state)
        })
        .collect()
}

fn measure(k: usize, state: SatelliteState) -> Measurement {
    let receive_time = GpsTime::new(1672, 391_558.0);
    let predicted = MeasurementModel::geometry_only().predict(&state, &receiver(), receive_time);
    let range_rate = predicted
        .line_of_sight
        .range_rate_mps(&Vector3::from(RECEIVER_VELOCITY));
    Measurement {
        satellite: SatelliteId::gps(k as u8 + 1),
        receive_time,
        pseudorange_m: predicted.pseudorange_m + CLOCK_M,
        range_rate_mps: range_rate + DRIFT_MPS - SPEED_OF_LIGHT_MPS * state.clock_drift,
        pseudorange_variance_m2: 4.0,
        range_rate_variance_m2_s2: 0.01,
        cn0_dbhz: 45.0,
        state,
        user_range_accuracy_m: 2.0,
    }
}

fn model() -> MeasurementModel {
    MeasurementModel {
        errors: ErrorModel::TRACKING_NOISE_ONLY,
        ..MeasurementModel::default()
    }
}

#[test]
fn exact_measurements_give_the_exact_solution_from_any_start() {
    let centre = Vector3::zeros();
    let antipode = -receiver();
    let space = Vector3::new(4e7, -1e8, 3e7);
    for start in [centre, antipode, space, receiver()] {
        let solution = solve(&measurements(8), &model(), &start).unwrap();
        // Rounding of 2e7 m pseudoranges (4 nm) times the dilution.
        assert!((solution.position_ecef_m - receiver()).norm() < 1e-6);
        assert!((solution.clock_bias_m - CLOCK_M).abs() < 1e-6);
        let velocity = solution.velocity.unwrap();
        let error = velocity.velocity_ecef_mps - Vector3::from(RECEIVER_VELOCITY);
        assert!(error.norm() < 1e-9, "{error}");
        assert!((velocity.clock_drift_mps - DRIFT_MPS).abs() < 1e-9);
        assert!(solution.chi_square < 1e-9);
    }
}

#[test]
fn covariance_is_variance_times_dop_for_equal_weights() {
    let solution = solve(&measurements(7), &model(), &Vector3::zeros()).unwrap();
    let trace = solution.covariance_m2.trace();
    // Rotation keeps the trace; the variance is 4 m^2. Convergence step over range: 1e-11.
    assert!((trace / 4.0 / solution.dops.gdop.powi(2) - 1.0).abs() < 1e-9);
    assert!(solution.dops.hdop < solution.dops.pdop && solution.dops.pdop < solution.dops.gdop);
}

#[test]
fn mask_and_missing_dopplers() {
    let masked = MeasurementModel {
        elevation_mask_rad: 0.25,
        ..model()
    };
    let mut m = measurements(8);
    for one in &mut m[..5] {
        one.range_rate_variance_m2_s2 = f64::INFINITY;
    }
    let solution = solve(&m, &masked, &Vector3::zeros()).unwrap();
    assert_eq!(solution.masked, [SatelliteId::gps(1)]);
    assert_eq!(solution.velocity, None);
    assert!(
        solution
            .satellites
            .iter()
            .all(|s| s.range_rate_residual_mps.is_none())
    );
}

#[test]
fn too_few_singular_and_absurd_input_are_errors() {
    let few = solve(&measurements(3), &model(), &Vector3::zeros());
    assert_eq!(
        few,
        Err(NavError::TooFew {
            found: 3,
            needed: 4
        })
    );
    let same = vec![measurements(1)[0]; 6];
    assert!(solve(&same, &model(), &Vector3::zeros()).is_err());
    let mut absurd = measurements(6);
    absurd[1].pseudorange_m = f64::NAN;
    assert!(solve(&absurd, &model(), &Vector3::zeros()).is_err());
    let nowhere = Vector3::new(f64::NAN, 0.0, 0.0);
    assert!(solve(&measurements(6), &model(), &nowhere).is_ok());
}
