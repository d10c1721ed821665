//! What is claimed of the runs.

use super::receivers::Variant;
use super::study::{Blockage, Case, Run, Study};
use crate::order::median;
use crate::reproduce::Check;

/// Error that the paper's receiver must exceed without detection, m.
const LOST_M: f64 = 50.0;
/// Largest error with detection, m, and the goal.
const HELD_M: f64 = 3.0;
/// What is aimed at, m.
pub const GOAL_M: f64 = 1.0;
/// Longest time from the blockage to the alarm, s.
const ALARM_S: f64 = 0.1;

/// Largest.
#[must_use]
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, f64::max)
}

/// Time from the blockage to the alarm, s: the monitor's, or the channel's that its signal is gone.
#[must_use]
pub fn alarm_delay_s(run: &Run, begin_s: f64) -> f64 {
    let noticed = [run.excluded_s, run.lost_s].into_iter().flatten();
    noticed.fold(f64::INFINITY, f64::min) - begin_s
}

/// All claims.
#[must_use]
pub fn checks(study: &Study) -> Vec<Check> {
    let mut checks: Vec<Check> = study.cases.iter().flat_map(of_scenario).collect();
    for watched in &study.learned {
        let runs: Vec<&Run> = watched.runs.iter().collect();
        checks.extend(with_exclusion(&watched.blockage, watched.label, &runs));
    }
    checks
}

fn of_scenario(case: &Case) -> Vec<Check> {
    let number = case.blockage.number;
    let after = |variant| case.runs(variant).map(|run| run.after_m);
    let mut checks = vec![Check::at_least(
        format!(
            "scenario {number}, paper baseline: median of the largest error after the blockage"
        ),
        median(after(Variant::Paper)),
        LOST_M,
        "m",
    )];
    for variant in Variant::ALL.into_iter().filter(|v| v.excludes()) {
        let runs: Vec<&Run> = case.runs(variant).collect();
        checks.extend(with_exclusion(&case.blockage, variant.label(), &runs));
    }
    checks
}

fn with_exclusion(blockage: &Blockage, label: &str, runs: &[&Run]) -> [Check; 4] {
    let name = |what: &str| format!("scenario {}, {label}: {what}", blockage.number);
    let runs = || runs.iter().copied();
    let worst_m = largest(runs().map(Run::largest_m));
    let held = Check::at_most(name("largest error of any run"), worst_m, HELD_M, "m");
    let delay_s = largest(runs().map(|run| alarm_delay_s(run, blockage.begin_s)));
    let early = runs().map(|run| run.excluded_before as f64).sum();
    let available = runs().map(|run| run.availability).fold(1.0, f64::min);
    [
        Check {
            paper: Some(blockage.paper_m),
            ..held
        },
        Check::at_most(
            name("latest alarm after the blockage"),
            delay_s,
            ALARM_S,
            "s",
        ),
        Check::at_most(name("exclusions before the blockage"), early, 0.0, ""),
        Check::at_least(name("epochs with a solution"), available, 0.99, ""),
    ]
}
