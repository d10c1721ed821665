//! Header lines common to both RINEX files.

use gnss_nav::GpsTime;

use super::calendar::{Calendar, leap_seconds, on_grid};

/// Which of the two files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Observation,
    Navigation,
}

/// `content` padded to 60 columns, then the label.
pub(super) fn header_line(content: &str, label: &str) -> String {
    format!("{content:<60}{label:<20}\n")
}

pub(super) fn version_line(kind: Kind) -> String {
    let content = match kind {
        Kind::Observation => "     3.05           OBSERVATION DATA    G: GPS",
        Kind::Navigation => "     3.05           N: GNSS NAV DATA    G: GPS",
    };
    header_line(content, "RINEX VERSION / TYPE")
}

/// The program and the date: that of the signal, so that the same input gives the same file.
pub(super) fn program_line(time: GpsTime) -> String {
    let utc = on_grid(time, 0) - f64::from(leap_seconds(time, None));
    let c = Calendar::of(utc);
    let date = format!(
        "{:04}{:02}{:02} {:02}{:02}{:02} UTC",
        c.year, c.month, c.day, c.hour, c.minute, c.second
    );
    let program = concat!("receiver ", env!("CARGO_PKG_VERSION"));
    header_line(
        &format!("{program:<20}{:<20}{date:<20}", ""),
        "PGM / RUN BY / DATE",
    )
}
