//! What the paper's numbers do not show, each statement with the numbers that prove it.

use std::fmt::Write as _;

use anyhow::Result;

use super::checks::{EQUAL_SHARE, THRESHOLD, effective};
use super::performance::Performance;
use super::report::{clean_rms_m, spread_m, three, undetected_m};
use super::study::{Case, Study, case};

/// The section of the report.
///
/// # Errors
/// Where a case is missing.
pub(super) fn explanations(study: &Study) -> Result<String> {
    let mut text = String::from("## What the numbers of the paper do not show\n\n");
    for statement in [
        why_more_particles(study)?,
        what_becomes_of_accuracy(study)?,
        what_correction_does(study)?,
        why_earlier(study)?,
        who_is_named(study)?,
        what_the_density_buys(study)?,
    ] {
        let _ = writeln!(text, "- {statement}");
    }
    text += "\n";
    Ok(text)
}

fn equal(case: &Case, statistic: usize) -> String {
    let found = Performance::at_false_alarm_share(&case.runs, statistic, EQUAL_SHARE);
    three(found.delay_median_s, 1)
}

fn why_more_particles(study: &Study) -> Result<String> {
    let (pf, pso) = (
        case(&study.paper, "pf")?,
        case(&study.paper, "pso_weigh_move")?,
    );
    Ok(format!(
        "**Why the swarm raises the effective number.** It draws the cloud together: the main cloud is {:.2} m wide with the swarm, {:.2} m \
         without, where {:.2} m is what the measurements leave open (corrected cloud). Particles that all stand in one place have nearly equal \
         weights, so that N_eff goes from {:.1} to {:.1}: it measures how alike the weights are, not how well the cloud stands for the posterior.",
        spread_m(pso),
        spread_m(pf),
        spread_m(case(&study.paper, "pso_corrected")?),
        effective(&pf.runs)[0],
        effective(&pso.runs)[0],
    ))
}

fn what_becomes_of_accuracy(study: &Study) -> Result<String> {
    let rms = |key: &str| case(&study.paper, key).map(clean_rms_m);
    Ok(format!(
        "**What happens to accuracy without importance correction.** The swarm climbs to the most likely state of the current epoch and forgets the \
         past: rms error {:.2} m (weights, then move) and {:.2} m (move, then weights) against {:.2} m of the plain particle filter, {:.2} m of a \
         Kalman filter and {:.2} m of least squares of one epoch, which is what a hard swarm turns the filter into.",
        rms("pso_weigh_move")?,
        rms("pso_move_weigh")?,
        rms("pf")?,
        rms("innovation_glr")?,
        rms("parity_glr")?,
    ))
}

fn what_correction_does(study: &Study) -> Result<String> {
    let corrected = case(&study.paper, "pso_corrected")?;
    let delays = |case: &Case| three(Performance::new(&case.runs, 0, THRESHOLD).delay_median_s, 1);
    Ok(format!(
        "**The swarm as a proposal.** Weights cannot be put right after the move itself: the density of where a swarm ends is not known, and a normal \
         law fitted to the collapsed swarm is far too narrow. Where the swarm only finds the mode of likelihood x prior, and particles are drawn about it \
         with the curvature there and weighted by target over proposal, N_eff is {:.1} with an rms error of {:.2} m; the delays of the paper's ratio \
         are then {} s: those of the Kalman bank, {} s, whose posterior it should have. Its prior is a normal law of the last cloud's moments.",
        effective(&corrected.runs)[0],
        clean_rms_m(corrected),
        delays(corrected),
        delays(case(&study.paper, "kalman_bank")?),
    ))
}

fn why_earlier(study: &Study) -> Result<String> {
    let delays = |key: &str, statistic| case(&study.paper, key).map(|c| equal(c, statistic));
    Ok(format!(
        "**Why the swarm alarms earlier.** The paper's ratio reacts when the main filter has followed the fault; a filter without memory follows at once. \
         With the sound ratio and thresholds of equal false alarms ({} % of runs) nothing is left of it: PF {} s, PSO-PF {} s, Kalman bank {} s, windowed \
         GLR on the innovations of one Kalman filter {} s.",
        100.0 * EQUAL_SHARE,
        delays("pf", 1)?,
        delays("pso_weigh_move", 1)?,
        delays("kalman_bank", 1)?,
        delays("innovation_glr", 0)?,
    ))
}

fn who_is_named(study: &Study) -> Result<String> {
    let pf = case(&study.paper, "pf")?;
    let named = |statistic| {
        let found = Performance::new(&pf.runs, statistic, THRESHOLD);
        three(found.identified.map(|share| 100.0 * share), 0)
    };
    Ok(format!(
        "**Who is named.** In the paper's ratio each satellite's sum explains other data, and the largest is no comparison of hypotheses: PF names the \
         right satellite in {} % of alarms, with the sound ratio in {} %. Decisions rest on the sound one.",
        named(0),
        named(1),
    ))
}

fn what_the_density_buys(study: &Study) -> Result<String> {
    let [gaussian, mixture, glr] =
        ["pf_gaussian", "pf_mixture", "innovation_glr"].map(|key| case(&study.matched, key));
    let (gaussian, mixture, glr) = (gaussian?, mixture?, glr?);
    let false_alarms =
        |case: &Case| 100.0 * Performance::new(&case.runs, 1, THRESHOLD).false_alarm_runs;
    Ok(format!(
        "**What particles are good for.** Nothing in the paper's setting needs them: with its Gaussian fitness a Kalman bank gives the same ratios. Under \
         heavy tails of the assumed deviation the true density does: false alarms of the sound ratio at 20 fall from {:.0} % to {:.0} % of runs, at equal \
         false alarms delays are {} s against {} s of the GLR, and an undetected step leaves {} m of error instead of {} m.",
        false_alarms(gaussian),
        false_alarms(mixture),
        equal(mixture, 1),
        equal(glr, 0),
        three(undetected_m(mixture), 1),
        three(undetected_m(glr), 1),
    ))
}
