//! GNSS-SDR, a receiver that nobody here wrote, on made-up signals: it takes them for real ones.
//!
//! A binary of its own: its threads race through the file, and the busier the machine the later in the signal they begin.
//! So each channel is told its satellite (those it would search in vain cost it the start of a frame), its Doppler is
//! found to 50 Hz, which its loops seldom fail to pull in, and there is signal for one frame more than it needs.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "support of tests: a failure here is a failed test"
)]

use std::fs;
use std::path::Path;
use std::process::Command;

use end_to_end_tests::announce_skip;
use gnss_nav::{Geodetic, SatelliteId};
use nalgebra::Vector3;
use receiver::truth::Truth;
use tempfile::TempDir;
use xtask::scenario::built::Scenario;
use xtask::scenario::catalogue;
use xtask::scenario::make::{self, Level};

/// Leap seconds that the scenarios broadcast: NMEA counts UTC.
const LEAP_SECONDS: f64 = 18.0;
/// Horizontal error asked of every position, m. GNSS-SDR's own loops leave up to 5 m here.
const LARGEST_ERROR_M: f64 = 10.0;

/// A position of GNSS-SDR.
struct Position {
    /// Second of the day, UTC.
    second: f64,
    place: Geodetic,
}

#[test]
fn gnss_sdr_fixes_at_rest() {
    // Long loops of 20 ms; its first position comes after 43 s, or a frame of 30 s later.
    judge("static-open-sky", "105", 20, 25);
}

#[test]
fn gnss_sdr_follows_the_turns_of_a_car() {
    // Its loops of 20 ms lose the car; those of 1 ms hold.
    judge("vehicle-turns", "130", 1, 40);
}

/// Makes `duration` seconds of the scenario `name` and lets GNSS-SDR receive them with loops of
/// `extended_ms`: at least `expected` positions, all of them right.
fn judge(name: &str, duration: &str, extended_ms: u32, expected: usize) {
    if Command::new("gnss-sdr").arg("--version").output().is_err() {
        announce_skip("gnss-sdr is not installed: no other receiver judges the made-up signals");
        return;
    }
    let folder = TempDir::new().unwrap();
    let file = catalogue::find(name).unwrap();
    let file = file.with(&[format!("duration_s={duration}")]).unwrap();
    let scenario = Scenario::new(&file, None).unwrap();
    make::make(&scenario, Level::If, folder.path()).unwrap();
    let nmea = receive(folder.path(), &scenario, extended_ms);
    let truth = Truth::read(&folder.path().join("truth.csv")).unwrap();
    let positions: Vec<Position> = nmea.lines().filter_map(position).collect();
    assert!(
        positions.len() >= expected,
        "{name}: {} positions",
        positions.len()
    );
    let start_s = scenario.truth.start.tow_s() % 86_400.0;
    for position in &positions {
        let time_s = position.second + LEAP_SECONDS - start_s;
        let Some(true_point) = truth.at(time_s) else {
            continue;
        };
        let error_m = horizontal_m(&position.place, &true_point.position_ecef_m);
        assert!(
            error_m < LARGEST_ERROR_M,
            "{name}: {error_m:.1} m off at {time_s:.1} s"
        );
    }
}

/// The NMEA log of GNSS-SDR on the samples in `folder`.
fn receive(folder: &Path, scenario: &Scenario, extended_ms: u32) -> String {
    let configuration = configuration(
        &folder.join(make::SAMPLES_NAME),
        scenario.reception.samples.sample_rate_hz,
        &scenario.names(),
        extended_ms,
    );
    fs::write(folder.join("peer.conf"), configuration).unwrap();
    let output = Command::new("gnss-sdr")
        .arg("--config_file=peer.conf")
        .current_dir(folder)
        .output()
        .unwrap();
    fs::read_to_string(folder.join("pvt.nmea")).unwrap_or_else(|_| {
        let said = String::from_utf8_lossy(&output.stdout);
        let tail = said.len().saturating_sub(2000);
        panic!("gnss-sdr wrote no position:\n{}", &said[tail..])
    })
}

/// Settings for 8-bit complex samples at zero intermediate frequency; the names are GNSS-SDR's.
fn configuration(
    samples: &Path,
    rate_hz: f64,
    satellites: &[SatelliteId],
    extended_ms: u32,
) -> String {
    let channels = satellites.len().to_string();
    let entries = [
        ("GNSS-SDR.internal_fs_sps", rate_hz.to_string()),
        ("SignalSource.implementation", "File_Signal_Source".into()),
        ("SignalSource.filename", samples.display().to_string()),
        ("SignalSource.item_type", "ibyte".into()),
        ("SignalSource.sampling_frequency", rate_hz.to_string()),
        ("SignalSource.samples", "0".into()),
        (
            "SignalConditioner.implementation",
            "Signal_Conditioner".into(),
        ),
        ("DataTypeAdapter.implementation", "Ibyte_To_Complex".into()),
        ("InputFilter.implementation", "Pass_Through".into()),
        ("InputFilter.item_type", "gr_complex".into()),
        ("Resampler.implementation", "Pass_Through".into()),
        ("Resampler.item_type", "gr_complex".into()),
        ("Channels_1C.count", channels.clone()),
        // One at a time each waits for a thread of its own to be told.
        ("Channels.in_acquisition", channels),
        ("Channel.signal", "1C".into()),
        (
            "Acquisition_1C.implementation",
            "GPS_L1_CA_PCPS_Acquisition".into(),
        ),
        ("Acquisition_1C.item_type", "gr_complex".into()),
        ("Acquisition_1C.pfa", "0.01".into()),
        ("Acquisition_1C.doppler_max", "6000".into()),
        ("Acquisition_1C.doppler_step", "100".into()),
        ("Acquisition_1C.blocking", "true".into()),
        (
            "Tracking_1C.implementation",
            "GPS_L1_CA_DLL_PLL_Tracking".into(),
        ),
        ("Tracking_1C.item_type", "gr_complex".into()),
        ("Tracking_1C.pll_bw_hz", "35.0".into()),
        ("Tracking_1C.dll_bw_hz", "2.0".into()),
        ("Tracking_1C.early_late_space_chips", "0.5".into()),
        (
            "Tracking_1C.extend_correlation_symbols",
            extended_ms.to_string(),
        ),
        ("Tracking_1C.pll_bw_narrow_hz", "5.0".into()),
        ("Tracking_1C.dll_bw_narrow_hz", "0.75".into()),
        (
            "TelemetryDecoder_1C.implementation",
            "GPS_L1_CA_Telemetry_Decoder".into(),
        ),
        ("Observables.implementation", "Hybrid_Observables".into()),
        ("PVT.implementation", "RTKLIB_PVT".into()),
        ("PVT.positioning_mode", "Single".into()),
        ("PVT.iono_model", "Broadcast".into()),
        ("PVT.trop_model", "Saastamoinen".into()),
        ("PVT.output_rate_ms", "100".into()),
        ("PVT.display_rate_ms", "1000".into()),
        ("PVT.nmea_dump_filename", "./pvt.nmea".into()),
        ("PVT.flag_nmea_tty_port", "false".into()),
    ];
    let lines = entries.map(|(key, value)| format!("{key}={value}\n"));
    let assigned = satellites.iter().enumerate();
    let assigned = assigned
        .map(|(channel, satellite)| format!("Channel{channel}.satellite={}\n", satellite.prn));
    format!(
        "[GNSS-SDR]\n{}{}",
        lines.concat(),
        assigned.collect::<String>()
    )
}

/// Reads a GGA sentence.
fn position(line: &str) -> Option<Position> {
    let fields: Vec<&str> = line.split(',').collect();
    let [kind, time, lat, north, lon, east, _, _, _, height, ..] = fields[..] else {
        return None;
    };
    if !kind.ends_with("GGA") {
        return None;
    }
    let degrees = |text: &str, digits: usize, sign: f64| -> Option<f64> {
        let whole: f64 = text.get(..digits)?.parse().ok()?;
        let minutes: f64 = text.get(digits..)?.parse().ok()?;
        Some(sign * (whole + minutes / 60.0))
    };
    let number = |range: std::ops::Range<usize>| time.get(range)?.parse::<f64>().ok();
    let seconds: f64 = time.get(4..)?.parse().ok()?;
    Some(Position {
        second: number(0..2)? * 3600.0 + number(2..4)? * 60.0 + seconds,
        place: Geodetic::from_degrees(
            degrees(lat, 2, if north == "N" { 1.0 } else { -1.0 })?,
            degrees(lon, 3, if east == "E" { 1.0 } else { -1.0 })?,
            height.parse().ok()?,
        ),
    })
}

fn horizontal_m(place: &Geodetic, true_ecef_m: &Vector3<f64>) -> f64 {
    let true_place = Geodetic::from_ecef(true_ecef_m);
    let error = true_place.enu_from_ecef() * (place.to_ecef() - true_ecef_m);
    error.xy().norm()
}
