//! What is claimed of the campaigns.

use anyhow::Result;

use super::calibrated::{Calibrated, STATED};
use super::performance::{Performance, delay_s, mean};
use super::real::{RealCase, RealStudy};
use super::setting::{ONSET, STEPS_M};
use super::simulate::Run;
use super::study::{Case, SEEDS, Study, case};
use crate::reproduce::Check;

/// The paper's threshold tau.
pub const THRESHOLD: f64 = 20.0;
/// Alarms of the paper's table 1, s.
pub const PAPER_ALARM_S: [[f64; 3]; 2] = [[518.0, 514.0, 509.0], [510.0, 505.0, 505.0]];
/// Effective particles of the paper's table 2.
pub const PAPER_EFFECTIVE: [[f64; 3]; 2] = [[42.1, 42.0, 42.8], [43.8, 44.7, 44.6]];
/// Largest distance of a median from table 1, s: the paper shows one run.
const TOLERANCE_S: f64 = 2.0;
/// Share of pairs of runs in which the swarm must be ahead.
const AHEAD: f64 = 0.95;
/// Longest median delays of the sound ratio, s, by step.
const SOUND_DELAY_S: [f64; 3] = [2.0, 1.0, 1.0];
/// Share of the steps on the recording that are to be found, and of these to be named.
const REAL_SHARE: f64 = 0.95;
/// Share of runs a statistic is set to alarm in falsely where statistics are compared.
pub const EQUAL_SHARE: f64 = 0.05;

/// Median time of the first alarm by the paper's ratio, s, by step.
#[must_use]
pub fn alarm_s(runs: &[Run]) -> [f64; 3] {
    let performance = Performance::new(runs, 0, THRESHOLD);
    performance.delay_median_s.map(|delay| ONSET as f64 + delay)
}

/// Mean effective particles, by step.
#[must_use]
pub fn effective(runs: &[Run]) -> [f64; 3] {
    [0, 1, 2].map(|step| mean(runs.iter().map(|run| run.steps[step].effective)))
}

/// Of the two orders of weighting and moving, the one whose alarms are closer to the paper's.
///
/// # Errors
/// Where a case is missing.
pub fn better_order(study: &Study) -> Result<&Case> {
    let orders = [
        case(&study.paper, "pso_weigh_move")?,
        case(&study.paper, "pso_move_weigh")?,
    ];
    let away = |case: &Case| {
        let pairs = alarm_s(&case.runs).into_iter().zip(PAPER_ALARM_S[1]);
        pairs
            .map(|(ours, paper)| (ours - paper).abs())
            .fold(0.0, f64::max)
    };
    let [first, second] = orders;
    Ok(if away(second) < away(first) {
        second
    } else {
        first
    })
}

/// All claims.
///
/// # Errors
/// Where a case is missing.
pub fn checks(study: &Study, calibrated: &Calibrated) -> Result<Vec<Check>> {
    let pf = case(&study.paper, "pf")?;
    let pso = better_order(study)?;
    let mut checks = tables(pf, pso);
    for case in [pf, pso] {
        checks.extend(sound(case));
    }
    checks.extend(heavy_tails(study)?);
    // Three binomial deviations of the runs that test, and of those that set the threshold.
    let runs = (SEEDS.end - SEEDS.start) as f64;
    let deviation = (STATED * (1.0 - STATED) * (1.0 / runs + 1.0 / 400.0)).sqrt();
    checks.push(Check::at_most(
        "correlated noise, calibrated threshold: false-alarm runs".to_owned(),
        calibrated.calibrated.false_alarm_runs,
        STATED + 3.0 * deviation,
        "",
    ));
    Ok(checks)
}

/// What is claimed of the recording: the filters at their own threshold, and at the one for the noise of
/// another day.
#[must_use]
pub fn on_real_data(real: &RealStudy) -> Vec<Check> {
    let mut checks = Vec::new();
    let filters = |case: &&RealCase| ["PF", "PSO-PF, corrected"].contains(&case.label.as_str());
    let both = [("", &real.own), (", threshold for 5 %", &real.stated)];
    for (which, cases) in both {
        for case in cases.iter().filter(filters) {
            let label = format!("recording, {}{which}", case.label);
            checks.push(Check::at_most(
                format!("{label}: clean records with a false alarm"),
                case.false_alarm_records,
                super::real::STATED,
                "",
            ));
            for (step_m, step) in STEPS_M.iter().zip(&case.steps) {
                let name = format!("{label}, {step_m} m: found steps rightly named");
                checks.push(Check::at_least(name, step.named, REAL_SHARE, ""));
                let name = format!("{label}, {step_m} m: steps found");
                checks.push(Check::at_least(name, step.detected, REAL_SHARE, ""));
            }
        }
    }
    checks
}

/// Both tables of the paper, and what it concludes from them.
fn tables(pf: &Case, pso: &Case) -> Vec<Check> {
    let mut checks = Vec::new();
    for ((case, name), paper) in [(pf, "PF"), (pso, "PSO-PF")].into_iter().zip(PAPER_ALARM_S) {
        for ((step_m, ours), paper) in STEPS_M.iter().zip(alarm_s(&case.runs)).zip(paper) {
            let name = format!("{name}, {step_m} m: median alarm");
            checks.push(Check::near(name, paper, ours, TOLERANCE_S, "s"));
        }
        let false_alarms = Performance::new(&case.runs, 0, THRESHOLD).false_alarm_runs;
        let name = format!("{name}: runs with an alarm before {ONSET} s");
        checks.push(Check::at_most(name, false_alarms, 0.0, ""));
    }
    for (step, step_m) in STEPS_M.iter().enumerate() {
        let pairs = || pf.runs.iter().zip(&pso.runs);
        let share = |ahead: &dyn Fn(&Run, &Run) -> bool| {
            let count = pairs().filter(|(pf, pso)| ahead(pf, pso)).count();
            count as f64 / pf.runs.len() as f64
        };
        let delay = |run: &Run| delay_s(run, 0, step, THRESHOLD);
        let earlier = share(&|pf, pso| delay(pso) < delay(pf));
        let more = share(&|pf, pso| pso.steps[step].effective > pf.steps[step].effective);
        let name = format!("{step_m} m: pairs in which PSO-PF alarms earlier");
        checks.push(Check::at_least(name, earlier, AHEAD, ""));
        let name = format!("{step_m} m: pairs in which PSO-PF has more effective particles");
        checks.push(Check::at_least(name, more, AHEAD, ""));
    }
    checks
}

/// The sound ratio in the paper's setting.
fn sound(case: &Case) -> Vec<Check> {
    let label = &case.label;
    let found = Performance::new(&case.runs, 1, THRESHOLD);
    let name = format!("sound ratio, {label}: false-alarm runs in 480 s");
    let mut checks = vec![Check::at_most(name, found.false_alarm_runs, 0.05, "")];
    for (step, step_m) in STEPS_M.iter().enumerate() {
        let name = format!("sound ratio, {label}, {step_m} m: runs detected and rightly named");
        let named = found.identified[step] * found.detected[step];
        checks.push(Check::at_least(name, named, 0.99, ""));
        let name = format!("sound ratio, {label}, {step_m} m: median delay");
        let delay_s = found.delay_median_s[step];
        checks.push(Check::at_most(name, delay_s, SOUND_DELAY_S[step], "s"));
    }
    checks
}

/// The mixture likelihood against the windowed GLR, both set to the same share of false alarms.
fn heavy_tails(study: &Study) -> Result<Vec<Check>> {
    let pf = case(&study.matched, "pf_mixture")?;
    let glr = case(&study.matched, "innovation_glr")?;
    let ours = Performance::at_false_alarm_share(&pf.runs, 1, EQUAL_SHARE);
    let theirs = Performance::at_false_alarm_share(&glr.runs, 0, EQUAL_SHARE);
    let mut checks = Vec::new();
    for (step, step_m) in STEPS_M.iter().enumerate() {
        let name = format!("heavy tails, {step_m} m, equal false alarms: median delay, GLR's");
        let (delay_s, limit_s) = (ours.delay_median_s[step], theirs.delay_median_s[step]);
        checks.push(Check::at_most(name, delay_s, limit_s, "s"));
        let error = |case: &Case| mean(case.runs.iter().map(|run| run.steps[step].error_m));
        let name = format!("heavy tails, {step_m} m, undetected: position error, the GLR filter's");
        checks.push(Check::at_most(name, error(pf), error(glr), "m"));
    }
    Ok(checks)
}
