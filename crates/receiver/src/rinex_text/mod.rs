//! What RINEX files of every kind have in common: numbered lines of columns, times, and what is
//! said of a damaged one.

mod columns;
mod stamp;

use std::io;
use std::path::Path;

use crate::ReceiverError;
use crate::lines::Lines;

pub(crate) use columns::{columns, label, number, shown};
pub(crate) use stamp::Stamp;

/// Why a file cannot be read on.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The system said so.
    Io(io::Error),
    /// It is not what it should be.
    Content(String),
}

impl Failure {
    /// `what` is wrong with the line read last.
    pub(crate) fn at(lines: &Lines, what: String) -> Self {
        Self::Content(format!("line {}: {what}", lines.number()))
    }

    /// The error of the file at `path`.
    pub(crate) fn of(self, path: &Path) -> ReceiverError {
        match self {
            Self::Io(source) => ReceiverError::File {
                path: path.to_owned(),
                source,
            },
            Self::Content(what) => ReceiverError::Content {
                path: path.to_owned(),
                what,
            },
        }
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Major version by the first line of a file, 2 or 3.
pub(crate) fn version(lines: &Lines) -> Result<u8, Failure> {
    let line = lines.current();
    if label(line) != b"RINEX VERSION / TYPE" {
        return Err(Failure::at(
            lines,
            "no RINEX file: expected 'RINEX VERSION / TYPE' in columns 61 to 80".to_owned(),
        ));
    }
    let stated: f64 = number(line, 0, 9).unwrap_or(f64::NAN);
    match stated {
        v if (2.0..3.0).contains(&v) => Ok(2),
        v if (3.0..4.0).contains(&v) => Ok(3),
        _ => {
            let found = shown(columns(line, 0, 9));
            let what = format!("RINEX version '{found}': expected 2 or 3");
            Err(Failure::at(lines, what))
        }
    }
}
