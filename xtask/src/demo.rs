//! The main job on an embedded default: make a signal, receive it, judge it, draw the report.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use gnss_nav::SatelliteId;
use receiver::summary::Summary;

use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::command::receive;
use crate::scenario::make::Level;
use crate::validate::verdict;

/// Name of the scenario.
const NAME: &str = "demo";
/// Horizontal error (rms) that fails the demo, m.
const LARGEST_ERROR_M: f64 = 3.0;
/// Time to the first position that fails the demo, s: a frame of 30 s and a little.
const LATEST_FIX_S: f64 = 36.0;

/// What was sent and what the receiver made of it.
#[derive(Debug, Clone)]
pub struct Demo {
    /// What the scenario is.
    pub description: String,
    /// Satellites sent, with C/N0 at the start, dB-Hz.
    pub sent: Vec<(SatelliteId, f64)>,
    /// What the receiver found, judged against the truth.
    pub summary: Summary,
    /// Where the report is.
    pub report: PathBuf,
    /// Time it took, s.
    pub wall_s: f64,
}

/// Makes the demo scenario and receives it as it is made; results go to `out`.
///
/// # Errors
/// Where the signal cannot be made, the receiver fails or a file cannot be written.
pub fn demo(seed: Option<u64>, out: &Path) -> Result<Demo> {
    let begun = Instant::now();
    let scenario = Scenario::new(&catalogue::find(NAME)?, seed)?;
    let satellites = scenario.satellites();
    let sent = scenario.names().into_iter().zip(&satellites);
    let sent = sent.filter_map(|(name, satellite)| Some((name, satellite.cn0_dbhz(0.0)?)));
    Ok(Demo {
        description: scenario.description.clone(),
        sent: sent.collect(),
        summary: receive(&scenario, Level::If, out, &[])?,
        report: out.join("report.html"),
        wall_s: begun.elapsed().as_secs_f64(),
    })
}

impl Demo {
    /// Whether there is a position in time, and it is right.
    #[must_use]
    pub fn holds(&self) -> bool {
        let error = self.summary.error.as_ref();
        let right = error.is_some_and(|error| {
            error.horizontal_rms_m <= LARGEST_ERROR_M && error.availability >= 0.99
        });
        right && self.summary.first_fix_s.is_some_and(|s| s <= LATEST_FIX_S)
    }
}

impl fmt::Display for Demo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let summary = &self.summary;
        writeln!(f, "{}", self.description)?;
        writeln!(f, "sat  C/N0 sent    found    Doppler")?;
        for (satellite, cn0_dbhz) in &self.sent {
            write!(f, "{satellite}  {cn0_dbhz:5.1} dB-Hz  ")?;
            match summary
                .acquired
                .iter()
                .find(|a| a.sat == satellite.to_string())
            {
                Some(a) => writeln!(f, "{:6.1} {:8.1} Hz", a.cn0_dbhz, a.doppler_hz)?,
                None => writeln!(f, "     -")?,
            }
        }
        match (&summary.error, summary.first_fix_s) {
            (Some(error), Some(first_fix_s)) => writeln!(
                f,
                "first position after {first_fix_s:.1} s; horizontal error {:.2} m rms, {:.2} m at most; \
                 vertical {:.2} m rms",
                error.horizontal_rms_m, error.horizontal_max_m, error.vertical_rms_m
            )?,
            _ => writeln!(
                f,
                "no position: {}",
                summary
                    .no_fix_reason
                    .as_deref()
                    .unwrap_or("no reason given")
            )?,
        }
        writeln!(
            f,
            "{:.0} s of signal made and received in {:.1} s; report {}",
            summary.signal_s,
            self.wall_s,
            self.report.display()
        )?;
        let verdict = verdict(self.holds());
        write!(
            f,
            "bound {LARGEST_ERROR_M} m rms, first position by {LATEST_FIX_S} s: {verdict}"
        )
    }
}
