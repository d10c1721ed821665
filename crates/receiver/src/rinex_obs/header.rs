//! Header of an observation file.

use nalgebra::Vector3;

use crate::lines::Lines;
use crate::rinex_text::{Failure, columns, label, number, shown, version};

/// What a header says of GPS L1 C/A.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObservationHeader {
    /// Major version, 2 or 3.
    pub version: u8,
    /// Approximate position of the antenna, ECEF, m; absent where all coordinates are zero.
    pub position_ecef_m: Option<Vector3<f64>>,
    /// Interval between epochs, s.
    pub interval_s: Option<f64>,
    /// Leap seconds, GPS minus UTC.
    pub leap_seconds: Option<i32>,
    pub(super) layout: Layout,
    /// Version of Hatanaka's compression, 1 or 3.
    pub(super) compression: Option<u8>,
}

/// Which of the observables of a GPS satellite are wanted: pseudorange, phase, Doppler, strength.
pub(super) const WANTED: usize = 4;

/// Where the observables of GPS L1 C/A stand.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Layout {
    /// Observables of a GPS satellite.
    pub(super) count: usize,
    /// Position of each wanted one among them.
    pub(super) places: [Option<usize>; WANTED],
}

/// Names of the wanted observables by major version.
const NAMES_2: [&[u8]; WANTED] = [b"C1", b"L1", b"D1", b"S1"];
const NAMES_3: [&[u8]; WANTED] = [b"C1C", b"L1C", b"D1C", b"S1C"];

/// More observables than any receiver has: a count above is damage.
const MOST_OBSERVABLES: usize = 500;

/// Reads a header up to its end.
pub(super) fn read(lines: &mut Lines) -> Result<ObservationHeader, Failure> {
    let mut header = ObservationHeader::default();
    next(lines)?;
    if label(lines.current()) == b"CRINEX VERS   / TYPE" {
        header.compression = Some(match columns(lines.current(), 0, 20) {
            b"1.0" => 1,
            b"3.0" | b"3.1" => 3,
            other => {
                let found = shown(other);
                return Err(Failure::at(
                    lines,
                    format!("compression version '{found}': expected 1.0 or 3.0"),
                ));
            }
        });
        next(lines)?;
        next(lines)?;
    }
    first_line(lines, &mut header)?;
    let mut reading = Reading::default();
    loop {
        next(lines)?;
        if label(lines.current()) == b"END OF HEADER" {
            break;
        }
        reading.line(lines, &mut header)?;
    }
    if header.layout.places[0].is_none() {
        let name = if header.version == 2 { "C1" } else { "C1C" };
        return Err(Failure::at(
            lines,
            format!("no observable {name} of GPS: expected pseudoranges of GPS L1 C/A"),
        ));
    }
    Ok(header)
}

fn next(lines: &mut Lines) -> Result<(), Failure> {
    if lines.advance()? {
        return Ok(());
    }
    Err(Failure::at(
        lines,
        "no RINEX observation file: the header has no end".to_owned(),
    ))
}

fn first_line(lines: &Lines, header: &mut ObservationHeader) -> Result<(), Failure> {
    header.version = version(lines)?;
    if columns(lines.current(), 20, 21) != b"O" {
        let found = shown(columns(lines.current(), 20, 40));
        return Err(Failure::at(
            lines,
            format!("a RINEX file of '{found}': expected observation data"),
        ));
    }
    Ok(())
}

/// Reads lines of a header, also of one that stands between epochs.
#[derive(Debug, Default)]
pub(super) struct Reading {
    /// Observables of GPS read so far, while more lines of them are to come.
    read: usize,
    /// The system whose observables are being read.
    system: u8,
}

impl Reading {
    /// Takes the current line.
    pub(super) fn line(
        &mut self,
        lines: &Lines,
        header: &mut ObservationHeader,
    ) -> Result<(), Failure> {
        let line = lines.current();
        match label(line) {
            b"# / TYPES OF OBSERV" if header.version == 2 => {
                let places = (0..9).map(|k| columns(line, 10 + 6 * k, 12 + 6 * k));
                let count = columns(line, 0, 6);
                self.observables(lines, header, (count, places, &NAMES_2))
            }
            b"SYS / # / OBS TYPES" if header.version == 3 => {
                if let Some(&system) = columns(line, 0, 1).first() {
                    self.system = system;
                }
                if self.system != b'G' {
                    return Ok(());
                }
                let places = (0..13).map(|k| columns(line, 7 + 4 * k, 10 + 4 * k));
                let count = columns(line, 3, 6);
                self.observables(lines, header, (count, places, &NAMES_3))
            }
            b"SYS / SCALE FACTOR" if matches!(line.first(), Some(b'G' | b' ')) => Err(Failure::at(
                lines,
                "scale factors: expected observations in their own units".to_owned(),
            )),
            b"TIME OF FIRST OBS" => time_system(lines),
            b"APPROX POSITION XYZ" => {
                let [x, y, z] = [0, 14, 28].map(|k| number(line, k, k + 14).unwrap_or(0.0));
                let position = Vector3::new(x, y, z);
                let is_place = position.norm() > 1.0 && position.norm() < 1e8;
                header.position_ecef_m = is_place.then_some(position);
                Ok(())
            }
            b"INTERVAL" => {
                header.interval_s = number(line, 0, 10).filter(|s: &f64| *s > 0.0);
                Ok(())
            }
            b"LEAP SECONDS" => {
                header.leap_seconds = number(line, 0, 6);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Takes a line of observables; one with a count starts a new list.
    fn observables<'a>(
        &mut self,
        lines: &Lines,
        header: &mut ObservationHeader,
        (count, places, names): (&[u8], impl Iterator<Item = &'a [u8]>, &[&[u8]; WANTED]),
    ) -> Result<(), Failure> {
        if !count.is_empty() {
            let stated = std::str::from_utf8(count).ok().and_then(|t| t.parse().ok());
            let stated = stated.filter(|n| *n <= MOST_OBSERVABLES).ok_or_else(|| {
                let found = shown(count);
                Failure::at(lines, format!("'{found}' observables: expected a count"))
            })?;
            header.layout = Layout {
                count: stated,
                places: [None; WANTED],
            };
            self.read = 0;
        }
        for name in places.filter(|name| !name.is_empty()) {
            if self.read >= header.layout.count {
                return Err(Failure::at(
                    lines,
                    format!("more observables than the {} stated", header.layout.count),
                ));
            }
            if let Some(which) = names.iter().position(|wanted| *wanted == name) {
                header.layout.places[which] = Some(self.read);
            }
            self.read += 1;
        }
        Ok(())
    }
}

fn time_system(lines: &Lines) -> Result<(), Failure> {
    match columns(lines.current(), 48, 51) {
        // Galileo's and QZSS's time agree with GPS time to nanoseconds.
        b"GPS" | b"GAL" | b"QZS" | b"" => Ok(()),
        other => {
            let found = shown(other);
            Err(Failure::at(
                lines,
                format!("epochs in time system '{found}': expected GPS"),
            ))
        }
    }
}
