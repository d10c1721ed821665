//! 90 s of a static receiver, made by an independent simulator: stand-alone and assisted.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::path::Path;
use std::process::Command;

use end_to_end_tests::{EVERY_MONITOR, Run, STATIC, announce_skip, number, receive, test_data};
use gnss_nav::{Ephemeris, Geodetic};
use nalgebra::Vector3;

/// Satellites in the signal.
const PRNS: [u8; 9] = [3, 16, 18, 22, 25, 26, 29, 31, 32];

fn truth() -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    let p = Geodetic::from_degrees(35.681_298, 139.766_247, 10.0).to_ecef();
    let header = "time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps";
    let line = format!("{header}\n0,{},{},{},0,0,0\n", p.x, p.y, p.z);
    std::fs::write(file.path(), line).unwrap();
    file
}

#[test]
fn stand_alone_it_decodes_everything_and_fixes_by_20_s() {
    let Some(data) = test_data() else { return };
    let truth = truth();
    let truth = truth.path().to_str().unwrap();
    let run = receive(&data, &STATIC, &["--troposphere", "none", "--truth", truth]);
    let summary = run.summary();
    assert_eq!(summary["ephemerides_decoded"], serde_json::json!(PRNS));
    assert!(summary["first_fix_s"].as_f64().unwrap() <= 20.0);
    let error = &summary["error"];
    // The best other receiver reaches 0.97 m on a version of this signal 2 dB stronger.
    assert!(error["horizontal_rms_m"].as_f64().unwrap() <= 0.97);
    assert!(error["availability"].as_f64().unwrap() >= 0.99);
    for axis in ["east", "north"] {
        assert!(error["velocity_rms_mps"][axis].as_f64().unwrap() <= 0.05);
    }
    assert_ephemerides_are_those_broadcast(&data, &run);
    assert_rtklib_agrees(&run);
}

/// Every field equals the broadcast file's to its LNAV resolution: the simulator cuts off what is
/// below it. URA index, AODO and fit interval it does not send.
fn assert_ephemerides_are_those_broadcast(data: &Path, run: &Run) {
    let sent = receiver::rinex_nav::read(&data.join("if/simulated_static/brdc0010.22n")).unwrap();
    let decoded = receiver::rinex_nav::read(&run.path("navigation.rnx")).unwrap();
    for prn in PRNS {
        let of = |e: &&Ephemeris| e.satellite.prn == prn;
        let ours = decoded.ephemerides.iter().find(of).unwrap();
        let same = |e: &&Ephemeris| of(e) && e.toe == ours.toe;
        let theirs = sent.ephemerides.iter().find(same).unwrap();
        assert_eq!(whole_fields(ours), whole_fields(theirs), "G{prn:02}");
        assert_eq!(ours.toc, theirs.toc, "G{prn:02}");
        for (k, (a, b)) in steps(ours).iter().zip(steps(theirs)).enumerate() {
            // One step, and the digits of the text files.
            assert!((a - b).abs() <= 1.01, "G{prn:02} field {k}: {a} {b} steps");
        }
    }
}

fn whole_fields(e: &Ephemeris) -> (u16, u8, u8, u8) {
    (e.iodc, e.iode, e.health, e.codes_on_l2)
}

/// The other fields in steps of their least significant bits (IS-GPS-200, tables 20-I and 20-III).
fn steps(e: &Ephemeris) -> [f64; 19] {
    let semicircle = std::f64::consts::PI;
    let scaled = |value: f64, exponent: i32| value * 2f64.powi(exponent);
    let angle = |value: f64, exponent: i32| scaled(value / semicircle, exponent);
    [
        scaled(e.af0_s, 31),
        scaled(e.af1, 43),
        scaled(e.af2_per_s, 55),
        scaled(e.tgd_s, 31),
        scaled(e.sqrt_a, 19),
        scaled(e.eccentricity, 33),
        angle(e.m0_rad, 31),
        angle(e.delta_n_rad_s, 43),
        angle(e.omega0_rad, 31),
        angle(e.omega_dot_rad_s, 43),
        angle(e.i0_rad, 31),
        angle(e.idot_rad_s, 43),
        angle(e.omega_rad, 31),
        scaled(e.cuc_rad, 29),
        scaled(e.cus_rad, 29),
        scaled(e.crc_m, 5),
        scaled(e.crs_m, 5),
        scaled(e.cic_rad, 29),
        scaled(e.cis_rad, 29),
    ]
}

/// RTKLIB's single point on our RINEX files lies within 3 m of our own position.
fn assert_rtklib_agrees(run: &Run) {
    let folder = tempfile::tempdir().unwrap();
    let (configuration, solution) = (folder.path().join("conf"), folder.path().join("pos"));
    let options = "pos1-posmode=single\npos1-frequency=l1\npos1-elmask=0\npos1-ionoopt=brdc\n\
                   pos1-tropopt=off\npos1-sateph=brdc\npos1-navsys=1\nout-solformat=xyz\n\
                   out-timesys=gpst\nout-timeform=tow\nout-timendec=3\n";
    std::fs::write(&configuration, options).unwrap();
    let tried = Command::new("rnx2rtkp")
        .arg("-k")
        .arg(&configuration)
        .arg("-o")
        .arg(&solution)
        .args([run.path("observations.rnx"), run.path("navigation.rnx")])
        .output();
    if tried.is_err() {
        announce_skip("rnx2rtkp (package rtklib) is not installed");
        return;
    }
    let text = std::fs::read_to_string(&solution).unwrap();
    let rows = run.rows("pvt.csv");
    let mut compared = 0;
    for line in text.lines().filter(|l| !l.starts_with('%')) {
        let values: Vec<f64> = line
            .split_whitespace()
            .map(|f| f.parse().unwrap())
            .collect();
        let near = |r: &&std::collections::BTreeMap<String, String>| {
            (number(r, "tow_s") - values[1]).abs() < 0.01
        };
        let Some(ours) = rows.iter().find(near) else {
            continue;
        };
        let place = Geodetic::from_degrees(35.681_298, 139.766_247, 10.0);
        let xyz = ["x_m", "y_m", "z_m"].map(|n| number(ours, n));
        let (a, b) = (&values[2..5], xyz);
        let difference = Vector3::new(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
        let enu = place.enu_from_ecef() * difference;
        assert!(enu.x.hypot(enu.y) < 3.0, "at {} s", values[1]);
        compared += 1;
    }
    assert!(compared > 600, "{compared} epochs in common");
}

#[test]
fn assisted_it_fixes_within_a_second() {
    let Some(data) = test_data() else { return };
    let truth = truth();
    let nav = data.join("if/simulated_static/brdc0010.22n");
    let run = receive(
        &data,
        &STATIC,
        &[
            "--nav",
            nav.to_str().unwrap(),
            "--time",
            "2190:540003",
            "--position",
            "35.8,139.9,0",
            "--troposphere",
            "none",
            "--truth",
            truth.path().to_str().unwrap(),
            "--duration",
            "20",
        ],
    );
    let summary = run.summary();
    assert!(summary["first_fix_s"].as_f64().unwrap() <= 1.0);
    // Code smoothing has just begun: metres at first (the truth is judged over all epochs).
    assert!(summary["error"]["horizontal_rms_m"].as_f64().unwrap() < 3.0);
}

#[test]
fn no_monitor_excludes_a_healthy_channel() {
    let Some(data) = test_data() else { return };
    let signal = ["--mode", "vector", "--troposphere", "none"];
    let run = receive(&data, &STATIC, &[&signal[..], &EVERY_MONITOR].concat());
    let channels = run.rows("channels.csv");
    let mut judged = [0; 4];
    for channel in channels.iter().filter(|c| c["loop"] == "vector") {
        assert_eq!(channel["disposition"], "use", "{channel:?}");
        for (count, name) in judged.iter_mut().zip(["innovation", "svm", "lstm", "ewma"]) {
            *count += usize::from(!channel[&format!("score_{name}")].is_empty());
        }
    }
    // Nine channels for 60 s at least, ten times a second.
    assert!(judged.iter().all(|count| *count > 5400), "{judged:?}");
}

#[test]
fn the_same_samples_give_the_same_bytes() {
    let Some(data) = test_data() else { return };
    let once = receive(&data, &STATIC, &["--duration", "21"]);
    let again = receive(&data, &STATIC, &["--duration", "21", "--threads", "2"]);
    for name in [
        "summary.json",
        "pvt.csv",
        "channels.csv",
        "events.jsonl",
        "observations.rnx",
        "navigation.rnx",
        "track.kml",
        "track.nmea",
        "report.html",
    ] {
        assert!(once.text(name) == again.text(name), "{name} differs");
    }
    assert!(number(&once.rows("pvt.csv")[0], "time_s") <= 20.0);
}

#[test]
fn instruction_sets_agree() {
    let Some(data) = test_data() else { return };
    let fast = receive(&data, &STATIC, &["--duration", "20"]);
    let portable = receive(&data, &STATIC, &["--duration", "20", "--isa", "portable"]);
    let last = |run: &Run| {
        let rows = run.rows("pvt.csv");
        ["x_m", "y_m", "z_m"].map(|n| number(rows.last().unwrap(), n))
    };
    for (a, b) in last(&fast).iter().zip(last(&portable)) {
        // Carrier and code tables differ by 0.003 dB of noise, a thousandth of its power: a
        // thirtieth of the position noise of 3 m that 20 s leave.
        assert!((a - b).abs() < 0.3, "{a} {b}");
    }
}
