//! Vector tracking on scenarios at the correlator level, judged against their truth.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use gnss_nav::Ephemeris;
use gnss_nav::constants::MU_M3_PER_S2;
use receiver::pipeline::{Settings, VectorSettings};
use receiver::record::{ChannelRecord, EventKind, Lock, LoopMembership, Status};
use xtask::judged::{Judged, JudgedEpoch, receive, rms, settings};
use xtask::scenario::built::Scenario;
use xtask::scenario::catalogue;
use xtask::scenario::make::Level;
use xtask::train::plan::{Plan, Series};

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
#[test]
fn the_filter_waits_as_long_as_it_is_told_to() {
    let overrides = ["duration_s=12", "receiver={assisted=true}"];
    let scenario = scenario("static-open-sky", &overrides, None);
    let mut settings = vector(&scenario);
    let taken_over_s = |settings: &Settings| {
        let judged = receive(&scenario, Level::Correlator, settings).unwrap();
        let to = LoopMembership::Vector;
        happened(&judged, 0.0, |k| *k == EventKind::ModeSwitched { to }).unwrap()
    };
    assert!(taken_over_s(&settings) < 2.0);
    settings.vector.as_mut().unwrap().from_s = 10.0;
    let after_s = taken_over_s(&settings);
    // Three fixes, ten a second.
    assert!((10.0..10.5).contains(&after_s), "{after_s}");
}

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
        let lost = |k: &EventKind| matches!(k, EventKind::LockChanged { to: Lock::Lost, .. });
        let lost_s = happened(&judged, blocked_s, lost).unwrap();
        assert!(lost_s - blocked_s <= 0.1);
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
/// A receiver at rest under an open sky, with one fault.
fn with_fault(fault: &str) -> Judged {
    run(&scenario(
        "static-open-sky",
        &[&format!("fault=[{fault}]")],
        None,
    ))
}

fn happened(judged: &Judged, since_s: f64, what: impl Fn(&EventKind) -> bool) -> Option<f64> {
    let event = judged
        .events
        .iter()
        .find(|e| e.time_s >= since_s && what(&e.kind));
    event.map(|e| e.time_s)
}

#[test]
fn a_step_of_the_clock_is_followed_and_reported() {
    // 90 m: a third of a chip, within reach of the taps.
    let judged = with_fault("{kind=\"clock_jump\",begin_s=50,size_s=3e-7}");
    let step_s = happened(&judged, 50.0, |k| matches!(k, EventKind::ClockStep { .. }));
    assert!(step_s.unwrap() <= 50.1);
    assert!(happened(&judged, 50.0, |k| matches!(k, EventKind::Excluded { .. })).is_none());
    assert!(judged.epochs.iter().all(|e| e.horizontal_m() < 5.0));
}

#[test]
fn a_step_of_the_clock_by_a_code_period_is_reported_and_the_time_found_again() {
    let judged = with_fault("{kind=\"clock_jump\",begin_s=50,size_s=1e-3}");
    let step_s = happened(&judged, 50.0, |k| matches!(k, EventKind::ClockStep { .. }));
    // A second of bits tells.
    assert!(step_s.unwrap() <= 51.5, "{step_s:?}");
    let vector = |k: &EventKind| {
        matches!(
            k,
            EventKind::ModeSwitched {
                to: LoopMembership::Vector
            }
        )
    };
    assert!(happened(&judged, step_s.unwrap(), vector).is_some());
    assert!(judged.epochs.iter().all(|e| e.horizontal_m() < 15.0));
    // The satellites move by less than a metre in a millisecond.
    assert!(
        judged
            .epochs
            .iter()
            .rev()
            .take(50)
            .all(|e| e.horizontal_m() < 3.0)
    );
}

#[test]
fn jumps_and_gaps_of_the_samples_are_survived_and_reported() {
    for fault in [
        "{kind=\"clock_jump\",begin_s=50,size_s=-1e-4}",
        "{kind=\"dropped_samples\",begin_s=50,duration_s=0.0373}",
        // A whole number of code periods and bits: only the message tells.
        "{kind=\"dropped_samples\",begin_s=50,duration_s=0.1}",
    ] {
        let judged = with_fault(fault);
        let scalar = |k: &EventKind| {
            matches!(
                k,
                EventKind::ModeSwitched {
                    to: LoopMembership::Scalar
                }
            )
        };
        let vector = |k: &EventKind| {
            matches!(
                k,
                EventKind::ModeSwitched {
                    to: LoopMembership::Vector
                }
            )
        };
        let left_s = happened(&judged, 50.0, scalar).unwrap();
        // Two subframes later at most, a channel's message has told the time again.
        assert!(left_s < 62.0, "{fault}: {left_s} s");
        assert!(happened(&judged, left_s, vector).is_some(), "{fault}");
        // Snapshots between, good to their deviation.
        assert!(
            judged.epochs.iter().all(|e| e.horizontal_m() < 15.0),
            "{fault}"
        );
        assert!(judged.availability(90.0, 10.0) >= 0.99);
    }
}

#[test]
fn an_oscillator_with_much_white_noise_leads_no_channel_astray() {
    // At these times of week the message has its longest runs of equal bits: nothing tells where bits begin.
    for tow_s in [136_474, 280_456, 300_005, 300_017] {
        let start = format!("start={{week=2441,tow_s={tow_s}.0}}");
        let overrides = [
            &start,
            "duration_s=20.0",
            "clock={preset=\"csac\"}",
            "cn0={fixed_dbhz=48.0}",
            "receiver={assisted=true}",
        ];
        let judged = run(&scenario("static-open-sky", &overrides, Some(1)));
        assert!(judged.availability(20.0, 10.0) >= 0.99, "{tow_s}");
        let excluded = happened(&judged, 0.0, |k| matches!(k, EventKind::Excluded { .. }));
        assert_eq!(excluded, None, "{tow_s}");
        assert!(
            judged.epochs.iter().all(|e| e.horizontal_m() < 5.0),
            "{tow_s}"
        );
    }
}

#[test]
fn monitors_hear_nothing_before_time_is_exact() {
    let overrides = ["duration_s=6.0", "receiver={assisted=true}"];
    let judged = run(&scenario("static-open-sky", &overrides, Some(1)));
    let is_steered = |c: &&ChannelRecord| c.innovation_code_m.is_some();
    let began = judged.channels.iter().find(is_steered).unwrap().time_s;
    let heard = judged.channels.iter().find(|c| c.shown.is_some());
    let heard = heard.unwrap().time_s;
    // Before any bit boundary is known, and once most are.
    assert!(began < 0.3 && heard > 0.5, "{began} s, {heard} s");
    let early = judged.channels.iter().filter(|c| c.time_s < heard);
    assert!(early.clone().all(|c| c.scores.is_empty()));
    assert!(early.filter(is_steered).count() > 10);
    let late = judged.channels.iter().filter(|c| c.time_s > heard + 1.0);
    assert!(late.clone().all(|c| c.shown.is_some()));
    assert!(late.clone().count() > 100 && late.clone().all(|c| !c.scores.is_empty()));
}

#[test]
fn a_start_with_five_weak_satellites_does_not_run_away() {
    // Drawn at random; its first velocity is wrong by 16 m/s, which the second epoch finds.
    let series = Series {
        seed: 9,
        week: 2507,
    };
    let scenario = Plan::healthy(446, series, 8.0).scenario().unwrap();
    let judged = run(&scenario);
    let excluded = happened(&judged, 0.0, |k| matches!(k, EventKind::Excluded { .. }));
    assert_eq!(excluded, None);
    for epoch in judged.between(4.7, 8.0) {
        let (speed_mps, time_s) = (epoch.velocity_enu_mps.norm(), epoch.pvt.time_s);
        assert!(speed_mps < 1.0, "{speed_mps} m/s at {time_s}");
    }
}

#[test]
fn a_step_and_a_ramp_of_one_satellite_are_excluded() {
    for (fault, limit_s) in [
        ("{kind=\"step\",sat=\"G17\",begin_s=50,size_m=50}", 50.5),
        ("{kind=\"ramp\",sat=\"G17\",begin_s=50,rate_mps=2}", 65.0),
    ] {
        let judged = with_fault(fault);
        let excluded_s = happened(&judged, 0.0, |k| matches!(k, EventKind::Excluded { .. }));
        let excluded_s = excluded_s.unwrap();
        assert!(
            (50.0..limit_s).contains(&excluded_s),
            "{fault}: {excluded_s} s"
        );
        assert!(
            judged.epochs.iter().all(|e| e.horizontal_m() < 5.0),
            "{fault}"
        );
    }
}

#[test]
fn a_wrong_ephemeris_is_noticed_and_harmless() {
    // From the start, where the first fix leaves it out, and uploaded later, where the filter finds it.
    for (begin_s, latest_s) in [(0, 19.0), (40, 80.0)] {
        let fault =
            format!("{{kind=\"wrong_ephemeris\",sat=\"G12\",begin_s={begin_s},along_m=1000}}");
        let judged = with_fault(&fault);
        let excluded_s = happened(&judged, 0.0, |k| matches!(k, EventKind::Excluded { .. }));
        assert!(
            excluded_s.unwrap() < latest_s,
            "{begin_s}: {excluded_s:?} s"
        );
        for epoch in &judged.epochs {
            assert!(epoch.horizontal_m() < 5.0, "{begin_s}");
        }
    }
}

#[test]
fn what_an_excluded_satellite_said_is_taken_back() {
    let fault = "fault=[{kind=\"ramp\",sat=\"G17\",begin_s=50,rate_mps=2}]";
    let scenario = scenario("static-open-sky", &["duration_s=80", fault], None);
    let after_m = |hindsight_s| {
        let mut settings = vector(&scenario);
        let vector = settings.vector.as_mut().unwrap();
        vector.hindsight_s = hindsight_s;
        let judged = receive(&scenario, Level::Correlator, &settings).unwrap();
        let excluded_s = happened(&judged, 0.0, |k| matches!(k, EventKind::Excluded { .. }));
        let begin_s = excluded_s.unwrap();
        let errors = judged.between(begin_s, begin_s + 2.0);
        errors.map(JudgedEpoch::horizontal_m).fold(0.0, f64::max)
    };
    let (taken_back, kept) = (after_m(10.0), after_m(0.0));
    assert!(taken_back < 0.5 * kept, "{taken_back} and {kept} m");
}

#[test]
fn a_clock_that_has_run_off_tells_no_wrong_millisecond() {
    // Half a millisecond after 200 s; a satellite that was away is placed by prediction until its message is read again.
    let overrides = [
        "duration_s=250.0",
        "clock={preset=\"tcxo\",drift=2.5e-6}",
        "fault=[{kind=\"blocked\",sat=\"G17\",begin_s=220,end_s=235}]",
        "receiver={assisted=true}",
    ];
    let scenario = scenario("static-open-sky", &overrides, Some(1));
    let judged = receive(&scenario, Level::Correlator, &settings(&scenario)).unwrap();
    let excluded = happened(&judged, 235.0, |k| matches!(k, EventKind::Excluded { .. }));
    assert_eq!(excluded, None);
    let back =
        |c: &&ChannelRecord| c.satellite.prn == 17 && c.time_s > 235.0 && c.pseudorange_m.is_some();
    let back_s = judged.channels.iter().find(back).unwrap().time_s;
    assert!(back_s < 240.5, "{back_s} s");
}

/// The same orbit counted from a time `by_s` earlier.
fn aged(mut ephemeris: Ephemeris, by_s: f64) -> Ephemeris {
    let mean_motion = MU_M3_PER_S2.sqrt() / ephemeris.sqrt_a.powi(3) + ephemeris.delta_n_rad_s;
    ephemeris.toe = ephemeris.toe + -by_s;
    ephemeris.m0_rad -= mean_motion * by_s;
    ephemeris.omega0_rad -= ephemeris.omega_dot_rad_s * by_s;
    ephemeris.i0_rad -= ephemeris.idot_rad_s * by_s;
    ephemeris
}

#[test]
fn a_channel_whose_ephemeris_runs_out_keeps_its_signal_and_learns_the_next() {
    const RUNS_OUT_S: f64 = 10.0;
    let overrides = ["duration_s=30", "receiver={assisted=true}"];
    let scenario = scenario("static-open-sky", &overrides, None);
    let mut settings = vector(&scenario);
    let known = settings.aiding.ephemerides.iter_mut();
    for ephemeris in known.filter(|e| e.satellite.prn == 17) {
        let ends = ephemeris.toe + ephemeris.fit_interval_h() * 1800.0;
        let runs_out = scenario.truth.start + RUNS_OUT_S;
        *ephemeris = aged(*ephemeris, ends - runs_out);
    }
    let judged = receive(&scenario, Level::Correlator, &settings).unwrap();
    let between = |from_s: f64, to_s: f64| {
        let channels = judged.channels.iter();
        let of_17 = channels.filter(move |c| c.satellite.prn == 17);
        of_17.filter(move |c| (from_s..to_s).contains(&c.time_s))
    };
    let membership = |c: &ChannelRecord| c.tracking.as_ref().unwrap().membership;
    let steered = |c: &ChannelRecord| membership(c) == LoopMembership::Vector;
    assert!(between(RUNS_OUT_S - 2.0, RUNS_OUT_S).count() > 15);
    assert!(between(RUNS_OUT_S - 2.0, RUNS_OUT_S).all(steered));
    let alone: Vec<_> = between(RUNS_OUT_S + 0.2, 18.0).collect();
    assert!(alone.len() > 70, "{} epochs", alone.len());
    for channel in alone {
        let lock = channel.tracking.as_ref().unwrap().lock;
        assert!(!steered(channel) && lock == Lock::Carrier, "{channel:?}");
    }
    // Its message is read 18 s after the start, which is that of a frame.
    assert!(between(19.0, 30.0).count() > 100);
    assert!(between(19.0, 30.0).all(steered));
    assert!(judged.epochs.iter().all(|e| e.horizontal_m() < 5.0));
}

#[test]
fn a_first_velocity_that_is_worse_than_stated_leads_nobody_astray() {
    // Drawn at random; its first velocity errs by 13 m/s and is stated to 4.
    let series = Series {
        seed: 19,
        week: 2587,
    };
    let judged = run(&Plan::healthy(1357, series, 10.0).scenario().unwrap());
    for epoch in judged.between(2.0, 10.0) {
        let (error_m, time_s) = (epoch.position_enu_m.norm(), epoch.pvt.time_s);
        assert!(error_m < 5.0, "{error_m} m at {time_s}");
    }
}

#[test]
fn four_satellites_one_of_them_gone_make_no_position() {
    // Drawn at random, in scalar tracking throughout: what the loop finds in noise is no pseudorange.
    let series = Series {
        seed: 20,
        week: 2595,
    };
    let scenario = Plan::new(190, series).scenario().unwrap();
    let judged = run(&scenario);
    let told = judged
        .between(10.0, 32.0)
        .filter(|e| e.pvt.status != Status::Unreliable);
    assert!(told.clone().count() > 50);
    for epoch in told {
        assert!(epoch.horizontal_m() < 10.0, "{:?}", epoch.pvt);
    }
}
