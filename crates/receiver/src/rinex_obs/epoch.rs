//! The line that begins an epoch.

use gnss_nav::{Calendar, GpsTime};

use super::Failure;
use super::lines::{Lines, columns, number, shown};

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
    date: [(usize, usize); 5],
    second: (usize, usize),
    flag: usize,
    count: (usize, usize),
}

const COLUMNS_2: Columns = Columns {
    date: [(1, 3), (4, 6), (7, 9), (10, 12), (13, 15)],
    second: (15, 26),
    flag: 28,
    count: (29, 32),
};

const COLUMNS_3: Columns = Columns {
    date: [(2, 6), (7, 9), (10, 12), (13, 15), (16, 18)],
    second: (18, 29),
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
    let date = layout.date.map(|(from, to)| number::<i32>(text, from, to));
    let (from, to) = layout.second;
    let parsed = match date {
        [Some(year), Some(month), Some(day), Some(hour), Some(minute)] => {
            let small = |value: i32| u8::try_from(value).ok();
            second(columns(text, from, to)).and_then(|(second, fraction_s)| {
                let date = Calendar {
                    year: full_year(year),
                    month: small(month)?,
                    day: small(day)?,
                    hour: small(hour)?,
                    minute: small(minute)?,
                    second,
                    fraction_s,
                };
                GpsTime::try_from(date).ok()
            })
        }
        _ => None,
    };
    parsed.ok_or_else(|| {
        let found = shown(columns(text, 1, to));
        Failure::at(
            lines,
            format!("an epoch at '{found}': expected year month day hour minute second"),
        )
    })
}

/// A year of two digits is one of 1980 to 2079.
const fn full_year(year: i32) -> i32 {
    match year {
        80..=99 => 1900 + year,
        0..=79 => 2000 + year,
        _ => year,
    }
}

/// Whole seconds and fraction, apart, so that nothing is rounded.
fn second(text: &[u8]) -> Option<(u8, f64)> {
    let text = std::str::from_utf8(text).ok()?;
    let (whole, fraction) = text.split_once('.').unwrap_or((text, "0"));
    if fraction.is_empty() || !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let fraction_s: f64 = format!("0.{fraction}").parse().ok()?;
    Some((whole.trim().parse().ok()?, fraction_s))
}
