//! A time written as a date and a time of day.

use gnss_nav::{Calendar, GpsTime};

use super::{columns, number};

/// Columns of year, month, day, hour, minute and of the second.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stamp {
    pub(crate) date: [(usize, usize); 5],
    pub(crate) second: (usize, usize),
}

impl Stamp {
    /// The time in these columns of `text`; none where they hold none.
    pub(crate) fn read(&self, text: &[u8]) -> Option<GpsTime> {
        let date = self.date.map(|(from, to)| number::<i32>(text, from, to));
        let [Some(year), Some(month), Some(day), Some(hour), Some(minute)] = date else {
            return None;
        };
        let small = |value: i32| u8::try_from(value).ok();
        let (from, to) = self.second;
        let (second, fraction_s) = second(columns(text, from, to))?;
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
    }
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
