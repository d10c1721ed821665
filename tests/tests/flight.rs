//! 107 ms of real signal received in flight: a coarse-time fix.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use end_to_end_tests::{FLIGHT, number, receive, test_data};

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
