//! What is claimed of the runs.

use super::receivers::place;
use super::study::Study;
use crate::reproduce::Check;

/// How far below single points the paper finds the velocity error, and what is asked here, %.
pub const PAPER_PERCENT: f64 = 50.0;
/// What is aimed at, %.
pub const GOAL_PERCENT: f64 = 80.0;
/// Largest error under the overpass, m.
const OVERPASS_M: f64 = 5.0;
/// Positions of both filters differ by rounding, which feedback through thousands of updates repeats, m.
const SAME_M: f64 = 1e-4;
/// What theory may be off by: C/N0 that turns with the road and falls behind signs, the acceleration that
/// the filter sees in its own velocities.
const UNEXPLAINED: f64 = 0.2;
/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// How far the velocity error of `receiver` lies below that of `baseline`, along x, y and z, %.
#[must_use]
pub fn below_percent(study: &Study, receiver: usize, baseline: usize) -> [f64; 3] {
    let (ours, theirs) = (study.velocity_mps(receiver), study.velocity_mps(baseline));
    [0, 1, 2].map(|axis| 100.0 * (1.0 - ours[axis] / theirs[axis]))
}

/// Velocity error of `receiver` over what theory says noise leaves of it, x, y and z.
#[must_use]
pub fn explained(study: &Study, receiver: usize, theory_mps: [f64; 3]) -> [f64; 3] {
    let measured = study.velocity_mps(receiver);
    [0, 1, 2].map(|axis| measured[axis] / theory_mps[axis])
}

/// All claims.
#[must_use]
pub fn checks(study: &Study) -> Vec<Check> {
    let mut checks = velocity(study);
    checks.extend(position(study));
    checks.extend(continuity(study));
    let apart_m = study.apart_m(place::PRODUCT, place::BATCH);
    let same = "distance of the positions of batch and sequential filter, largest".to_owned();
    checks.push(Check::at_most(same, apart_m, SAME_M, "m"));
    checks.extend(theory(study));
    checks
}

fn theory(study: &Study) -> Vec<Check> {
    let theory = &study.theory;
    let noise_mps = theory.ladder.filter_noise_mps;
    let all = [
        (
            "single points, FLL",
            place::FREQUENCY_LOOPS,
            theory.loops_mps,
        ),
        ("product", place::PRODUCT, theory.product_mps),
        ("discriminators alone", place::DISCRIMINATORS, noise_mps),
    ];
    let claim = |(name, receiver, theory_mps)| {
        let off = explained(study, receiver, theory_mps).map(|ratio| (ratio - 1.0).abs());
        let worst = off.into_iter().fold(0.0, f64::max);
        let name = format!("{name}: velocity error over theory's, off one by");
        Check::at_most(name, worst, UNEXPLAINED, "")
    };
    all.into_iter().map(claim).collect()
}

fn velocity(study: &Study) -> Vec<Check> {
    let below = below_percent(study, place::PRODUCT, place::FREQUENCY_LOOPS);
    let name = |axis: &str| {
        format!(
            "velocity error in {axis} below single points of loops of the same integration and bandwidth by"
        )
    };
    let claim = |(axis, percent): (&&str, f64)| Check {
        paper: Some(PAPER_PERCENT),
        ..Check::at_least(name(axis), percent, PAPER_PERCENT, "%")
    };
    AXES.iter().zip(below).map(claim).collect()
}

fn position(study: &Study) -> Vec<Check> {
    let baselines = [(place::FREQUENCY_LOOPS, "FLL"), (place::PHASE_LOOPS, "PLL")];
    let of = |(baseline, name): (usize, &str)| {
        let error = study.position_m(place::PRODUCT) / study.position_m(baseline);
        let change = study.roughness_m(place::PRODUCT) / study.roughness_m(baseline);
        [
            Check::at_most(
                format!("position error over that of single points ({name})"),
                error,
                1.0,
                "",
            ),
            Check::at_most(
                format!("its change from epoch to epoch over that of single points ({name})"),
                change,
                1.0,
                "",
            ),
        ]
    };
    baselines.into_iter().flat_map(of).collect()
}

fn continuity(study: &Study) -> Vec<Check> {
    let modes = || place::PRODUCT..place::NO_MEMORY;
    let available = modes().map(|k| study.availability(k)).fold(1.0, f64::min);
    let worst_m = modes().map(|k| study.overpass_m(k)).fold(0.0, f64::max);
    vec![
        Check::at_least(
            "epochs with a solution, every mode of the vector receiver".to_owned(),
            available,
            1.0,
            "",
        ),
        Check::at_most(
            "largest error under the overpass, product".to_owned(),
            study.overpass_m(place::PRODUCT),
            OVERPASS_M,
            "m",
        ),
        Check::at_most(
            "largest error under the overpass, every mode".to_owned(),
            worst_m,
            OVERPASS_M,
            "m",
        ),
    ]
}
