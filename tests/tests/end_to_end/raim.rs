//! Integrity monitoring in `run`: a step of one range of a car in turns, at the correlator level.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::path::Path;

use gnss_nav::SatelliteId;
use gnss_nav::integrity::IntegritySettings;
use receiver::pipeline::Settings;
use receiver::raim::Raim;
use receiver::record::EventKind;
use xtask::judged::{Judged, receive, settings};
use xtask::scenario::built::Scenario;
use xtask::scenario::make::Level;
use xtask::scenario::spec::ScenarioFile;

/// When the step begins, s, and its size, m.
const ONSET_S: f64 = 75.0;
const STEP_M: f64 = 40.0;

fn car(fault: &str) -> Scenario {
    let text = include_str!("../../../assets/scenarios/vehicle-turns.toml");
    let text = format!("{text}\n{fault}");
    let file = ScenarioFile::parse("car", "car", Path::new(""), text).unwrap();
    let mut scenario = Scenario::new(&file, None).unwrap();
    // Without the ionosphere's parameters a range is good to 17 m, and 40 m are nothing to it.
    scenario.receiver.assisted = true;
    scenario
}

fn run(scenario: &Scenario, raim: Raim) -> Judged {
    let settings = Settings {
        raim,
        ..settings(scenario)
    };
    receive(scenario, Level::Correlator, &settings).unwrap()
}

/// Satellites left out, when, by whom.
fn exclusions(judged: &Judged) -> Vec<(f64, Option<SatelliteId>, String)> {
    let events = judged.events.iter();
    events
        .filter_map(|event| match &event.kind {
            EventKind::Excluded { monitor, .. } => {
                Some((event.time_s, event.satellite, monitor.clone()))
            }
            _ => None,
        })
        .collect()
}

#[test]
fn a_step_is_named_by_every_monitor_while_a_car_turns() {
    let tested = IntegritySettings::default();
    let whole = car("");
    let satellite = whole.heard[2].broadcast.satellite;
    let fault = format!(
        "[[fault]]\nkind = \"step\"\nsat = \"{satellite}\"\nbegin_s = {ONSET_S}\nsize_m = {STEP_M}\n"
    );
    let stepped = car(&fault);
    for (raim, monitor) in [
        (Raim::LeastSquares(tested), "parity"),
        (Raim::LikelihoodRatio(tested), "glr"),
        (Raim::Particles, "pf"),
        (Raim::Swarm, "pso-pf"),
    ] {
        let clean = exclusions(&run(&whole, raim));
        assert!(clean.is_empty(), "{monitor}: {clean:?}");
        let judged = run(&stepped, raim);
        let found = exclusions(&judged);
        let (time_s, named, by) = found.first().unwrap();
        assert_eq!(*named, Some(satellite), "{monitor}: {found:?}");
        // With the ratio over a window the residuals of an epoch are tested, too.
        assert!(by == monitor || monitor == "glr", "{monitor}: {found:?}");
        // The code loop takes a second, and the monitor an epoch a second.
        assert!(
            (ONSET_S..ONSET_S + 5.0).contains(time_s),
            "{monitor}: {found:?}"
        );
        let others = found.iter().filter(|(_, sat, _)| *sat != Some(satellite));
        assert_eq!(others.count(), 0, "{monitor}: {found:?}");
        // What it did before it was found was within metres.
        let after = judged.between(ONSET_S + 6.0, 100.0);
        let worst_m = after.map(|e| e.position_enu_m.norm()).fold(0.0, f64::max);
        assert!(worst_m < 15.0, "{monitor}: {worst_m} m");
    }
}
