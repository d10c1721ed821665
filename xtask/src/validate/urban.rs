//! `urban-canyon` by vector tracking under several monitors and seeds.

use std::fmt;

use anyhow::{Result, ensure};
use fault_ml::shape::ShapeSettings;
use receiver::pipeline::{Policy, Settings, ShapeWatching, VectorSettings};
use receiver::record::EventKind;

use super::verdict;
use crate::judged::{Judged, in_parallel, receive, settings};
use crate::order::quantile;
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;

/// The first seed.
const FIRST_SEED: u64 = 1_400;
/// Part of the error without a monitor that may be left: 40 % below.
const LEFT: f64 = 0.6;

/// Who watches the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Watched {
    words: &'static str,
    chart: bool,
    innovation: bool,
}

/// Nobody first, both last.
const ALL: [Watched; 4] = {
    const fn watched(words: &'static str, chart: bool, innovation: bool) -> Watched {
        Watched {
            words,
            chart,
            innovation,
        }
    }
    [
        watched("none", false, false),
        watched("ewma", true, false),
        watched("innovation", false, true),
        watched("innovation and ewma", true, true),
    ]
};

impl Watched {
    fn settings(self, scenario: &Scenario) -> Settings {
        let usual = VectorSettings::default();
        Settings {
            shape: self.chart.then(|| ShapeWatching {
                chart: ShapeSettings::default(),
                policy: Policy::Exclude,
            }),
            vector: Some(VectorSettings {
                monitor: usual.monitor.filter(|_| self.innovation),
                ..usual
            }),
            ..settings(scenario)
        }
    }
}

/// Errors of all epochs of all seeds, 95th percentile, horizontal and 3-D, m.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Error {
    horizontal_m: f64,
    position_m: f64,
    /// How often satellites found faulty were weighted, as too few would have been left.
    too_few: usize,
}

impl Error {
    fn of(runs: &[Judged]) -> Self {
        let epochs = || runs.iter().flat_map(|run| &run.epochs);
        let is_too_few = |kind: &EventKind| match kind {
            EventKind::TooFewLeft { weighted } => *weighted > 0,
            _ => false,
        };
        let events = runs.iter().flat_map(|run| &run.events);
        Self {
            horizontal_m: quantile(epochs().map(|e| e.horizontal_m()), 0.95),
            position_m: quantile(epochs().map(|e| e.position_enu_m.norm()), 0.95),
            too_few: events.filter(|e| is_too_few(&e.kind)).count(),
        }
    }
}

/// Errors stand-alone and assisted, in the order of `ALL`.
#[derive(Debug, Clone)]
pub struct Table {
    seeds: usize,
    stand_alone: Vec<Error>,
    assisted: Vec<Error>,
}

/// Receives `seeds` runs of each.
///
/// # Errors
/// Where a signal cannot be made or the receiver fails.
pub fn table(seeds: usize) -> Result<Table> {
    ensure!(seeds > 0, "seeds: expected at least one");
    let errors = |assisted: bool| -> Result<Vec<Error>> {
        let runs = in_parallel(ALL.len() * seeds, |k| {
            run(ALL[k / seeds], assisted, FIRST_SEED + (k % seeds) as u64)
        })?;
        Ok(runs.chunks(seeds).map(Error::of).collect())
    };
    Ok(Table {
        seeds,
        stand_alone: errors(false)?,
        assisted: errors(true)?,
    })
}

fn run(watched: Watched, assisted: bool, seed: u64) -> Result<Judged> {
    let file = catalogue::find("urban-canyon")?;
    let file = file.with(&[format!("receiver.assisted={assisted}")])?;
    let scenario = Scenario::new(&file, Some(seed))?;
    receive(&scenario, Level::Correlator, &watched.settings(&scenario))
}

impl Table {
    /// Whether both monitors together leave so little of the error without any.
    #[must_use]
    pub fn holds(&self) -> bool {
        [&self.stand_alone, &self.assisted]
            .into_iter()
            .all(|errors| {
                let ([none, ..], [.., both]) = (&errors[..], &errors[..]) else {
                    return false;
                };
                both.horizontal_m <= LEFT * none.horizontal_m
                    && both.position_m <= LEFT * none.position_m
            })
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "urban-canyon on correlator sums, vector tracking, {} seeds, 95th percentile of the error (m), and how often satellites found faulty were weighted instead of left out:\n",
            self.seeds
        )?;
        writeln!(
            f,
            "| start | monitor | horizontal | below none (%) | 3-D | below none (%) | weighted |\n|---|---|---|---|---|---|---|"
        )?;
        for (start, errors) in [
            ("stand-alone", &self.stand_alone),
            ("assisted", &self.assisted),
        ] {
            let Some(none) = errors.first() else { continue };
            for (watched, e) in ALL.iter().zip(errors) {
                let below = |error: f64, none: f64| 100.0 * (1.0 - error / none);
                writeln!(
                    f,
                    "| {start} | {} | {:.2} | {:.0} | {:.2} | {:.0} | {} |",
                    watched.words,
                    e.horizontal_m,
                    below(e.horizontal_m, none.horizontal_m),
                    e.position_m,
                    below(e.position_m, none.position_m),
                    e.too_few
                )?;
            }
        }
        write!(
            f,
            "\n40 % below none by innovation test and chart together, in both: {}",
            verdict(self.holds())
        )
    }
}
