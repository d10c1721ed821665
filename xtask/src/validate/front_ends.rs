//! The receiver, alone, under an open sky behind front ends of many rates and depths.

use std::fmt;
use std::path::Path;

use anyhow::{Context, Result};
use receiver::summary::Summary;

use super::verdict;
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::command::receive;
use crate::scenario::make::Level;

/// Name of the scenario.
const NAME: &str = "static-open-sky";
/// Sample rates, Hz: 4 and 16 samples a chip exactly, and others.
pub const RATES_HZ: [f64; 4] = [2.6e6, 4.092e6, 16.368e6, 16.369e6];
/// Bits of a component.
pub const BITS: [u8; 3] = [1, 2, 8];
/// Two-sided width of the filter over the sample rate.
pub const BANDWIDTH: f64 = 0.8;
/// Horizontal error (rms) allowed, m.
pub const LARGEST_RMS_M: f64 = 1.0;

/// One front end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontEnd {
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Bits of a component: 1, 2 or 8.
    pub bits: u8,
}

impl FrontEnd {
    /// Every rate with every depth.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let depths = |sample_rate_hz| {
            BITS.map(|bits| Self {
                sample_rate_hz,
                bits,
            })
        };
        RATES_HZ.into_iter().flat_map(depths).collect()
    }

    /// The scenario behind this front end, `duration_s` long.
    ///
    /// # Errors
    /// Where it is impossible.
    pub fn scenario(self, duration_s: f64, seed: Option<u64>) -> Result<Scenario> {
        let rate_hz = self.sample_rate_hz;
        let format = if self.bits == 1 { "c1_msb" } else { "ci8" };
        let mut values = vec![
            format!("duration_s={duration_s}"),
            format!("front_end.sample_rate_hz={rate_hz}"),
            format!("front_end.bandwidth_hz={}", BANDWIDTH * rate_hz),
            format!("front_end.format={format}"),
        ];
        // No format holds complex samples of two bits.
        if self.bits == 2 {
            values.push("front_end.bits=2".to_owned());
        }
        Scenario::new(&catalogue::find(NAME)?.with(&values)?, seed)
    }
}

/// What the receiver made of one front end.
#[derive(Debug, Clone)]
pub struct Row {
    /// Which.
    pub front_end: FrontEnd,
    /// What was found, judged against the truth.
    pub summary: Summary,
}

impl Row {
    /// Whether there is a position, and its horizontal error small enough.
    #[must_use]
    pub fn holds(&self) -> bool {
        let error = self.summary.error.as_ref();
        error.is_some_and(|error| error.horizontal_rms_m <= LARGEST_RMS_M)
    }
}

/// All front ends.
#[derive(Debug, Clone)]
pub struct Table(pub Vec<Row>);

/// Makes and receives `duration_s` of every front end; what the receiver writes goes to folders of
/// `out`.
///
/// # Errors
/// Where a signal cannot be made, the receiver fails or a file cannot be written.
pub fn table(duration_s: f64, seed: Option<u64>, out: &Path) -> Result<Table> {
    let row = |front_end: FrontEnd| -> Result<Row> {
        let FrontEnd {
            sample_rate_hz,
            bits,
        } = front_end;
        let name = format!("{}_{bits}", sample_rate_hz / 1e3);
        let scenario = front_end.scenario(duration_s, seed)?;
        let summary = receive(&scenario, Level::If, &out.join(&name), &[]);
        Ok(Row {
            front_end,
            summary: summary.context(name)?,
        })
    };
    let rows: Result<_> = FrontEnd::all().into_iter().map(row).collect();
    Ok(Table(rows?))
}

impl Table {
    /// Whether every row holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.0.iter().all(Row::holds)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| fs (MHz) | bits | first position (s) | horizontal rms (m) | at most (m) | vertical rms (m) |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|")?;
        for row in &self.0 {
            let FrontEnd {
                sample_rate_hz,
                bits,
            } = row.front_end;
            write!(f, "| {} | {bits} | ", sample_rate_hz / 1e6)?;
            match (&row.summary.error, row.summary.first_fix_s) {
                (Some(error), Some(first_fix_s)) => writeln!(
                    f,
                    "{first_fix_s:.1} | {:.3} | {:.3} | {:.3} |",
                    error.horizontal_rms_m, error.horizontal_max_m, error.vertical_rms_m
                )?,
                _ => writeln!(f, "none | | | |")?,
            }
        }
        let verdict = verdict(self.holds());
        write!(f, "bound {LARGEST_RMS_M} m rms: {verdict}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn front_ends_are_as_they_say() {
        let all = FrontEnd::all();
        assert_eq!(all.len(), 12);
        for front_end in all {
            let reception = front_end.scenario(1.0, None).unwrap().reception;
            let samples = reception.samples;
            assert_eq!(samples.sample_rate_hz, front_end.sample_rate_hz);
            let depth = samples.format.bits_per_sample() / samples.format.components();
            assert_eq!(
                reception.bits.map_or(depth, usize::from),
                usize::from(front_end.bits)
            );
            let bandwidth = reception.bandwidth_hz.unwrap() / samples.sample_rate_hz;
            assert!((bandwidth - 0.8).abs() < 1e-12);
        }
    }
}
