//! What the monitors of a channel find and what they cry wolf at, all at the same rate of false alarms.

pub mod consequence;
mod curves;

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use fault_ml::InnovationTest;
use fault_ml::learned::{LearnedModel, ModelKind, OperatingPoint};
use fault_ml::metrics::RateInterval;
use receiver::pipeline::VectorSettings;
use serde_json::json;

use self::consequence::{Consequence, Watch, consequences, stanford};
use super::verdict;
use crate::scenario::make::Level;
use crate::train::command::{RUNS, plans, read_model, validation, write_model};
use crate::train::evaluate::{Examination, Examined, examine};
use crate::train::fit::{FALSE_ALARMS_PER_HOUR, unbounded};
use crate::train::harvest::{Product, Unwatched, harvest};
use crate::train::plan::Series;
use crate::train::quiet::{self, Peak};
use crate::train::scoring::Examinee;

/// Time between two steps, s.
const INTERVAL_S: f64 = 0.02;
/// Steps of the windows that areas are found on.
const WINDOW: usize = 50;
/// Channel-hours in which a rate of 0.01 an hour shows: ten false alarms.
const LEAST_CHANNEL_HOURS: f64 = 1000.0;
/// Channel-hours that thresholds are found on, for each that false alarms are counted in.
const FOUND_BY_SHARE: f64 = 0.75;
/// Channels with false alarms that are named.
const ALARMED_NAMED: usize = 10;
/// What thresholds are found for of the stated rate: by the handful of alarms due in those hours a rate is known to a
/// factor of two.
const FOUND_FOR_SHARE: f64 = 0.5;

/// One monitor.
#[derive(Debug, Clone)]
struct Subject {
    name: &'static str,
    examinee: Examinee,
    /// What it was trained as; absent: not at all.
    model: Option<LearnedModel>,
}

/// One monitor's figures.
#[derive(Debug, Clone)]
pub struct Row {
    /// What it finds.
    pub examination: Examination,
    /// Its threshold, from some of the healthy channels.
    pub point: OperatingPoint,
    /// Its false alarms in the others.
    pub false_alarms: RateInterval,
    /// Channels that they came from, the worst first.
    pub alarmed: Vec<Peak>,
    /// The model with that threshold.
    model: Option<LearnedModel>,
}

/// Every monitor.
#[derive(Debug, Clone)]
pub struct Table {
    /// The innovation test, then those that are trained.
    pub rows: Vec<Row>,
    /// What faults do to the position, by who watches.
    pub consequences: Vec<Consequence>,
    /// The threshold that theory gives the innovation test, and its false alarms there.
    by_theory: (f64, RateInterval),
    scenarios: u32,
}

/// The innovation test as the receiver has it.
fn innovation_test() -> Result<InnovationTest> {
    let settings = VectorSettings::default().monitor;
    Ok(InnovationTest::new(
        settings.context("no innovation test")?,
    )?)
}

fn subjects(models: &Path, test: InnovationTest) -> Result<Vec<Subject>> {
    let mut subjects = vec![Subject {
        name: "innovation",
        examinee: Examinee::Innovation(test),
        model: None,
    }];
    for kind in [ModelKind::Svm, ModelKind::Lstm] {
        let model = read_model(kind, models)?;
        let free = unbounded(&model, model.card().evidence)?;
        subjects.push(Subject {
            name: kind.name(),
            examinee: Examinee::Learned(Arc::new(free)),
            model: Some(model),
        });
    }
    Ok(subjects)
}

/// Examines the innovation test and the models in `models`: false alarms in `channel_hours` healthy channel-hours at
/// thresholds that 0.75 times as many others give; everything else from `scenarios` scenarios that nothing was chosen by.
///
/// # Errors
/// Where a model cannot be read or a run fails.
pub fn table(models: &Path, channel_hours: f64, scenarios: u32) -> Result<Table> {
    let test = innovation_test()?;
    let theory = test.threshold();
    let subjects = subjects(models, test)?;
    let examinees: Vec<Examinee> = subjects.iter().map(|s| s.examinee.clone()).collect();
    let found_in = quiet::runs(FOUND_BY_SHARE * channel_hours);
    let counted_in = found_in..found_in + quiet::runs(channel_hours);
    let found_by = quiet::scores(Series::HEALTHY, 0..found_in, &examinees, INTERVAL_S)?;
    let counted_by = quiet::scores(Series::HEALTHY, counted_in, &examinees, INTERVAL_S)?;
    let held_out = harvest(&validation(RUNS), Level::Correlator, &Product)?;
    let tests = plans(Series::TEST, scenarios);
    let watched = harvest(&tests, Level::Correlator, &Product)?;
    let unwatched = harvest(&tests, Level::Correlator, &Unwatched)?;
    let examined = Examined {
        validation: &held_out,
        watched: &watched,
        unwatched: &unwatched,
    };
    let tested = counted_by.first().context("nothing was counted")?;
    let by_theory = (theory, tested.scores.rate(theory));
    let mut rows = Vec::new();
    for ((subject, found), counted) in subjects.into_iter().zip(found_by).zip(counted_by) {
        let point = found
            .scores
            .operating_point(FOUND_FOR_SHARE * FALSE_ALARMS_PER_HOUR)?;
        let model = subject.model.map(|model| {
            let mut card = model.card().clone();
            card.operating_point = point;
            model.with_card(card)
        });
        let model = model.transpose()?;
        let examinee = match &model {
            Some(model) => Examinee::Learned(Arc::new(model.clone())),
            None => subject.examinee,
        };
        rows.push(Row {
            examination: examine(subject.name, &examinee, examined, WINDOW, point.threshold)?,
            point,
            false_alarms: counted.scores.rate(point.threshold),
            alarmed: counted.above(point.threshold),
            model,
        });
    }
    let consequences = consequences(&tests, &watches(&rows))?;
    Ok(Table {
        rows,
        consequences,
        by_theory,
        scenarios,
    })
}

/// Nobody, every monitor alone, and the sooner ones together.
fn watches(rows: &[Row]) -> Vec<Watch> {
    let model = |name: &str| {
        let row = rows.iter().find(|row| row.examination.name == name);
        row.and_then(|row| row.model.clone()).map(Arc::new)
    };
    let watch = |label, innovation, shape, learned: &[&str]| Watch {
        label,
        innovation,
        shape,
        learned: learned.iter().filter_map(|name| model(name)).collect(),
    };
    vec![
        watch("nobody", false, false, &[]),
        watch("innovation", true, false, &[]),
        watch("svm", false, false, &["svm"]),
        watch("lstm", false, false, &["lstm"]),
        watch("ewma", false, true, &[]),
        watch("innovation, lstm", true, false, &["lstm"]),
        watch("innovation, lstm, ewma", true, true, &["lstm"]),
    ]
}

impl Table {
    /// Writes the models with their thresholds, and what was found of them in their cards.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write(&self, models: &Path) -> Result<()> {
        let figures: BTreeMap<&str, _> = self
            .rows
            .iter()
            .map(|row| (row.examination.name.as_str(), row.figures()))
            .collect();
        for model in self.rows.iter().filter_map(|row| row.model.as_ref()) {
            let mut card = model.card().clone();
            card.training["test"] = json!({
                "seed": Series::TEST.seed, "week": Series::TEST.week, "scenarios": self.scenarios,
                "healthy": { "seed": Series::HEALTHY.seed, "week": Series::HEALTHY.week },
                "monitors": figures,
            });
            write_model(&model.clone().with_card(card)?, models)?;
        }
        Ok(())
    }

    /// Writes ROC, delays, Stanford plots and all figures into `folder`.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn draw(&self, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let monitors: BTreeMap<&str, _> = self
            .rows
            .iter()
            .map(|row| (row.examination.name.as_str(), row.figures()))
            .collect();
        let flown: BTreeMap<&str, _> = self
            .consequences
            .iter()
            .map(|c| (c.label, c.figures()))
            .collect();
        let figures = json!({ "monitors": monitors, "flown": flown });
        for (name, text) in [
            ("roc.svg", curves::roc(&self.rows)?),
            ("delays.svg", curves::delays(&self.rows)?),
            ("stanford.svg", stanford(&self.consequences)?),
            ("monitors.json", format!("{figures:#}\n")),
        ] {
            let path = folder.join(name);
            fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }

    /// Whether no monitor alarmed more often than the stated rate, in enough hours to tell.
    #[must_use]
    pub fn holds(&self) -> bool {
        let keeps = |row: &Row| row.false_alarms.per_hour <= FALSE_ALARMS_PER_HOUR;
        self.has_enough_hours() && self.rows.iter().all(keeps)
    }

    /// Whether false alarms were counted long enough to be seen at the stated rate.
    fn has_enough_hours(&self) -> bool {
        let enough = |row: &Row| row.false_alarms.hours >= LEAST_CHANNEL_HOURS;
        self.rows.iter().all(enough)
    }
}

impl Row {
    fn figures(&self) -> serde_json::Value {
        let mut figures = self.examination.figures();
        figures["threshold_from_channel_hours"] = json!(self.point.channel_hours);
        figures["false_alarms"] = json!(self.false_alarms.events);
        let alarmed = self.alarmed.iter().map(Peak::to_string);
        figures["false_alarms_of"] = json!(alarmed.collect::<Vec<_>>());
        figures["false_alarms_in_channel_hours"] = json!(self.false_alarms.hours);
        figures["false_alarms_per_hour"] = json!(self.false_alarms.per_hour);
        figures["false_alarms_per_hour_95"] =
            json!([self.false_alarms.low, self.false_alarms.high]);
        figures
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} scenarios; thresholds for {FALSE_ALARMS_PER_HOUR} false alarms a channel and hour, found for {FOUND_FOR_SHARE} of it\n\n\
             | monitor | threshold, from channel-hours | false alarms in others: an hour (95 %) | area under the ROC (95 %) | balanced accuracy, all / steady | faults found |\n\
             |---|---|---|---|---|---|",
            self.scenarios
        )?;
        for row in &self.rows {
            let (e, alarms) = (&row.examination, &row.false_alarms);
            let (found, faults) = e.faults.values().fold((0, 0), |(found, faults), on| {
                (found + on.delays_s.len(), faults + on.faults)
            });
            writeln!(
                f,
                "| {} | {:.2}, {:.0} h | {} in {:.0} h: {:.4} ({:.4} to {:.4}) | {:.4} ({:.4} to {:.4}) | {:.3} / {:.3} | {found} of {faults} |",
                e.name,
                row.point.threshold,
                row.point.channel_hours,
                alarms.events,
                alarms.hours,
                alarms.per_hour,
                alarms.low,
                alarms.high,
                e.area,
                e.area_band.0,
                e.area_band.1,
                e.balanced.value(),
                e.balanced_steady.value()
            )?;
        }
        for row in self.rows.iter().filter(|row| !row.alarmed.is_empty()) {
            let worst = row.alarmed.iter().take(ALARMED_NAMED);
            let worst: Vec<String> = worst.map(Peak::to_string).collect();
            let (name, channels) = (&row.examination.name, row.alarmed.len());
            writeln!(
                f,
                "\n{name} alarmed in {channels} of them: {}",
                worst.join(", ")
            )?;
        }
        let (threshold, alarms) = &self.by_theory;
        writeln!(
            f,
            "\nthe innovation test at the threshold of theory, {threshold:.2}: {} in {:.0} h: {:.4} ({:.4} to {:.4})",
            alarms.events, alarms.hours, alarms.per_hour, alarms.low, alarms.high
        )?;
        write!(f, "\n| fault |")?;
        for row in &self.rows {
            write!(
                f,
                " {}: found, median delay (s), area |",
                row.examination.name
            )?;
        }
        writeln!(f, "\n|---|{}", "---|".repeat(self.rows.len()))?;
        let faults = self.rows.first().map(|row| &row.examination.faults);
        for fault in faults.into_iter().flat_map(BTreeMap::keys) {
            write!(f, "| {fault} |")?;
            for row in &self.rows {
                let e = &row.examination;
                if let Some(on) = e.faults.get(fault) {
                    let area = e.area_by_fault.get(fault).copied().unwrap_or(f64::NAN);
                    let (found, all) = (on.delays_s.len(), on.faults);
                    write!(
                        f,
                        " {found} of {all}, {:.2}, {area:.3} |",
                        on.median_delay_s()
                    )?;
                }
            }
            writeln!(f)?;
        }
        writeln!(f, "\n| monitor | balanced accuracy by C/N0 |\n|---|---|")?;
        for row in &self.rows {
            write!(f, "| {} |", row.examination.name)?;
            for (class, accuracy) in &row.examination.balanced_by_cn0 {
                write!(f, " {class} dB-Hz {:.3}", accuracy.value())?;
            }
            writeln!(f, " |")?;
        }
        writeln!(f, "\n{}", consequence::Table(&self.consequences))?;
        if !self.has_enough_hours() {
            return write!(
                f,
                "\nthe stated rate of false alarms is not shown: that takes {LEAST_CHANNEL_HOURS} channel-hours"
            );
        }
        write!(
            f,
            "\nthe stated rate of false alarms {}",
            verdict(self.holds())
        )
    }
}
