//! 107 ms of real signal received in flight: a coarse-time fix, and vector tracking from there.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::collections::BTreeMap;

use end_to_end_tests::{EVERY_MONITOR, FLIGHT, number, receive, test_data};

/// Documented position, ECEF m, and velocity, m/s.
const POSITION: [f64; 3] = [3_839_479.7, 721_777.3, 5_025_349.9];
const VELOCITY: [f64; 3] = [18.19, -79.33, -11.43];

#[test]
fn a_tenth_of_a_second_in_flight_gives_position_velocity_and_time() {
    let Some(data) = test_data() else { return };
    let nav = data.join("if/braunschweig_flight/sxnsr_test_data_flight.12n");
    let nav = nav.to_str().unwrap();
    // No prior position, the right one, and one 27 km off; time right and 15 s off.
    let mut found = Vec::new();
    for (position, time) in [
        (None, "1672:391558"),
        (Some("52.3246,10.6468,500"), "1672:391558"),
        (Some("52.53,10.85,0"), "1672:391573"),
        (Some("52.53,10.85,0"), "1672:391543"),
    ] {
        let mut options = vec!["--nav", nav, "--time", time];
        options.extend(position.iter().flat_map(|p| ["--position", p]));
        let run = receive(&data, &FLIGHT, &options);
        let rows = run.rows("pvt.csv");
        let fix = rows.last().unwrap();
        let position = ["x_m", "y_m", "z_m"].map(|n| number(fix, n));
        let error = position.iter().zip(POSITION).map(|(a, b)| (a - b).powi(2));
        let error = error.sum::<f64>().sqrt();
        // The limits; an independent solution of the same samples lies 6.9 m off.
        assert!(error < 15.0, "{error} m");
        for (name, truth) in ["vx_mps", "vy_mps", "vz_mps"].iter().zip(VELOCITY) {
            assert!((number(fix, name) - truth).abs() < 0.5, "{name}");
        }
        let first_sample = number(fix, "tow_s") - number(fix, "time_s");
        assert!((first_sample - 391_558.1).abs() < 0.1);
        assert!(number(fix, "satellites_used") >= 10.0);
        assert_eq!(fix["source"], "snapshot");
        found.push(position);
    }
    for other in &found[1..] {
        for (a, b) in found[0].iter().zip(other) {
            // The same minimum of the same squares, from another start.
            assert!((a - b).abs() < 0.01);
        }
    }
}

#[test]
fn vector_tracking_begins_with_the_first_fix_and_keeps_every_channel() {
    let Some(data) = test_data() else { return };
    let nav = data.join("if/braunschweig_flight/sxnsr_test_data_flight.12n");
    let options = ["--nav", nav.to_str().unwrap(), "--time", "1672:391558"];
    let speed_error = |row: &BTreeMap<String, String>| {
        let names = ["vx_mps", "vy_mps", "vz_mps"];
        let errors = names.iter().zip(VELOCITY);
        let squares = errors.map(|(name, truth)| (number(row, name) - truth).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let snapshot = receive(&data, &FLIGHT, &options);
    let vector = receive(
        &data,
        &FLIGHT,
        &[&options[..], &["--mode", "vector"], &EVERY_MONITOR].concat(),
    );
    let (before, after) = (snapshot.rows("pvt.csv"), vector.rows("pvt.csv"));
    let fix = after.last().unwrap();
    assert_eq!(fix["source"], "filter");
    assert_eq!(fix["status"], "fix");
    assert!(speed_error(fix) <= speed_error(before.last().unwrap()));
    // By deviations that say so; an independent solution lies 6.9 m from the position.
    for (name, truth) in ["x_m", "y_m", "z_m"].iter().zip(POSITION) {
        assert!((number(fix, name) - truth).abs() < 15.0, "{name}");
    }
    let channels = vector.rows("channels.csv");
    assert_eq!(channels.len(), 12);
    for channel in &channels {
        assert_eq!(channel["loop"], "vector");
        assert_eq!(channel["disposition"], "use");
    }
}
