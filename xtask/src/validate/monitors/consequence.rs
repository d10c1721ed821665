//! What faults do to the position while a monitor decides who enters the filter.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use anyhow::{Context, Result};
use fault_ml::learned::LearnedModel;
use fault_ml::shape::ShapeSettings;
use gnss_nav::SatelliteId;
use receiver::pipeline::{Policy, Settings, ShapeWatching, VectorSettings};
use receiver::record::{Disposition, Event, EventKind, Status};
use serde_json::{Value, json};

use crate::judged;
use crate::order::quantile;
use crate::reproduce::chart::{BLACK, BLUE, Chart, GREEN, RED, Series, Stroke, picture};
use crate::scenario::built::Scenario;
use crate::scenario::fault::Account;
use crate::scenario::make::Level;
use crate::train::evaluate::OnFault;
use crate::train::plan::Plan;

/// An error so many times its stated deviation misleads.
const MISLEADING: f64 = 4.0;
/// Epochs before count for nothing: the filter settles, s.
const SETTLED_S: f64 = 10.0;
/// Largest error and stated deviation that are drawn, m: larger ones lie on the edge ...
const DRAWN_M: f64 = 60.0;
/// ... and how far apart dots are that do not hide each other, m.
const DOT_M: f64 = 0.25;

/// The receiver as it comes, watched by these and nobody else; what they find is excluded.
#[derive(Debug, Clone, Default)]
pub struct Watch {
    /// What people read.
    pub label: &'static str,
    /// The innovation test.
    pub innovation: bool,
    /// The chart on the shape of the correlation.
    pub shape: bool,
    /// Trained models.
    pub learned: Vec<Arc<LearnedModel>>,
}

impl Watch {
    fn settings(&self, scenario: &Scenario) -> Settings {
        let vector = VectorSettings::default();
        let monitor = vector.monitor.filter(|_| self.innovation);
        let policy = Policy::Exclude;
        let shape = self.shape.then(|| ShapeWatching {
            chart: ShapeSettings::default(),
            policy,
        });
        Settings {
            shape,
            vector: Some(VectorSettings {
                monitor,
                learned: self.learned.clone(),
                policy,
                ..vector
            }),
            ..judged::settings(scenario)
        }
    }
}

/// A horizontal error and what the receiver says of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Epoch {
    error_m: f64,
    sigma_m: f64,
    /// Whether a satellite was left out.
    alarmed: bool,
}

impl Epoch {
    fn misleads(&self) -> bool {
        !self.alarmed && self.error_m > MISLEADING * self.sigma_m
    }
}

/// One run.
#[derive(Debug, Clone, Default)]
struct Flown {
    /// From the onset of the fault on, or all of a healthy run.
    epochs: Vec<Epoch>,
    /// The fault, and the time from its onset to the first exclusion of its satellite, s.
    fault: Option<(String, Option<f64>)>,
    wrong: Wrong,
}

/// Exclusions of satellites that no fault of their own had befallen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Wrong {
    exclusions: usize,
    signal_s: f64,
    /// Those under interference with all reception, and how long there was such.
    interfered: usize,
    interfered_s: f64,
}

impl Wrong {
    fn add(&mut self, other: Self) {
        self.exclusions += other.exclusions;
        self.signal_s += other.signal_s;
        self.interfered += other.interfered;
        self.interfered_s += other.interfered_s;
    }
}

/// What came of all runs with one watch.
#[derive(Debug, Clone)]
pub struct Consequence {
    /// Who watched.
    pub label: &'static str,
    epochs: Vec<Epoch>,
    faults: BTreeMap<String, OnFault>,
    wrong: Wrong,
}

/// Flies `plans` with each of `watches`, at the correlator level.
///
/// # Errors
/// Where a run fails.
pub fn consequences(plans: &[Plan], watches: &[Watch]) -> Result<Vec<Consequence>> {
    let flown = judged::in_parallel(plans.len(), |number| {
        let plan = &plans[number];
        let scenario = plan.scenario()?;
        let fly = |watch: &Watch| fly(plan, &scenario, watch);
        watches.iter().map(fly).collect::<Result<Vec<_>>>()
    })?;
    let of_watch = |(index, watch): (usize, &Watch)| {
        let mut all = Consequence {
            label: watch.label,
            epochs: Vec::new(),
            faults: BTreeMap::new(),
            wrong: Wrong::default(),
        };
        for run in &flown {
            all.add(run.get(index).context("no run")?);
        }
        Ok(all)
    };
    watches.iter().enumerate().map(of_watch).collect()
}

fn fly(plan: &Plan, scenario: &Scenario, watch: &Watch) -> Result<Flown> {
    let judged = judged::receive(scenario, Level::Correlator, &watch.settings(scenario))?;
    let own = scenario.accounts.iter().find(|a| !a.satellites.is_empty());
    let begin_s = scenario.accounts.first().map(|a| a.span.begin_s);
    let onset_s = begin_s.unwrap_or(f64::INFINITY);
    let mut left_out: BTreeMap<u64, bool> = BTreeMap::new();
    for channel in &judged.channels {
        let excluded = channel.disposition == Disposition::Exclude;
        *left_out.entry(channel.time_s.to_bits()).or_default() |= excluded;
    }
    let from_s = begin_s.unwrap_or(SETTLED_S);
    let told = |e: &&judged::JudgedEpoch| e.pvt.status != Status::Unreliable;
    let epochs = judged.between(from_s, f64::INFINITY).filter(told);
    let epochs = epochs.map(|e| Epoch {
        error_m: e.horizontal_m(),
        sigma_m: e.pvt.sigma_enu_m[0].hypot(e.pvt.sigma_enu_m[1]),
        alarmed: left_out
            .get(&e.pvt.time_s.to_bits())
            .copied()
            .unwrap_or(false),
    });
    let excluded = |e: &&Event| matches!(e.kind, EventKind::Excluded { .. });
    let fault = own.map(|account| {
        let victims: &[SatelliteId] = &account.satellites;
        let found = judged
            .events
            .iter()
            .filter(excluded)
            .find(|e| e.time_s >= onset_s && e.satellite.is_some_and(|s| victims.contains(&s)));
        let name = account.kind.to_owned() + plan.severity.suffix();
        (name, found.map(|e| e.time_s - onset_s))
    });
    Ok(Flown {
        epochs: epochs.collect(),
        fault,
        wrong: wrong(&judged.events, &scenario.accounts, plan.duration_s),
    })
}

/// Exclusions before any fault, and of those that it does not befall.
fn wrong(events: &[Event], accounts: &[Account], duration_s: f64) -> Wrong {
    let begin_s = |account: &Account| account.span.begin_s;
    let of_all = accounts.iter().find(|a| a.satellites.is_empty());
    let interfered_from_s = of_all.map_or(f64::INFINITY, begin_s).min(duration_s);
    let is_victim = |e: &&Event| {
        let befalls = |a: &Account| e.satellite.is_some_and(|s| a.satellites.contains(&s));
        accounts
            .iter()
            .any(|a| e.time_s >= begin_s(a) && befalls(a))
    };
    let excluded = events
        .iter()
        .filter(|e| matches!(e.kind, EventKind::Excluded { .. }));
    let wrong = excluded.filter(|e| !is_victim(e));
    let (interfered, quiet): (Vec<_>, Vec<_>) = wrong.partition(|e| e.time_s >= interfered_from_s);
    Wrong {
        exclusions: quiet.len(),
        signal_s: interfered_from_s,
        interfered: interfered.len(),
        interfered_s: duration_s - interfered_from_s,
    }
}

impl Consequence {
    fn add(&mut self, run: &Flown) {
        self.epochs.extend(&run.epochs);
        self.wrong.add(run.wrong);
        if let Some((fault, delay_s)) = &run.fault {
            let on = self.faults.entry(fault.clone()).or_default();
            on.faults += 1;
            on.delays_s.extend(*delay_s);
        }
    }

    /// Faults, and how many of them were found.
    #[must_use]
    pub fn found(&self) -> (usize, usize) {
        self.faults.values().fold((0, 0), |(found, all), on| {
            (found + on.delays_s.len(), all + on.faults)
        })
    }

    /// The horizontal error that `part` of the epochs stay below, m.
    #[must_use]
    pub fn error_m(&self, part: f64) -> f64 {
        quantile(self.epochs.iter().map(|e| e.error_m), part)
    }

    /// Part of the epochs whose error is beyond four deviations while nobody is left out.
    #[must_use]
    pub fn misleading(&self) -> f64 {
        let misled = self.epochs.iter().filter(|e| e.misleads()).count();
        misled as f64 / self.epochs.len() as f64
    }

    /// All figures.
    #[must_use]
    pub fn figures(&self) -> Value {
        let (found, faults) = self.found();
        json!({
            "found": found, "faults": faults,
            "horizontal_m": { "p50": self.error_m(0.5), "p95": self.error_m(0.95), "p99": self.error_m(0.99) },
            "misleading": self.misleading(), "wrongly_excluded": self.wrong.exclusions, "signal_s": self.wrong.signal_s,
            "wrongly_excluded_under_interference": self.wrong.interfered, "interfered_s": self.wrong.interfered_s,
        })
    }
}

/// Errors against what the receiver states of them (Stanford plot): what lies above the line misleads, unless a
/// satellite is left out.
///
/// # Errors
/// Where it cannot be drawn.
pub fn stanford(consequences: &[Consequence]) -> Result<String> {
    let chart = |all: &Consequence| {
        let series = |label: &str, colour, pick: &dyn Fn(&Epoch) -> bool| Series {
            label: label.to_owned(),
            colour,
            stroke: Stroke::Dots,
            points: dots(all.epochs.iter().filter(|e| pick(e))),
        };
        Chart {
            caption: all.label.to_owned(),
            x: "four stated deviations (m, 60 and more at the edge)",
            y: "horizontal error (m, 60 and more at the edge)",
            series: vec![
                series("nobody left out", BLUE, &|e| !e.alarmed && !e.misleads()),
                series("a satellite left out", GREEN, &|e| e.alarmed),
                series("misleading", RED, &Epoch::misleads),
                Series {
                    label: "as stated".to_owned(),
                    colour: BLACK,
                    stroke: Stroke::Line,
                    points: vec![(0.0, 0.0), (DRAWN_M, DRAWN_M)],
                },
            ],
            ..Chart::default()
        }
    };
    let charts: Vec<Chart> = consequences.iter().map(chart).collect();
    picture("Faults and what the receiver says of its error", &charts)
}

/// What is stated of errors and what they are, m, one dot for all that would lie on it.
fn dots<'a>(epochs: impl Iterator<Item = &'a Epoch>) -> Vec<(f64, f64)> {
    let points = epochs.map(|e| (MISLEADING * e.sigma_m, e.error_m));
    let place = |m: f64| (m.min(DRAWN_M) / DOT_M) as u32;
    let places: BTreeSet<_> = points.map(|(x, y)| (place(x), place(y))).collect();
    let middle = |place: u32| (f64::from(place) + 0.5) * DOT_M;
    let dots = places.into_iter();
    dots.map(|(x, y)| (middle(x), middle(y))).collect()
}

/// A table of `consequences`.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a>(pub &'a [Consequence]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| watched by | faults found | horizontal error from the onset on, median, 95 %, 99 % (m) | beyond four deviations unsaid | wrong exclusions; under interference |\n\
             |---|---|---|---|---|"
        )?;
        for row in self.0 {
            let (found, faults) = row.found();
            writeln!(
                f,
                "| {} | {found} of {faults} | {:.2}, {:.1}, {:.1} | {:.2} % | {} in {:.0} s; {} in {:.0} s |",
                row.label,
                row.error_m(0.5),
                row.error_m(0.95),
                row.error_m(0.99),
                100.0 * row.misleading(),
                row.wrong.exclusions,
                row.wrong.signal_s,
                row.wrong.interfered,
                row.wrong.interfered_s
            )?;
        }
        write!(f, "\n| fault |")?;
        for row in self.0 {
            write!(f, " {}: found, median delay (s) |", row.label)?;
        }
        writeln!(f, "\n|---|{}", "---|".repeat(self.0.len()))?;
        let faults = self.0.first().map(|row| row.faults.keys());
        for fault in faults.into_iter().flatten() {
            write!(f, "| {fault} |")?;
            for on in self.0.iter().filter_map(|row| row.faults.get(fault)) {
                let (found, all) = (on.delays_s.len(), on.faults);
                write!(f, " {found} of {all}, {:.2} |", on.median_delay_s())?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::fault::Span;

    #[test]
    fn no_error_is_too_large_to_be_drawn() {
        let epoch = |error_m, sigma_m| Epoch {
            error_m,
            sigma_m,
            alarmed: false,
        };
        let far = dots([epoch(5000.0, 2.0), epoch(1.0, 900.0)].iter());
        assert_eq!(far, [(8.125, 60.125), (60.125, 1.125)]);
    }

    #[test]
    fn what_befell_no_fault_of_its_own_is_wrongly_excluded() {
        let account = |satellites: &[u8], begin_s| Account {
            kind: "step",
            satellites: satellites
                .iter()
                .map(|prn| SatelliteId::gps(*prn))
                .collect(),
            span: Span {
                begin_s,
                end_s: None,
                ramp_s: 0.0,
            },
            detail: String::new(),
        };
        let excluded = |prn, time_s| Event {
            time_s,
            satellite: Some(SatelliteId::gps(prn)),
            kind: EventKind::Excluded {
                monitor: "innovation".to_owned(),
                score: 4.0,
                threshold: 3.0,
                residual_m: None,
            },
        };
        let events = [excluded(7, 5.0), excluded(7, 30.0), excluded(8, 50.0)];
        let of_one = wrong(&events, &[account(&[7], 20.0)], 60.0);
        assert_eq!((of_one.exclusions, of_one.signal_s), (2, 60.0));
        assert_eq!((of_one.interfered, of_one.interfered_s), (0, 0.0));
        let of_all = wrong(&events, &[account(&[], 20.0)], 60.0);
        assert_eq!((of_all.exclusions, of_all.signal_s), (1, 20.0));
        assert_eq!((of_all.interfered, of_all.interfered_s), (2, 40.0));
    }
}
