//! Header of a navigation file.

use gnss_nav::Klobuchar;

use super::message::real;
use crate::lines::Lines;
use crate::rinex_text::{Failure, columns, label, number, shown, version};

/// What a header says of GPS.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Header {
    /// Major version, 2 or 3.
    pub(super) version: u8,
    /// Leap seconds, GPS minus UTC.
    pub(super) leap_seconds: Option<i32>,
    alpha: Option<[f64; 4]>,
    beta: Option<[f64; 4]>,
}

impl Header {
    /// Klobuchar parameters, where both lines of them are there.
    pub(super) fn ionosphere(&self) -> Option<Klobuchar> {
        Some(Klobuchar {
            alpha: self.alpha?,
            beta: self.beta?,
        })
    }

    fn line(&mut self, lines: &Lines) -> Result<(), Failure> {
        let line = lines.current();
        match (label(line), columns(line, 0, 4)) {
            (b"ION ALPHA", _) => self.alpha = four(lines, 2)?,
            (b"ION BETA", _) => self.beta = four(lines, 2)?,
            (b"IONOSPHERIC CORR", b"GPSA") => self.alpha = four(lines, 5)?,
            (b"IONOSPHERIC CORR", b"GPSB") => self.beta = four(lines, 5)?,
            (b"LEAP SECONDS", _) => self.leap_seconds = number(line, 0, 6),
            _ => {}
        }
        Ok(())
    }
}

/// Four numbers of twelve columns.
fn four(lines: &Lines, first: usize) -> Result<Option<[f64; 4]>, Failure> {
    let mut found = [0.0; 4];
    for (k, value) in found.iter_mut().enumerate() {
        let from = first + 12 * k;
        match real(lines, from, from + 12)? {
            Some(number) => *value = number,
            None => return Ok(None),
        }
    }
    Ok(Some(found))
}

/// Reads a header up to its end.
pub(super) fn read(lines: &mut Lines) -> Result<Header, Failure> {
    next(lines)?;
    let line = lines.current();
    let mut header = Header {
        version: version(lines)?,
        ..Header::default()
    };
    if columns(line, 20, 21) != b"N" {
        let found = shown(columns(line, 20, 40));
        return Err(Failure::at(
            lines,
            format!("a RINEX file of '{found}': expected navigation data of GPS"),
        ));
    }
    loop {
        next(lines)?;
        if label(lines.current()) == b"END OF HEADER" {
            return Ok(header);
        }
        header.line(lines)?;
    }
}

fn next(lines: &mut Lines) -> Result<(), Failure> {
    if lines.advance()? {
        return Ok(());
    }
    Err(Failure::at(
        lines,
        "no RINEX navigation file: the header has no end".to_owned(),
    ))
}
