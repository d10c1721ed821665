//! Many runs of a receiver, and what its monitors would have seen in them.

use anyhow::Result;
use fault_ml::learned::Dataset;
use receiver::pipeline::{Settings, VectorSettings};

use super::label::labelled;
use super::plan::Plan;
use crate::judged;
use crate::scenario::built::Scenario;
use crate::scenario::make::Level;

/// A receiver to learn from.
pub trait Pupil: Sync {
    /// Its settings for `scenario`; every update of its filter is to be reported.
    fn settings(&self, scenario: &Scenario) -> Settings;
}

/// The receiver as it comes: updates 50 times a second, the innovation test excluding what it finds, so that
/// one faulty channel does not spoil the others. What the filter took in before an alarm it keeps: a monitor learns
/// what comes before its own.
#[derive(Debug, Clone, Copy)]
pub struct Product;

impl Pupil for Product {
    fn settings(&self, scenario: &Scenario) -> Settings {
        let vector = VectorSettings {
            hindsight_s: 0.0,
            ..VectorSettings::default()
        };
        Settings {
            rate_hz: 1.0 / vector.interval_s,
            vector: Some(vector),
            ..judged::settings(scenario)
        }
    }
}

/// The same without a monitor: as it is for every monitor until its first alarm.
#[derive(Debug, Clone, Copy)]
pub struct Unwatched;

impl Pupil for Unwatched {
    fn settings(&self, scenario: &Scenario) -> Settings {
        let watched = Product.settings(scenario);
        let vector = watched.vector.map(|vector| VectorSettings {
            monitor: None,
            ..vector
        });
        Settings { vector, ..watched }
    }
}

/// Labelled steps of `plans`, each received by `pupil` at `level`.
///
/// # Errors
/// Where a scenario cannot be made or a run fails.
pub fn harvest(plans: &[Plan], level: Level, pupil: &impl Pupil) -> Result<Dataset> {
    let all = judged::in_parallel(plans.len(), |number| steps(&plans[number], level, pupil))?;
    let mut data = Dataset::default();
    for part in all {
        data.sequences.extend(part.sequences);
    }
    Ok(data)
}

/// Labelled steps of one run.
///
/// # Errors
/// As [`harvest`].
pub fn steps(plan: &Plan, level: Level, pupil: &impl Pupil) -> Result<Dataset> {
    let mut data = labelled_steps(&plan.scenario()?, plan.number, level, pupil)?;
    for sequence in data.sequences.iter_mut().filter(|s| !s.fault.is_empty()) {
        sequence.fault += plan.severity.suffix();
    }
    Ok(data)
}

/// Labelled steps of `scenario`, which has a `number` among others.
///
/// # Errors
/// Where the signal cannot be made or the receiver fails.
pub fn labelled_steps(
    scenario: &Scenario,
    number: u32,
    level: Level,
    pupil: &impl Pupil,
) -> Result<Dataset> {
    let judged = judged::receive(scenario, level, &pupil.settings(scenario))?;
    let elapsed_s = |time_s| scenario.elapsed_s(time_s);
    Ok(labelled(
        number,
        &judged.channels,
        &scenario.accounts,
        elapsed_s,
    ))
}
