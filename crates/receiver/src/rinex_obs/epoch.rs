//! The line that begins an epoch.

use gnss_nav::GpsTime;

use crate::lines::Lines;
use crate::rinex_text::{Failure, Stamp, columns, number, shown};

/// What follows the line of an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// Observations at this time.
    Observations(GpsTime),
    /// Lines of a header or comments.
    Lines,
    /// Cycle slips, written like observations.
    Slips,
}

/// The line that begins an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EpochHead {
    /// What follows.
    pub(super) kind: Kind,
    /// How many satellites, or lines.
    pub(super) count: usize,
}

/// Columns of the fields, by version.
struct Columns {
    stamp: Stamp,
    flag: usize,
    count: (usize, usize),
}

const COLUMNS_2: Columns = Columns {
    stamp: Stamp {
        date: [(1, 3), (4, 6), (7, 9), (10, 12), (13, 15)],
        second: (15, 26),
    },
    flag: 28,
    count: (29, 32),
};

const COLUMNS_3: Columns = Columns {
    stamp: Stamp {
        date: [(2, 6), (7, 9), (10, 12), (13, 15), (16, 18)],
        second: (18, 29),
    },
    flag: 31,
    count: (32, 35),
};

/// Where the satellites of an epoch are listed: version 2, and compressed files.
pub(super) const fn list_column(version: u8) -> usize {
    if version == 2 { 32 } else { 41 }
}

/// Reads `text`, the line of an epoch; `lines` says where it stands.
pub(super) fn parse(lines: &Lines, text: &[u8], version: u8) -> Result<EpochHead, Failure> {
    let layout = if version == 2 { COLUMNS_2 } else { COLUMNS_3 };
    if version == 3 && text.first() != Some(&b'>') {
        let found = shown(text);
        return Err(Failure::at(
            lines,
            format!("'{found}': expected the line of an epoch, which begins with >"),
        ));
    }
    let flag = columns(text, layout.flag, layout.flag + 1);
    let (from, to) = layout.count;
    let count = number(text, from, to).ok_or_else(|| {
        let found = shown(columns(text, from, to));
        Failure::at(
            lines,
            format!("an epoch of '{found}' satellites: expected a number"),
        )
    })?;
    let kind = match flag {
        b"0" | b"1" | b"" => Kind::Observations(time(lines, text, &layout)?),
        b"2" | b"3" | b"4" | b"5" => Kind::Lines,
        b"6" => Kind::Slips,
        other => {
            let found = shown(other);
            return Err(Failure::at(
                lines,
                format!("epoch flag '{found}': expected 0 to 6"),
            ));
        }
    };
    Ok(EpochHead { kind, count })
}

fn time(lines: &Lines, text: &[u8], layout: &Columns) -> Result<GpsTime, Failure> {
    layout.stamp.read(text).ok_or_else(|| {
        let found = shown(columns(text, 1, layout.stamp.second.1));
        Failure::at(
            lines,
            format!("an epoch at '{found}': expected year month day hour minute second"),
        )
    })
}
