//! Real recordings: what is acquired, and how it is tracked.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::collections::BTreeSet;

use end_to_end_tests::{
    CTTC, FLIGHT, PEREGRINE, POCKET_4MHZ, POCKET_12MHZ, Recording, number, receive, test_data,
};
use serde_json::Value;

/// Satellites that the reference does not list and that are there: each is found in both halves
/// of its recording at the code phase that its Doppler predicts (acquisition's own tests).
const UNLISTED: [(&str, &[u64]); 3] = [
    ("pocketsdr_4MHz", &[4, 25]),
    ("cttc", &[31]),
    ("peregrine", &[12]),
];

#[test]
fn every_strong_satellite_is_acquired_where_the_reference_has_it() {
    let Some(data) = test_data() else { return };
    let text = std::fs::read_to_string(data.join("if/reference_acquisition.json")).unwrap();
    let reference: Value = serde_json::from_str(&text).unwrap();
    for (recording, doppler_hz) in [
        (FLIGHT, 10.0),
        (POCKET_4MHZ, 10.0),
        (POCKET_12MHZ, 10.0),
        (CTTC, 40.0),
        (PEREGRINE, 40.0),
    ] {
        let name = recording.reference;
        let summary = receive(&data, &recording, &[]).summary();
        let acquired = summary["acquired"].as_array().unwrap();
        let listed = reference[name]["sats"].as_array().unwrap();
        for satellite in listed {
            let prn = &satellite["prn"];
            let Some(hit) = acquired.iter().find(|a| a["prn"] == *prn) else {
                assert!(
                    satellite["cn0_dbhz"].as_f64().unwrap() < 39.0,
                    "{name}: {prn}"
                );
                continue;
            };
            let difference = |ours: &str, theirs: &str| {
                hit[ours].as_f64().unwrap() - satellite[theirs].as_f64().unwrap()
            };
            let doppler = difference("doppler_hz", "doppler_hz");
            assert!(
                doppler.abs() < doppler_hz,
                "{name}: {prn} Doppler {doppler}"
            );
            let code = difference("code_phase_chips", "code_phase_chips_at_sample0");
            let code = (code + 511.5).rem_euclid(1023.0) - 511.5;
            if satellite["cn0_dbhz"].as_f64().unwrap() >= 39.0 {
                assert!(code.abs() < 0.15, "{name}: {prn} code {code}");
            }
        }
        assert_only_real(&recording, acquired, listed);
    }
}

fn assert_only_real(recording: &Recording, acquired: &[Value], listed: &[Value]) {
    let unlisted = UNLISTED
        .iter()
        .find(|(name, _)| *name == recording.reference);
    for hit in acquired {
        let prn = hit["prn"].as_u64().unwrap();
        let known = listed.iter().any(|s| s["prn"] == prn)
            || unlisted.is_some_and(|(_, prns)| prns.contains(&prn));
        assert!(known, "{}: G{prn:02} is not there", recording.reference);
    }
}

#[test]
fn half_a_second_is_tracked_from_the_first_bit_to_the_last() {
    let Some(data) = test_data() else { return };
    let run = receive(&data, &POCKET_4MHZ, &["--dump", "taps"]);
    // The code of this recording drifts against its carrier: I and Q are exchanged.
    assert_eq!(run.events("spectrum_inverted").len(), 1);
    let synchronised: BTreeSet<String> = run
        .events("bit_sync")
        .iter()
        .map(|e| e["sat"].as_str().unwrap().to_owned())
        .collect();
    let channels = run.rows("channels.csv");
    let taps = run.rows("taps.csv");
    for sat in ["G26", "G31", "G29", "G16", "G32"] {
        assert!(synchronised.contains(sat), "{sat}");
        let own: Vec<_> = channels.iter().filter(|r| r["sat"] == sat).collect();
        let last = own.last().unwrap();
        assert!((number(last, "time_s") - 0.5).abs() < 1e-9);
        for row in own.iter().filter(|r| number(r, "time_s") > 0.15) {
            assert_eq!(row["lock"], "carrier", "{sat}");
        }
        // Tracking starts anew from the first bit once the spectrum is known: what counts is the
        // longest unbroken stretch of integrations of half a bit.
        let ends: Vec<f64> = taps
            .iter()
            .filter(|r| r["sat"] == sat && number(r, "offset_chips") == 0.0)
            .filter(|r| (number(r, "duration_s") - 0.01).abs() < 1e-4)
            .map(|r| number(r, "time_s"))
            .collect();
        let stretches = ends.chunk_by(|a, b| (b - a - 0.01).abs() < 1e-4);
        let longest = stretches.map(<[f64]>::len).max().unwrap();
        assert!(longest / 2 >= 23, "{sat}: {} bits", longest / 2);
    }
}

#[test]
fn lost_samples_are_reported_and_tracking_goes_on() {
    let Some(data) = test_data() else { return };
    let run = receive(&data, &POCKET_12MHZ, &[]);
    let jumps = run.events("discontinuity");
    assert_eq!(jumps.len(), 1);
    // The jump comes after 87 ms, by 82.27 chips; it is placed to a code period.
    assert!((jumps[0]["time_s"].as_f64().unwrap() - 0.087).abs() < 0.0015);
    let chips = jumps[0]["jump_s"].as_f64().unwrap() * 1.023e6;
    assert!((chips - 82.27).abs() < 0.15, "{chips} chips");
    let rows = run.rows("channels.csv");
    let strong = ["G13", "G05", "G15", "G20", "G30"];
    for sat in strong {
        let last = rows.iter().rfind(|r| r["sat"] == sat).unwrap();
        assert_ne!(last["lock"], "lost", "{sat}");
        // What is left after the jump still shows the signal's full strength.
        assert!(number(last, "cn0_dbhz") > 42.0, "{sat}");
    }
}
