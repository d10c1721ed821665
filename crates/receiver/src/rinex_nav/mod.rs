//! Broadcast ephemerides and ionosphere parameters from RINEX navigation files (versions 2 and 3,
//! plain or gzip).
//!
//! Read by columns; messages of other systems are passed over. The `rinex` crate, which reads those
//! too, is what the tests hold it against.

mod header;
mod message;
#[cfg(test)]
mod tests;

use std::io::{BufRead, Cursor};
use std::path::Path;

use gnss_nav::{Ephemeris, Klobuchar, SatelliteId};

use crate::ReceiverError;
use crate::lines::Lines;
use crate::rinex_text::Failure;

/// What a RINEX navigation file says about GPS.
#[derive(Debug, Clone, PartialEq)]
pub struct NavigationFile {
    /// Every GPS LNAV ephemeris, by reference time of the clock and then by satellite.
    pub ephemerides: Vec<Ephemeris>,
    /// Klobuchar parameters, where the file has them.
    pub ionosphere: Option<Klobuchar>,
    /// Leap seconds, GPS minus UTC, where the file has them.
    pub leap_seconds: Option<i32>,
}

impl NavigationFile {
    /// Satellites with an ephemeris, in order and once each.
    #[must_use]
    pub fn satellites(&self) -> Vec<SatelliteId> {
        let mut all: Vec<_> = self.ephemerides.iter().map(|e| e.satellite).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// Reads the file at `path`.
///
/// # Errors
/// [`ReceiverError::File`] where it cannot be read; [`ReceiverError::Content`], naming the line, where
/// it is no RINEX 2 or 3 navigation file, holds no GPS ephemeris, or one of them lacks a value.
pub fn read(path: &Path) -> Result<NavigationFile, ReceiverError> {
    let lines = Lines::open(path).map_err(Failure::from);
    lines
        .and_then(read_lines)
        .map_err(|failure| failure.of(path))
}

/// Reads uncompressed text from anywhere; `name` stands for it in errors.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &Path, text: &[u8]) -> Result<NavigationFile, ReceiverError> {
    let text: Box<dyn BufRead> = Box::new(Cursor::new(text.to_vec()));
    read_lines(Lines::new(text)).map_err(|failure| failure.of(name))
}

fn read_lines(mut lines: Lines) -> Result<NavigationFile, Failure> {
    let header = header::read(&mut lines)?;
    let mut ephemerides = Vec::new();
    while let Some(ephemeris) = message::next(&mut lines, header.version)? {
        ephemerides.push(ephemeris);
    }
    if ephemerides.is_empty() {
        return Err(Failure::Content("holds no GPS ephemeris".to_owned()));
    }
    ephemerides.sort_by(|a, b| {
        let later = (a.toc - b.toc).total_cmp(&0.0);
        later.then(a.satellite.cmp(&b.satellite))
    });
    Ok(NavigationFile {
        ephemerides,
        ionosphere: header.ionosphere(),
        leap_seconds: header.leap_seconds,
    })
}
