//! The chart on the shape of the correlation, in the receiver.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::collections::BTreeSet;

use end_to_end_tests::{
    FLIGHT, POCKET_4MHZ, POCKET_12MHZ, STATIC, number, receive as receive_recording, test_data,
};
use fault_ml::shape::ShapeSettings;
use gnss_nav::SatelliteId;
use receiver::pipeline::{Policy, Settings, ShapeWatching, VectorSettings};
use receiver::record::EventKind;
use xtask::judged::{Judged, JudgedEpoch, receive, rms, settings};
use xtask::scenario::built::Scenario;
use xtask::scenario::catalogue;
use xtask::scenario::make::Level;

fn scenario(name: &str) -> Scenario {
    Scenario::new(&catalogue::find(name).unwrap(), None).unwrap()
}

fn watched(scenario: &Scenario, policy: Policy) -> Settings {
    Settings {
        shape: Some(ShapeWatching {
            chart: ShapeSettings::default(),
            policy,
        }),
        ..settings(scenario)
    }
}

/// Satellite and time of every alarm of the chart, s.
fn alarms(judged: &Judged) -> Vec<(SatelliteId, f64)> {
    let alarm = |event: &receiver::record::Event| match &event.kind {
        EventKind::Alarm { monitor, .. } | EventKind::Excluded { monitor, .. }
            if monitor == "ewma" =>
        {
            Some((event.satellite?, event.time_s))
        }
        _ => None,
    };
    judged.events.iter().filter_map(alarm).collect()
}

#[test]
fn both_reflections_are_found_in_scalar_tracking_and_no_other() {
    let scenario = scenario("zhang2014-multipath");
    let judged = receive(
        &scenario,
        Level::Correlator,
        &watched(&scenario, Policy::Exclude),
    );
    let alarms = alarms(&judged.unwrap());
    assert!(!alarms.is_empty());
    for (satellite, time_s) in &alarms {
        assert_eq!(*satellite, SatelliteId::gps(24));
        // During a reflection, or as it ends.
        let during = (2.0..4.2).contains(time_s) || (5.0..7.2).contains(time_s);
        assert!(during, "{time_s} s");
    }
    // An epoch of navigation is 0.1 s.
    assert!(alarms[0].1 < 2.5, "{alarms:?}");
}

#[test]
fn a_weight_or_exclusion_keeps_the_position() {
    let scenario = scenario("zhang2014-multipath");
    let error_m = |settings: &Settings| {
        let judged = receive(&scenario, Level::Correlator, settings).unwrap();
        rms(judged.between(2.5, 8.0).map(JudgedEpoch::horizontal_m))
    };
    let deweight = Policy::Deweight {
        variance_factor: 100.0,
    };
    let observed = error_m(&watched(&scenario, Policy::Observe));
    for policy in [Policy::Exclude, deweight] {
        let error = error_m(&watched(&scenario, policy));
        assert!(error < observed, "{error} of {observed} m");
    }
}

#[test]
fn it_watches_beside_the_filter_as_well() {
    let scenario = scenario("zhang2014-multipath");
    let judged = receive(&scenario, Level::Correlator, &vector(&scenario, true)).unwrap();
    let alarms = alarms(&judged);
    assert!(!alarms.is_empty());
    assert!(
        alarms
            .iter()
            .all(|(s, t)| *s == SatelliteId::gps(24) && *t > 2.0)
    );
}

/// In vector tracking, watched by the chart alone or by nobody.
fn vector(scenario: &Scenario, chart: bool) -> Settings {
    let watched = watched(scenario, Policy::Exclude);
    Settings {
        shape: watched.shape.filter(|_| chart),
        vector: Some(VectorSettings {
            monitor: None,
            ..VectorSettings::default()
        }),
        ..watched
    }
}

#[test]
fn between_houses_it_keeps_the_filter_on_the_road() {
    let scenario = scenario("urban-canyon");
    let p95_m = |chart| {
        let judged = receive(&scenario, Level::Correlator, &vector(&scenario, chart)).unwrap();
        let mut errors: Vec<f64> = judged
            .epochs
            .iter()
            .map(JudgedEpoch::horizontal_m)
            .collect();
        errors.sort_by(f64::total_cmp);
        errors[errors.len() * 95 / 100]
    };
    let (with, without) = (p95_m(true), p95_m(false));
    // 40 % below no monitor are asked for.
    assert!(with <= 0.6 * without, "{with} of {without} m");
}

#[test]
fn ten_minutes_under_an_open_sky_pass_without_an_alarm() {
    let file = catalogue::find("static-open-sky").unwrap();
    let file = file.with(&["duration_s=600".to_owned()]).unwrap();
    let scenario = Scenario::new(&file, None).unwrap();
    let judged = receive(&scenario, Level::Correlator, &vector(&scenario, true)).unwrap();
    assert_eq!(alarms(&judged), []);
    let scored = judged.channels.iter().filter(|c| !c.scores.is_empty());
    // Eight satellites, ten times a second.
    assert!(scored.count() > 45_000);
}

#[test]
fn healthy_channels_of_a_recording_do_not_alarm() {
    let Some(data) = test_data() else { return };
    let run = receive_recording(&data, &STATIC, &["--monitor", "ewma", "--duration", "60"]);
    let scored: Vec<_> = run.rows("channels.csv");
    let scored = scored.iter().filter(|row| !row["score_ewma"].is_empty());
    let mut judged = 0;
    for row in scored {
        assert!(
            number(row, "score_ewma") <= number(row, "threshold_ewma"),
            "{row:?}"
        );
        judged += 1;
    }
    // Nine satellites, ten times a second, but for their first seconds.
    assert!(judged > 4_000, "{judged}");
}

#[test]
fn half_a_second_is_long_enough_to_judge_and_no_healthy_channel_alarms() {
    let Some(data) = test_data() else { return };
    for (recording, expected) in [(POCKET_4MHZ, 8), (POCKET_12MHZ, 0), (FLIGHT, 0)] {
        let run = receive_recording(&data, &recording, &["--monitor", "ewma"]);
        let mut judged = BTreeSet::new();
        for row in run.rows("channels.csv") {
            if row["score_ewma"].is_empty() {
                continue;
            }
            let (score, limit) = (number(&row, "score_ewma"), number(&row, "threshold_ewma"));
            assert!(score <= limit, "{}: {row:?}", recording.reference);
            judged.insert(row["prn"].clone());
        }
        // The others last for 0.1 s, the chart takes 0.2 s to know its deviation.
        assert_eq!(judged.len(), expected, "{}", recording.reference);
    }
}
