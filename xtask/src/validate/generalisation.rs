//! What trained monitors make of what they have not learned from: a kind of fault, of motion, a clock.

use std::fmt;
use std::sync::Arc;

use anyhow::Result;
use fault_ml::learned::{Dataset, ModelKind, Sequence};
use fault_ml::metrics::Roc;

use crate::judged::in_parallel;
use crate::scenario::make::Level;
use crate::train::command::{plans, validation};
use crate::train::evaluate::windows;
use crate::train::fit::Recipe;
use crate::train::harvest::{Product, harvest};
use crate::train::plan::{KINDS, Motion, Plan, Series};
use crate::train::scoring::Examinee;

/// Steps of the windows that areas are found on.
const WINDOW: usize = 50;
/// Kinds that trained models are of.
const MODELS: [ModelKind; 2] = [ModelKind::Lstm, ModelKind::Svm];

/// What is left out of a training, and tested on.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// Nothing is left out.
    Nothing,
    Fault(&'static str),
    Motion(Motion),
    Clock(&'static str),
}

impl Part {
    fn all() -> Vec<Self> {
        let faults = KINDS.into_iter().take_while(|kind| *kind != "none");
        let mut parts = vec![Self::Nothing];
        parts.extend(faults.map(Self::Fault));
        parts.extend([Motion::Drive, Motion::Straight].map(Self::Motion));
        parts.push(Self::Clock("csac"));
        parts
    }

    fn holds(self, plan: &Plan) -> bool {
        match self {
            Self::Nothing => false,
            Self::Fault(kind) => plan.kind == kind,
            Self::Motion(motion) => plan.motion == motion,
            Self::Clock(clock) => plan.clock == clock,
        }
    }

    /// The sequences of `data`, a harvest of `series`, that belong to the part, or do not.
    fn of(self, data: &Dataset, series: Series, belongs: bool) -> Dataset {
        let keep = |s: &&Sequence| self.holds(&Plan::new(s.scenario, series)) == belongs;
        Dataset {
            sequences: data.sequences.iter().filter(keep).cloned().collect(),
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => write!(f, "nothing"),
            Self::Fault(kind) => write!(f, "{kind}"),
            Self::Motion(Motion::Drive) => write!(f, "driving"),
            Self::Motion(motion) => write!(f, "{motion:?}"),
            Self::Clock(clock) => write!(f, "clock {clock}"),
        }
    }
}

/// A part, and the areas under the ROC on it, by model: learned from everything, and from everything else.
#[derive(Debug, Clone)]
struct Row {
    part: Part,
    areas: Vec<[f64; 2]>,
}

/// Every part.
#[derive(Debug, Clone)]
pub struct Table {
    rows: Vec<Row>,
    runs: u32,
}

/// Trains both kinds of model on `runs` scenarios, once for each part without it, and tests them on it in as many
/// others.
///
/// # Errors
/// Where a run or a training fails.
pub fn table(runs: u32) -> Result<Table> {
    let of = |plans: &[Plan]| harvest(plans, Level::Correlator, &Product);
    let training = of(&plans(Series::TRAINING, runs))?;
    let held_out = of(&validation(runs))?;
    let test = of(&plans(Series::GENERALISATION, runs))?;
    let parts = Part::all();
    let trainings = in_parallel(parts.len() * MODELS.len(), |number| {
        let (part, kind) = (parts[number / MODELS.len()], MODELS[number % MODELS.len()]);
        let without = |data, series| part.of(data, series, false);
        let lessons = without(&training, Series::TRAINING);
        let checks = without(&held_out, Series::VALIDATION);
        let model = Recipe::product(kind).fit(&lessons, &checks)?;
        Ok(Examinee::Learned(Arc::new(model)))
    })?;
    let (whole, partial) = trainings.split_at(MODELS.len());
    let tested = parts.iter().skip(1).zip(partial.chunks(MODELS.len()));
    let row = |(part, models): (&Part, &[Examinee])| {
        let test = part.of(&test, Series::GENERALISATION, true);
        let area = |examinee: &Examinee| area(examinee, &test);
        let pairs = whole.iter().zip(models);
        let areas = pairs.map(|(all, without)| Ok([area(all)?, area(without)?]));
        Ok(Row {
            part: *part,
            areas: areas.collect::<Result<_>>()?,
        })
    };
    Ok(Table {
        rows: tested.map(row).collect::<Result<_>>()?,
        runs,
    })
}

fn area(examinee: &Examinee, test: &Dataset) -> Result<f64> {
    let scores = examinee.all_scores(test)?;
    let scored: Vec<(f64, bool)> = windows(test, &scores, WINDOW).collect();
    Ok(Roc::new(&scored).map_or(f64::NAN, |roc| roc.area()))
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} scenarios to learn from, as many to test on; area under the ROC of a single decision\n\n| left out and tested on |",
            self.runs
        )?;
        for kind in MODELS {
            let name = kind.name();
            write!(f, " {name}, learned with | {name}, without |")?;
        }
        writeln!(f, "\n|---|{}", "---|---|".repeat(MODELS.len()))?;
        for row in &self.rows {
            write!(f, "| {} |", row.part)?;
            for [with, without] in &row.areas {
                write!(f, " {with:.3} | {without:.3} |")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_and_the_rest_are_the_whole() {
        let sequence = |scenario| Sequence {
            scenario,
            fault: String::new(),
            steps: Vec::new(),
        };
        let data = Dataset {
            sequences: (0..60).map(sequence).collect(),
        };
        for part in Part::all() {
            let count = |belongs| part.of(&data, Series::TRAINING, belongs).sequences.len();
            assert_eq!(count(true) + count(false), 60);
            assert_eq!(count(true) == 0, matches!(part, Part::Nothing), "{part}");
        }
    }
}
