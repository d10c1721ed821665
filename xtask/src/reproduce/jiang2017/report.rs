//! The report and the numbers of the summary.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::checks::{GOAL_M, alarm_delay_s, largest};
use super::learned::WatchedRuns;
use super::receivers::{CARRIER_HZ, CN0_DBHZ, INTERVAL_S, Variant};
use super::study::{Blockage, Case, Run, SETTLING_S, Study};
use crate::order::median;
use crate::reproduce::Check;
use crate::reproduce::report::checks_table;
use crate::scenario::make::Level;

/// Every number of the tables.
#[must_use]
pub fn figures(study: &Study) -> Value {
    let cases = study.cases.iter().map(|case| {
        let receivers = Variant::ALL.map(|variant| (variant.key().to_owned(), of(case, variant)));
        let mut receivers: serde_json::Map<_, _> = receivers.into_iter().collect();
        let learned = study.learned.iter().filter(|w| w.blockage == case.blockage);
        receivers.extend(learned.map(|w| {
            (
                w.key.to_owned(),
                each_run(&w.runs.iter().collect::<Vec<_>>()),
            )
        }));
        (case.blockage.name.to_owned(), Value::Object(receivers))
    });
    let mut figures: serde_json::Map<_, _> = cases.collect();
    figures.insert("level".to_owned(), json!(study.level.name()));
    figures.insert("settling_s".to_owned(), json!(SETTLING_S));
    Value::Object(figures)
}

fn of(case: &Case, variant: Variant) -> Value {
    each_run(&case.runs(variant).collect::<Vec<_>>())
}

fn each_run(runs: &[&Run]) -> Value {
    let each = |value: &dyn Fn(&Run) -> Value| runs.iter().copied().map(value).collect::<Value>();
    json!({
        "largest_before_m": each(&|run| json!(run.before_m)),
        "largest_after_m": each(&|run| json!(run.after_m)),
        "switched_s": each(&|run| json!(run.switched_s)),
        "excluded_s": each(&|run| json!(run.excluded_s)),
        "signal_lost_s": each(&|run| json!(run.lost_s)),
        "exclusions_before": each(&|run| json!(run.excluded_before)),
        "healthy_excluded_after": each(&|run| json!(run.healthy_after)),
        "availability": each(&|run| json!(run.availability)),
    })
}

/// The report.
#[must_use]
pub fn report(study: &Study, checks: &[Check]) -> String {
    let mut text = introduction(study);
    for case in &study.cases {
        text += &table(case, &study.learned);
    }
    text + FIGURES + &reading(study) + NOT_REPRODUCED + &checks_table(checks)
}

fn introduction(study: &Study) -> String {
    let made = match study.level {
        Level::If => "samples at an intermediate frequency (16.369 MHz, 2 bits)",
        Level::Correlator => "correlator sums drawn from their distribution",
    };
    let seeds = study.cases.first().map_or(0, |case| case.seeds.len());
    format!(
        "# Jiang2017: vector tracking while a satellite is blocked\n\n\
         Both scenarios of the paper, {seeds} seeds each, by {made}: seven satellites at {CN0_DBHZ} dB-Hz, a flight at 1000 m/s, S_f = 0.01 m^2/s and \
         S_g = 0.04 m^2/s^3. The blocked satellite's signal is gone and the receiver is not told. All receivers of a seed receive the same signal, \
         assisted, with q_a = 1 m^2/s^3.\n\n\
         - *Paper baseline*: updates every {INTERVAL_S} s, early and late 1 chip apart, frequency by equation (6) from successive sums, measurement \
         noise fixed at what theory gives for the C/N0 before the blockage ({CN0_DBHZ} dB-Hz, of which the front end leaves 43), no gate, \
         noise measured as if it were a signal.\n\
         - *Product baseline*: 20 ms, measurement noise from the measured C/N0, discriminators bounded, gate at 4 deviations; a channel whose signal \
         is gone reports nothing.\n\
         - *Exclusion*: the innovation test once per update, 30 updates, 0.01 false alarms a channel and hour: of code and range rate, 100 Hz, on \
         the paper's, of the code, 50 Hz, on the product's.\n\
         - *SVM of 30*, *LSTM of 50*: trained on raw innovations of a blocked channel (runs of other seeds at 40 and 45 dB-Hz, some blockages of which end), in place of the \
         innovation test. *Its SVM*, *its LSTM*: those that come with the receiver.\n\n\
         One setting differs from the receiver's defaults in all four, because of the scenario's clock: until the filter takes over the carrier loops \
         have {CARRIER_HZ} Hz instead of 10 Hz, with which they slip on its white frequency noise. That noise is common to all range rates; before \
         each update the filter takes its drift for less certain by S_f over the interval.\n\n\
         Errors are three-dimensional and counted from {SETTLING_S} s after the filter took over (which starts from least squares), to the end. \
         An alarm is the monitor's exclusion or the channel's own finding that its signal is gone, whichever comes first.\n\n"
    )
}

fn table(case: &Case, learned: &[WatchedRuns]) -> String {
    let blockage = &case.blockage;
    let mut text = format!(
        "## Scenario {}: G{:02} blocked from {} s to the end\n\n\
         | receiver | largest error before (m), median / worst | after, median / worst | alarm after (s), latest | of them by the monitor | excluded falsely before / after |\n\
         |---|---|---|---|---|---|\n",
        blockage.number, blockage.prn, blockage.begin_s
    );
    let _ = writeln!(
        text,
        "| paper, without detection | - | \"keeps growing\" | - | - | - |\n| paper, SVM | - | within {} | \"no visible delay\" | - | - |",
        blockage.paper_m
    );
    for variant in Variant::ALL {
        let runs: Vec<&Run> = case.runs(variant).collect();
        text += &row(blockage, variant.label(), &runs);
    }
    for watched in learned.iter().filter(|w| w.blockage == *blockage) {
        let runs: Vec<&Run> = watched.runs.iter().collect();
        text += &row(blockage, watched.label, &runs);
    }
    text + "\n"
}

fn row(blockage: &Blockage, label: &str, runs: &[&Run]) -> String {
    let runs = || runs.iter().copied();
    let count = |value: fn(&Run) -> usize| runs().map(value).sum::<usize>();
    let delay_s = largest(runs().map(|run| alarm_delay_s(run, blockage.begin_s)));
    let delay = if delay_s.is_finite() {
        format!("{delay_s:.2}")
    } else {
        "none".to_owned()
    };
    format!(
        "| {} | {:.2} / {:.2} | {:.2} / {:.2} | {delay} | {} of {} | {} / {} |\n",
        label,
        median(runs().map(|run| run.before_m)),
        largest(runs().map(|run| run.before_m)),
        median(runs().map(|run| run.after_m)),
        largest(runs().map(|run| run.after_m)),
        count(|run| usize::from(run.excluded_s.is_some())),
        runs().count(),
        count(|run| run.excluded_before),
        count(|run| run.healthy_after),
    )
}

const FIGURES: &str = "\
## Figures 6 and 7

![Figure 6](figure6.svg)
![Figure 7](figure7.svg)
![Scenario 1](scenario1.svg)
![Scenario 2](scenario2.svg)

The first seed. The dashed line is the blockage. Both lines of the product lie on each other: nothing is left to exclude.

";

fn reading(study: &Study) -> String {
    let mut text = String::from("## What it shows\n\n");
    for case in &study.cases {
        let worst = |variant| largest(case.runs(variant).map(Run::largest_m));
        let _ = writeln!(
            text,
            "- Scenario {}: without detection the paper's filter leaves the truth by {:.0} m (median of the largest errors), with it no run by more than \
             {:.2} m; the goal of {GOAL_M} m is {} there and {} by the product ({:.2} m).",
            case.blockage.number,
            median(case.runs(Variant::Paper).map(|run| run.after_m)),
            worst(Variant::PaperExcluding),
            reached(worst(Variant::PaperExcluding)),
            reached(worst(Variant::ProductExcluding)),
            worst(Variant::ProductExcluding),
        );
    }
    text + EXPLANATION
}

fn reached(worst_m: f64) -> &'static str {
    if worst_m <= GOAL_M {
        "reached"
    } else {
        "missed"
    }
}

const EXPLANATION: &str = "\
- Why the paper's filter runs off: equation (6) divides by the power of one sum. Of noise that ratio has no variance; single values of tens of metres a \
second enter with the weight of a good range rate, and the healthy channels are steered away from their signals.
- The product hardly needs the exclusion: a channel that sees its signal gone says nothing. Its alarm is the channel's own, before the monitor has \
any innovation to judge (column 5).
- Exclusion here means more than in the paper: the noise of the last intervals is in the filter when the alarm comes, and makes healthy channels contradict it. The \
filter goes back ten seconds and takes in all measurements again without the satellite.

";

const NOT_REPRODUCED: &str = "\
## What could not be reproduced

- Figure 5 (accuracy by the number of innovations): see the report of Zhu2020, which has both curves.
- The constellation, date and recording of the paper are not stated; the nominal constellation at a time at which it shows the same seven satellites \
stands in.
- The paper gives curves, no numbers: 10 and 5 m are read off them.

";
