//! Satellite states against a simulator's truth and against RTKLIB.

use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_nav::{GpsTime, LineOfSight, SatelliteId};
use nalgebra::Vector3;

use crate::data::{number, rows, text};
use crate::rinex;

fn vector(row: &[&str], first: usize) -> Vector3<f64> {
    Vector3::new(
        number(row, first),
        number(row, first + 1),
        number(row, first + 2),
    )
}

#[test]
fn positions_and_ranges_are_those_of_the_simulator() {
    let folder = "rinex/03_spirent_4h_5min";
    let (Some(nav), Some(truth)) = (
        text(&format!("{folder}/Spirent_RINEX_GN.23N")),
        text(&format!("{folder}/none_sat_data_V1A1.csv.gz")),
    ) else {
        return;
    };
    let store = rinex::read(&nav).store;
    let receiver = Vector3::new(
        -481_819.313_497_24,
        5_507_219.953_754_01,
        3_170_373.735_383_64,
    );
    let (mut worst_m, mut worst_range_m, mut count) = (0.0f64, 0.0f64, 0);
    for row in rows(&truth, 5).filter(|row| row[2] == "GPS") {
        let satellite = SatelliteId::gps(number(&row, 4) as u8);
        // File time 60 s is 10:00:00 of 2023-01-08.
        let received = GpsTime::new(2244, 36_000.0 - 60.0 + number(&row, 0) / 1e3);
        let sent = received - number(&row, 14) / SPEED_OF_LIGHT_MPS;
        let Some(ephemeris) = store.select(satellite, sent) else {
            continue;
        };
        let path = LineOfSight::new(&ephemeris.state_at(sent).unwrap(), &receiver);
        worst_m = worst_m.max((path.satellite_position_ecef_m - vector(&row, 6)).norm());
        worst_range_m = worst_range_m.max((path.range_m - number(&row, 14)).abs());
        count += 1;
    }
    eprintln!("{count} positions, worst {worst_m:.6} m, ranges {worst_range_m:.6} m");
    // The file has 0.1 mm steps; its simulator flies these very ephemerides.
    assert!(count > 200 && worst_m < 1e-3, "{count} {worst_m}");
    assert!(worst_range_m < 1e-3, "{worst_range_m}");
}

#[test]
fn states_are_those_of_rtklib() {
    let files = [
        ("rinex/01_sept078m_1hz", "SEPT078M.21P"),
        (
            "rinex/02_esbc_2020177_30s",
            "ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        ),
    ];
    for (folder, nav) in files {
        let (Some(nav), Some(reference)) = (
            text(&format!("{folder}/{nav}")),
            text(&format!("{folder}/satref.csv.gz")),
        ) else {
            return;
        };
        compare(&rinex::read(&nav), &reference);
    }
}

fn compare(navigation: &rinex::Navigation, reference: &str) {
    let (mut count, mut others, mut worst) = (0, 0, [0.0f64; 4]);
    for row in rows(reference, 1).filter(|row| row[2].starts_with('G')) {
        let time = GpsTime::new(number(&row, 0) as i32, number(&row, 1));
        let Some(ephemeris) = navigation.store.select(row[2].parse().unwrap(), time) else {
            continue;
        };
        let state = ephemeris.state_at(time).unwrap();
        let position_m = (state.position_ecef_m - vector(&row, 3)).norm();
        // RTKLIB may choose another issue, of equal age: its orbit is metres away.
        if position_m > 0.1 {
            others += 1;
            continue;
        }
        let clock_s = state.clock_bias_s + ephemeris.tgd_s - number(&row, 9);
        let errors = [
            position_m,
            (state.velocity_ecef_mps - vector(&row, 6)).norm(),
            (clock_s * SPEED_OF_LIGHT_MPS).abs(),
            ((state.clock_drift - number(&row, 10)) * SPEED_OF_LIGHT_MPS).abs(),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
        count += 1;
    }
    eprintln!("{count} states ({others} of other issues): worst {worst:?} m, m/s, m, m/s");
    assert!(count > 200 && others * 20 < count, "{count} {others}");
    // Positions are printed to 0.1 mm; RTKLIB differentiates them over 1 ms, good to 1 mm/s by the
    // rounding of an f64.
    assert!(
        worst[0] < 1e-3 && worst[1] < 1e-3 && worst[2] < 1e-6 && worst[3] < 1e-6,
        "{worst:?}"
    );
}

#[test]
fn velocities_and_drifts_are_derivatives() {
    let Some(nav) = text("if/braunschweig_flight/sxnsr_test_data_flight.12n") else {
        return;
    };
    let store = rinex::read(&nav).store;
    for ephemeris in store.iter() {
        let time = ephemeris.toe + 3_000.3;
        let (before, now, after) = (
            ephemeris.state_at(time - 0.5).unwrap(),
            ephemeris.state_at(time).unwrap(),
            ephemeris.state_at(time + 0.5).unwrap(),
        );
        let numeric = after.position_ecef_m - before.position_ecef_m;
        // Rounding of 2.6e7 m, 4 nm a coordinate, and the third derivative, 1e-4 m/s^3 / 24.
        assert!((numeric - now.velocity_ecef_mps).norm() < 2e-5);
        let drift = after.clock_bias_s - before.clock_bias_s;
        assert!(
            (drift - now.clock_drift).abs() < 1e-17,
            "{drift} {}",
            now.clock_drift
        );
    }
}
