//! Down to which C/N0 vector tracking knows where it is, as all satellites fade.

use std::fmt;

use anyhow::{Context, Result, ensure};
use receiver::pipeline::{Settings, VectorSettings};
use receiver::record::Status;

use super::verdict;
use crate::judged::{JudgedEpoch, in_parallel, receive, settings};
use crate::order::median;
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;

/// The satellite whose C/N0 counts, by strength: a position needs so many.
const FOURTH: usize = 4;
/// Horizontal error that is too much, m.
const LOST_M: f64 = 20.0;
/// Errors within so many stated deviations are covered.
const COVERED_SIGMAS: f64 = 3.0;

/// How a receiver moves while its signals fade.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// On a circle, 10 m/s and 1 m/s^2; 0.25 dB/s.
    Circle,
    /// Through turns of 10 m/s^2; 0.5 dB/s.
    Turns,
    /// At rest; 0.25 dB/s.
    Static,
}

impl Motion {
    const ALL: [Self; 3] = [Self::Circle, Self::Turns, Self::Static];

    /// Highest C/N0 allowed at the end, dB-Hz.
    const fn goal_dbhz(self) -> f64 {
        match self {
            Self::Circle => 19.0,
            Self::Turns => 22.0,
            Self::Static => 13.0,
        }
    }

    fn scenario(self, seed: u64) -> Result<Scenario> {
        let at_rest =
            "trajectory={kind=\"static\", at={lat_deg=48.15, lon_deg=11.57, height_m=560}}";
        let (name, change) = match self {
            Self::Circle => ("cn0-ramp", "seed=0"),
            Self::Turns => ("vehicle-turns", "cn0.schedule=[[50, 0], [100, -25]]"),
            Self::Static => ("cn0-ramp", at_rest),
        };
        let file = catalogue::find(name)?.with(&[change.to_owned()])?;
        Scenario::new(&file, Some(seed))
    }
}

/// C/N0 of the fourth strongest satellite, dB-Hz.
fn fourth_dbhz(scenario: &Scenario, elapsed_s: f64) -> Option<f64> {
    let satellites = scenario.satellites().into_iter();
    let mut levels: Vec<f64> = satellites.filter_map(|s| s.cn0_dbhz(elapsed_s)).collect();
    levels.sort_by(|a, b| b.total_cmp(a));
    levels.get(FOURTH - 1).copied()
}

fn is_lost(epoch: &JudgedEpoch) -> bool {
    let [east_m, north_m, _] = epoch.pvt.sigma_enu_m;
    let error_m = epoch.horizontal_m();
    error_m >= LOST_M || error_m > COVERED_SIGMAS * east_m.hypot(north_m)
}

/// C/N0 (dB-Hz) at the last epoch with four satellites in use, before the first that is lost.
fn last_dbhz(motion: Motion, seed: u64) -> Result<f64> {
    let scenario = motion.scenario(seed)?;
    let settings = Settings {
        vector: Some(VectorSettings::default()),
        ..settings(&scenario)
    };
    let judged = receive(&scenario, Level::Correlator, &settings)?;
    let sound = judged.epochs.iter().take_while(|e| !is_lost(e));
    let in_use = |e: &&JudgedEpoch| e.pvt.status == Status::Fix && e.pvt.satellites_used >= FOURTH;
    let last = sound.filter(in_use).last().context("no fix at all")?;
    fourth_dbhz(&scenario, last.pvt.time_s).context("fewer than four satellites")
}

/// Runs of one motion.
#[derive(Debug, Clone)]
struct Row {
    motion: Motion,
    /// In rising order, dB-Hz.
    last_dbhz: Vec<f64>,
}

impl Row {
    fn median_dbhz(&self) -> f64 {
        median(self.last_dbhz.iter().copied())
    }
}

/// All motions.
#[derive(Debug, Clone)]
pub struct Table(Vec<Row>);

/// Receives `seeds` runs of each motion.
///
/// # Errors
/// Where a signal cannot be made or the receiver fails.
pub fn table(seeds: usize) -> Result<Table> {
    ensure!(seeds > 0, "seeds: expected at least one");
    let row = |motion: Motion| {
        let mut last_dbhz = in_parallel(seeds, |seed| last_dbhz(motion, 300 + seed as u64))?;
        last_dbhz.sort_by(f64::total_cmp);
        Ok(Row { motion, last_dbhz })
    };
    Ok(Table(
        Motion::ALL.into_iter().map(row).collect::<Result<_>>()?,
    ))
}

impl Table {
    /// Whether the median of every motion is low enough.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.0
            .iter()
            .all(|row| row.median_dbhz() <= row.motion.goal_dbhz())
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "C/N0 (dB-Hz) of the fourth satellite down to which the position is within 20 m and its stated deviations:"
        )?;
        for row in &self.0 {
            let ends = (row.last_dbhz.first(), row.last_dbhz.last());
            writeln!(
                f,
                "{:8} median {:.1} of {} runs, best {:.1}, worst {:.1}; asked for {:.1}",
                format!("{:?}", row.motion).to_lowercase(),
                row.median_dbhz(),
                row.last_dbhz.len(),
                ends.0.copied().unwrap_or(f64::NAN),
                ends.1.copied().unwrap_or(f64::NAN),
                row.motion.goal_dbhz()
            )?;
        }
        write!(f, "{}", verdict(self.holds()))
    }
}
