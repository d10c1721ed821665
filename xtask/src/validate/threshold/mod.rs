//! How much weaker signals may be where one filter steers all channels: the C/N0 at which half of the runs
//! are lost, against loops that share nothing but are told the same.
//!
//! Both sides have the product's discriminators, their variances and its gate, know the C/N0 of every signal,
//! which is the same for all, and start on their signals; the vector side is the product's filter. The clock is
//! the one that the filters assume by default. A run is lost with its first channel.

pub mod loops;
pub mod sums;
pub mod sweep;
pub mod truth;

use std::fmt;

use anyhow::Result;

use self::sweep::{Case, Interval, Lost, Receiver, Sweep, bootstrap};
use self::truth::Motion;
use super::verdict;

/// Satellites, and the gain asked for of them, dB.
const ASKED: [(usize, f64); 2] = [(11, 6.2), (5, 2.4)];

/// One case, both receivers.
#[derive(Debug, Clone)]
pub struct Row {
    /// The case.
    pub case: Case,
    /// Gain asked for, dB.
    pub asked_db: f64,
    /// What counts as lost.
    pub lost: Lost,
    /// Threshold of loops that share nothing, dB-Hz; `None` where half are kept at every point.
    pub scalar: Option<Interval>,
    /// Threshold of the filter of all, dB-Hz; likewise.
    pub vector: Option<Interval>,
    /// Lowest point of the filter of all, dB-Hz: its threshold, where there is none, lies below.
    pub lowest_dbhz: f64,
    /// Difference, dB, where there are both.
    pub gain: Option<Interval>,
}

/// All cases.
#[derive(Debug, Clone)]
pub struct Thresholds {
    /// Runs of each point.
    pub runs: usize,
    /// By case.
    pub rows: Vec<Row>,
}

impl Thresholds {
    /// Sweeps every case with `runs` runs a point.
    ///
    /// # Errors
    /// Where numbers fail.
    pub fn sweep(runs: usize) -> Result<Self> {
        let mut rows = Vec::new();
        for (satellites, asked_db) in ASKED {
            for motion in [Motion::Rest, Motion::Vehicle] {
                let case = Case { satellites, motion };
                let scalar = Sweep::new(case, Receiver::Scalar, runs)?;
                let vector = Sweep::new(case, Receiver::Vector, runs)?;
                for lost in [Lost::Channels, Lost::Runs] {
                    rows.push(row(case, asked_db, lost, [&scalar, &vector], runs));
                }
            }
        }
        Ok(Self { runs, rows })
    }

    /// Whether every gain is what is asked for.
    ///
    /// Counted by runs, as it is asked; a channel by itself is shown beside.
    #[must_use]
    pub fn holds(&self) -> bool {
        let mut by_runs = self.rows.iter().filter(|row| row.lost == Lost::Runs);
        by_runs.all(Row::holds)
    }
}

impl Row {
    /// Gain, dB, or what it exceeds where the filter of all keeps half at every point.
    #[must_use]
    pub fn gain_db(&self) -> Option<f64> {
        let bound = self.scalar.map(|scalar| scalar.value - self.lowest_dbhz);
        self.gain.map(|gain| gain.value).or(bound)
    }

    /// Whether the gain is what is asked for.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.gain_db().is_some_and(|db| db >= self.asked_db)
    }
}

fn row(case: Case, asked_db: f64, lost: Lost, [scalar, vector]: [&Sweep; 2], runs: usize) -> Row {
    let threshold = |sweep: &Sweep, drawn: &[usize]| sweep.threshold_dbhz(lost, drawn);
    Row {
        case,
        asked_db,
        lost,
        scalar: bootstrap(runs, |drawn| threshold(scalar, drawn)),
        vector: bootstrap(runs, |drawn| threshold(vector, drawn)),
        lowest_dbhz: vector.lowest_dbhz(),
        gain: bootstrap(runs, |drawn| {
            Some(threshold(scalar, drawn)? - threshold(vector, drawn)?)
        }),
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:5.2} ({:.2} to {:.2})", self.value, self.from, self.to)
    }
}

/// A threshold, or that half are kept at every point.
fn shown(threshold: Option<Interval>) -> String {
    threshold.map_or_else(|| "not reached".to_owned(), |interval| interval.to_string())
}

impl fmt::Display for Thresholds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "C/N0 (dB-Hz) at which half are lost within 60 s, 95 % intervals, {} runs a point:\n\
             satellites  motion   lost       scalar                   vector                   gain (dB)               asked",
            self.runs
        )?;
        for row in &self.rows {
            let motion = match row.case.motion {
                Motion::Rest => "rest",
                Motion::Vehicle => "vehicle",
            };
            let lost = match row.lost {
                Lost::Channels => "channels",
                Lost::Runs => "runs",
            };
            writeln!(
                f,
                "{:10}  {motion:8} {lost:9} {:24} {:24} {:24} {:.1} {}",
                row.case.satellites,
                shown(row.scalar),
                shown(row.vector),
                row.gain.map_or_else(
                    || row
                        .gain_db()
                        .map_or_else(|| "-".to_owned(), |db| format!("above {db:.1}")),
                    |gain| gain.to_string(),
                ),
                row.asked_db,
                verdict(row.holds()),
            )?;
        }
        write!(f, "threshold gain: {}", verdict(self.holds()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_keeps_half_everywhere_gains_more_than_down_to_its_last_point() {
        let scalar = Sweep {
            points: vec![(21.0, vec![0.0; 4]), (20.0, vec![1.0; 4])],
        };
        let vector = Sweep {
            points: vec![(9.0, vec![0.0; 4]), (8.0, vec![0.0, 0.0, 0.0, 1.0])],
        };
        let case = Case {
            satellites: 5,
            motion: Motion::Rest,
        };
        let row = row(case, 2.4, Lost::Runs, [&scalar, &vector], 4);
        assert_eq!(row.scalar.map(|s| s.value), Some(20.5));
        assert_eq!((row.vector, row.gain), (None, None));
        assert_eq!(row.gain_db(), Some(12.5));
        let table = Thresholds {
            runs: 4,
            rows: vec![row],
        };
        assert!(table.holds());
        let text = table.to_string();
        assert!(
            text.contains("not reached") && text.contains("above 12.5"),
            "{text}"
        );
    }
}
