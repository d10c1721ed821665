//! What the monitors of a channel find and what they cry wolf at, all at the same rate of false alarms.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use fault_ml::InnovationTest;
use fault_ml::learned::{LearnedModel, ModelKind, OperatingPoint};
use fault_ml::metrics::RateInterval;
use receiver::pipeline::VectorSettings;
use serde_json::json;

use super::verdict;
use crate::scenario::make::Level;
use crate::train::command::{plans, read_model, validation, write_model};
use crate::train::evaluate::{Examination, Examined, examine};
use crate::train::fit::{FALSE_ALARMS_PER_HOUR, unbounded};
use crate::train::harvest::{Product, Unwatched, harvest};
use crate::train::plan::Series;
use crate::train::quiet;
use crate::train::scoring::Examinee;

/// Time between two steps, s.
const INTERVAL_S: f64 = 0.02;
/// Steps of the windows that areas are found on.
const WINDOW: usize = 50;
/// Scenarios learned from, that the cut between windows is found beside.
const LEARNED_FROM: u32 = 200;

/// Channel-hours in which a rate of 0.01 an hour shows: ten false alarms.
const LEAST_CHANNEL_HOURS: f64 = 1000.0;

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
    /// Its threshold, from one half of the healthy channels.
    pub point: OperatingPoint,
    /// Its false alarms in the other half.
    pub false_alarms: RateInterval,
    /// The model with that threshold.
    model: Option<LearnedModel>,
}

/// Every monitor.
#[derive(Debug, Clone)]
pub struct Table {
    /// The innovation test, then those that are trained.
    pub rows: Vec<Row>,
    scenarios: u32,
}

fn subjects(models: &Path) -> Result<Vec<Subject>> {
    let settings = VectorSettings::default().monitor;
    let test = InnovationTest::new(settings.context("no innovation test")?)?;
    let mut subjects = vec![Subject {
        name: "innovation",
        examinee: Examinee::Innovation(test),
        model: None,
    }];
    for kind in [ModelKind::Svm, ModelKind::Lstm] {
        let model = read_model(kind, models)?;
        let free = unbounded(&model, model.card().evidence_offset)?;
        subjects.push(Subject {
            name: kind.name(),
            examinee: Examinee::Learned(Arc::new(free)),
            model: Some(model),
        });
    }
    Ok(subjects)
}

/// Examines the innovation test and the models in `models`: thresholds and false alarms from `channel_hours` healthy
/// channel-hours, one half each; everything else from `scenarios` scenarios that nothing was chosen by.
///
/// # Errors
/// Where a model cannot be read or a run fails.
pub fn table(models: &Path, channel_hours: f64, scenarios: u32) -> Result<Table> {
    let subjects = subjects(models)?;
    let examinees: Vec<Examinee> = subjects.iter().map(|s| s.examinee.clone()).collect();
    let half = quiet::runs(channel_hours / 2.0);
    let found_by = quiet::scores(Series::HEALTHY, 0..half, &examinees, INTERVAL_S)?;
    let counted_by = quiet::scores(Series::HEALTHY, half..2 * half, &examinees, INTERVAL_S)?;
    let held_out = harvest(&validation(LEARNED_FROM), Level::Correlator, &Product)?;
    let tests = plans(Series::TEST, scenarios);
    let watched = harvest(&tests, Level::Correlator, &Product)?;
    let unwatched = harvest(&tests, Level::Correlator, &Unwatched)?;
    let examined = Examined {
        validation: &held_out,
        watched: &watched,
        unwatched: &unwatched,
    };
    let mut rows = Vec::new();
    for ((subject, found), counted) in subjects.into_iter().zip(found_by).zip(counted_by) {
        let point = found.operating_point(FALSE_ALARMS_PER_HOUR)?;
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
            false_alarms: counted.rate(point.threshold),
            model,
        });
    }
    Ok(Table { rows, scenarios })
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

    /// Whether every rate of false alarms is one that the stated rate allows, by enough hours to tell.
    #[must_use]
    pub fn holds(&self) -> bool {
        let allows = |row: &Row| row.false_alarms.low <= FALSE_ALARMS_PER_HOUR;
        self.has_enough_hours() && self.rows.iter().all(allows)
    }

    /// Whether false alarms were counted long enough to be seen at the stated rate.
    fn has_enough_hours(&self) -> bool {
        let enough = |row: &Row| row.point.channel_hours >= LEAST_CHANNEL_HOURS;
        self.rows.iter().all(enough)
    }
}

impl Row {
    fn figures(&self) -> serde_json::Value {
        let mut figures = self.examination.figures();
        figures["threshold_from_channel_hours"] = json!(self.point.channel_hours);
        figures["false_alarms"] = json!(self.false_alarms.events);
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
            "{} scenarios; thresholds for {FALSE_ALARMS_PER_HOUR} false alarms a channel and hour\n\n\
             | monitor | threshold, from channel-hours | false alarms in as many others, an hour (95 %) | area under the ROC (95 %) | balanced accuracy, all / steady | faults found |\n\
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
                "| {} | {:.2}, {:.0} h | {}: {:.4} ({:.4} to {:.4}) | {:.4} ({:.4} to {:.4}) | {:.3} / {:.3} | {found} of {faults} |",
                e.name,
                row.point.threshold,
                row.point.channel_hours,
                alarms.events,
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
        if !self.has_enough_hours() {
            return write!(
                f,
                "\nthe stated rate of false alarms is not shown: that takes {LEAST_CHANNEL_HOURS} channel-hours in each half"
            );
        }
        write!(
            f,
            "\nthe stated rate of false alarms {}",
            verdict(self.holds())
        )
    }
}
