//! False alarms of the chart on the shape of the correlation (`Zhang2014`), in many hours of closed loops.

use std::fmt;

use anyhow::Result;
use fault_ml::shape::closed_loop_chart;

use super::verdict;
use crate::reproduce::zhang2014::false_alarms::{CN0_DBHZ, FalseAlarms, by_table, of_starts};
use crate::reproduce::zhang2014::tail::{Tail, tails};

/// Rates that limits are stated for, an hour.
const RATES: [f64; 3] = [10.0, 1.0, 0.1];
/// Alarms of a channel and hour at most.
const MOST_PER_HOUR: f64 = 0.01;
/// Beginnings of the receiver's chart at each C/N0.
const STARTS: usize = 20_000;
/// Other loops than those that the limits were chosen by, and than those of `reproduce zhang2014`.
const SEED: u64 = 20_000;

/// What the loops show.
#[derive(Debug, Clone)]
pub struct Table {
    tails: Vec<Tail>,
    alarms: FalseAlarms,
    starts: Vec<usize>,
    beginnings: usize,
}

/// Simulates `hours` of channels.
///
/// # Errors
/// Where a chart fails.
pub fn table(hours: f64) -> Result<Table> {
    simulate(hours, STARTS)
}

fn simulate(hours: f64, beginnings: usize) -> Result<Table> {
    let tails = tails(hours / CN0_DBHZ.len() as f64, SEED)?;
    Ok(Table {
        alarms: by_table(&tails),
        tails,
        starts: of_starts(beginnings)?,
        beginnings,
    })
}

impl Table {
    /// Whether the upper end of the interval of the rate is low enough.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.alarms.rate().high <= MOST_PER_HOUR
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "Largest of the taps, sums of 1 ms, loop of 3 Hz, lambda 0.02; limits in chips:\n"
        )?;
        write!(f, "| C/N0 (dB-Hz) | hours | limit | alarms |")?;
        RATES
            .iter()
            .try_for_each(|r| write!(f, " passed {r} an hour |"))?;
        writeln!(f, " passed once |\n|---|---|---|---|---|---|---|---|")?;
        for (tail, alarms) in self.tails.iter().zip(&self.alarms.alarms) {
            let (cn0, hours) = (tail.cn0_dbhz, tail.hours);
            let limit = closed_loop_chart(cn0).limit(u32::MAX);
            write!(f, "| {cn0} | {hours:.1} | {limit:.4} | {alarms} |")?;
            for rate in RATES {
                write!(f, " {:.5} |", tail.limit_chips(rate))?;
            }
            writeln!(f, " {:.5} |", tail.limit_chips(1.0 / hours))?;
        }
        let rate = self.alarms.rate();
        writeln!(
            f,
            "\n{} alarms in {:.0} channel-hours: {:.4} an hour, 95 % {:.4} to {:.4}; asked for {MOST_PER_HOUR}: {}",
            rate.events,
            rate.hours,
            rate.per_hour,
            rate.low,
            rate.high,
            verdict(self.holds())
        )?;
        write!(
            f,
            "The receiver's chart, alarms in the first two seconds of {} beginnings, by C/N0: {:?}",
            self.beginnings, self.starts
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_shows_no_rate_of_one_in_a_hundred() {
        let table = simulate(0.07, 20).unwrap();
        assert!(!table.holds(), "{table}");
        assert_eq!(table.alarms.rate().events, 0, "{table}");
        assert!(table.to_string().contains("| 50 | 0.0 | 0.0105 | 0 |"));
    }
}
