//! `observations.rnx`: RINEX 3.05 observation data of GPS L1 C/A.

use std::path::Path;

use gnss_nav::GpsTime;
use nalgebra::Vector3;

use super::EventSink;
use super::calendar::{Calendar, leap_seconds, on_grid};
use super::file::OutputFile;
use super::rinex_header::{Kind, header_line, program_line, version_line};
use super::text::Fixed;
use crate::ReceiverError;
use crate::record::{Observation, ObservationEpoch, Record, Status};

/// Name of the file.
pub const FILE_NAME: &str = "observations.rnx";

/// Writes `observations.rnx`: pseudorange, carrier phase where one is tracked, Doppler and C/N0.
/// Without any observation no file is written.
#[derive(Debug)]
pub struct ObservationsRinex {
    file: OutputFile,
    /// Bytes before the line of the approximate position, once the header is written.
    position_offset: Option<u64>,
    position_ecef_m: Option<Vector3<f64>>,
}

impl ObservationsRinex {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        Ok(Self {
            file: OutputFile::create(directory, FILE_NAME)?,
            position_offset: None,
            position_ecef_m: None,
        })
    }

    fn epoch(&mut self, epoch: &ObservationEpoch) -> Result<(), ReceiverError> {
        if epoch.observations.is_empty() {
            return Ok(());
        }
        let time = on_grid(epoch.time, 7);
        if self.position_offset.is_none() {
            self.header(time)?;
        }
        let c = Calendar::of(time);
        writeln!(
            self.file,
            "> {:04} {:02} {:02} {:02} {:02}{:11.7}  0{:3}",
            c.year,
            c.month,
            c.day,
            c.hour,
            c.minute,
            c.seconds(),
            epoch.observations.len(),
        )?;
        for observation in &epoch.observations {
            writeln!(self.file, "{}", line(observation))?;
        }
        Ok(())
    }

    fn header(&mut self, first: GpsTime) -> Result<(), ReceiverError> {
        let before = [
            version_line(Kind::Observation),
            program_line(first),
            header_line("NONE", "MARKER NAME"),
            header_line("", "OBSERVER / AGENCY"),
            header_line(
                concat!(
                    "                    software            ",
                    env!("CARGO_PKG_VERSION")
                ),
                "REC # / TYPE / VERS",
            ),
            header_line("", "ANT # / TYPE"),
        ]
        .concat();
        let c = Calendar::of(first);
        let date = format!(
            "{:6}{:6}{:6}{:6}{:6}{:13.7}     GPS",
            c.year,
            c.month,
            c.day,
            c.hour,
            c.minute,
            c.seconds()
        );
        let after = [
            header_line(
                "        0.0000        0.0000        0.0000",
                "ANTENNA: DELTA H/E/N",
            ),
            header_line("G    4 C1C L1C D1C S1C", "SYS / # / OBS TYPES"),
            header_line("DBHZ", "SIGNAL STRENGTH UNIT"),
            header_line(&date, "TIME OF FIRST OBS"),
            header_line("G L1C", "SYS / PHASE SHIFT"),
            header_line(&format!("{:6}", leap_seconds(first, None)), "LEAP SECONDS"),
            header_line("", "END OF HEADER"),
        ]
        .concat();
        self.position_offset = Some(before.len() as u64);
        let position = position_line(&Vector3::zeros());
        write!(self.file, "{before}{position}{after}")
    }
}

impl EventSink for ObservationsRinex {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Observations(epoch) => self.epoch(epoch),
            Record::Pvt(pvt) => {
                if pvt.status == Status::Fix {
                    self.position_ecef_m = Some(pvt.position_ecef_m);
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        let Some(offset) = self.position_offset else {
            return Ok(());
        };
        if let Some(position_ecef_m) = &self.position_ecef_m {
            self.file.patch(offset, &position_line(position_ecef_m))?;
        }
        self.file.commit()
    }
}

fn position_line(ecef_m: &Vector3<f64>) -> String {
    let numbers = format!("{:14.4}{:14.4}{:14.4}", ecef_m.x, ecef_m.y, ecef_m.z);
    header_line(&numbers, "APPROX POSITION XYZ")
}

fn line(observation: &Observation) -> String {
    // The indicator is blank where the strength is unknown, and where there is nothing it speaks of.
    let strength = observation
        .cn0_dbhz
        .map_or_else(|| " ".to_owned(), |cn0| signal_strength(cn0).to_string());
    let doppler = observation.doppler_hz.map_or_else(
        || " ".repeat(16),
        |doppler_hz| format!("{} {strength}", value(doppler_hz)),
    );
    let phase = observation.carrier_phase.map_or_else(
        || " ".repeat(16),
        |phase| {
            let flags = u8::from(phase.loss_of_lock) + 2 * u8::from(phase.half_cycle);
            // Zero and blank both mean nothing to report.
            let flags = if flags == 0 {
                " ".to_owned()
            } else {
                flags.to_string()
            };
            format!("{}{flags}{strength}", value(phase.cycles))
        },
    );
    let text = format!(
        "{}{} {strength}{phase}{doppler}{}",
        observation.satellite,
        value(observation.pseudorange_m),
        value(observation.cn0_dbhz.unwrap_or(f64::NAN)),
    );
    text.trim_end().to_owned()
}

/// A number in 14 columns, or blanks where it does not fit or is none.
fn value(number: f64) -> String {
    let text = format!("{:>14}", Fixed(number, 3));
    if text.len() == 14 {
        text
    } else {
        " ".repeat(14)
    }
}

/// RINEX signal strength indicator: C/N0 in steps of 6 dB, 1 to 9.
fn signal_strength(cn0_dbhz: f64) -> u8 {
    (cn0_dbhz / 6.0).floor().clamp(1.0, 9.0) as u8
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::{observations, pvt};
    use super::*;

    fn written(time_s: f64) -> String {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = ObservationsRinex::create(folder.path()).unwrap();
        sink.record(&Record::Observations(observations(time_s)))
            .unwrap();
        sink.record(&Record::Pvt(pvt(time_s))).unwrap();
        sink.finish().unwrap();
        std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap()
    }

    #[test]
    fn columns_are_those_of_the_standard() {
        let text = written(59.999_999_99);
        let (header, body) = text.split_once("END OF HEADER").unwrap();
        assert!(
            header
                .lines()
                .all(|line| line.len() == 80 || line.len() == 60),
            "{header}"
        );
        let lines: Vec<&str> = body.lines().skip(1).collect();
        // 10 ns before the minute rounds to the minute, not to 60 seconds.
        assert_eq!(lines[0], "> 2022 01 01 06 01  0.0000000  0  4");
        // Loss of lock (1) and half cycle (2) stand together beside the phase.
        assert_eq!(
            lines[1],
            "G07  21000000.125 7      1234.56737      1690.000 7        44.500"
        );
        let blank_phase = &lines[4][19..35];
        assert_eq!(blank_phase.trim(), "");
        assert!(header.contains("  2022     1     1     6     1    0.0000000     GPS"));
        let position = header.lines().find(|l| l.contains("APPROX")).unwrap();
        let x: f64 = position[..14].trim().parse().unwrap();
        // Printed with four decimals.
        assert!((x - pvt(0.0).position_ecef_m.x).abs() < 1e-4);
    }

    #[test]
    fn numbers_too_large_for_their_columns_are_left_out() {
        assert_eq!(value(-1e12).trim(), "");
        assert_eq!(value(f64::NAN).trim(), "");
        assert_eq!(signal_strength(44.5), 7);
        assert_eq!(signal_strength(f64::NAN), 0);
    }

    #[test]
    fn another_program_reads_it() {
        let text = written(1.5);
        let mut reader = std::io::BufReader::new(text.as_bytes());
        let rinex = rinex::prelude::Rinex::parse(&mut reader).unwrap();
        let record = rinex.record.as_obs().unwrap();
        let signals: usize = record.values().map(|epoch| epoch.signals.len()).sum();
        // Four satellites with four observables, one of them without a phase.
        assert_eq!(signals, 15);
    }
}
