//! `navigation.rnx`: decoded ephemerides as RINEX 3.05 GPS navigation data.

use std::path::{Path, PathBuf};

use gnss_nav::{Ephemeris, GpsTime};

use super::EventSink;
use super::calendar::{Calendar, leap_seconds};
use super::file::OutputFile;
use super::rinex_header::{Kind, header_line, program_line, version_line};
use super::text::scientific;
use crate::ReceiverError;
use crate::record::{IonosphereUtcRecord, Record};

/// Name of the file.
pub const FILE_NAME: &str = "navigation.rnx";

/// Collects ephemerides and writes `navigation.rnx` at the end, as its header holds values that
/// are decoded late. Without any ephemeris no file is written.
#[derive(Debug)]
pub struct NavigationRinex {
    directory: PathBuf,
    ephemerides: Vec<Ephemeris>,
    ionosphere_utc: Option<IonosphereUtcRecord>,
}

impl NavigationRinex {
    /// Will write to `directory`; that it can is tried at once.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        OutputFile::create(directory, FILE_NAME)?;
        Ok(Self {
            directory: directory.to_owned(),
            ephemerides: Vec::new(),
            ionosphere_utc: None,
        })
    }

    fn insert(&mut self, ephemeris: &Ephemeris) {
        let known = |other: &Ephemeris| {
            other.satellite == ephemeris.satellite
                && other.iodc == ephemeris.iodc
                && other.toe == ephemeris.toe
        };
        if !self.ephemerides.iter().any(known) {
            self.ephemerides.push(*ephemeris);
        }
    }

    fn write(&mut self, first: GpsTime) -> Result<(), ReceiverError> {
        let mut file = OutputFile::create(&self.directory, FILE_NAME)?;
        write!(file, "{}", version_line(Kind::Navigation))?;
        write!(file, "{}", program_line(first))?;
        let leap = leap_seconds(first, self.ionosphere_utc.map(|i| i.leap_seconds));
        if let Some(parameters) = &self.ionosphere_utc {
            write!(file, "{}", ionosphere_lines(parameters))?;
        }
        write!(
            file,
            "{}",
            header_line(&format!("{leap:6}"), "LEAP SECONDS")
        )?;
        write!(file, "{}", header_line("", "END OF HEADER"))?;
        for ephemeris in &self.ephemerides {
            write!(file, "{}", entry(ephemeris))?;
        }
        file.commit()
    }
}

impl EventSink for NavigationRinex {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Ephemeris(ephemeris) => self.insert(ephemeris),
            Record::IonosphereUtc(parameters) => self.ionosphere_utc = Some(*parameters),
            _ => {}
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        let earlier = |a: &Ephemeris, b: &Ephemeris| {
            let by_time = (a.toc - b.toc).total_cmp(&0.0);
            by_time.then(a.satellite.cmp(&b.satellite))
        };
        self.ephemerides.sort_by(earlier);
        match self.ephemerides.first().map(|first| first.toc) {
            Some(first) => self.write(first),
            None => Ok(()),
        }
    }
}

fn ionosphere_lines(parameters: &IonosphereUtcRecord) -> String {
    let coefficients = |name: &str, values: &[f64; 4]| {
        let numbers: String = values.iter().map(|v| scientific(*v, 12, 4)).collect();
        header_line(&format!("{name} {numbers}"), "IONOSPHERIC CORR")
    };
    let time = format!(
        "GPUT {}{}{:7}{:5}",
        scientific(parameters.a0_s, 17, 10),
        scientific(parameters.a1, 16, 9),
        parameters.reference.second(),
        parameters.reference.week(),
    );
    coefficients("GPSA", &parameters.alpha)
        + &coefficients("GPSB", &parameters.beta)
        + &header_line(&time, "TIME SYSTEM CORR")
}

/// One ephemeris: RINEX 3.05, table A6.
fn entry(e: &Ephemeris) -> String {
    let c = Calendar::of(e.toc);
    let mut text = format!(
        "{} {:04} {:02} {:02} {:02} {:02} {:02}",
        e.satellite, c.year, c.month, c.day, c.hour, c.minute, c.second
    );
    for value in [e.af0_s, e.af1, e.af2_per_s] {
        text += &scientific(value, 19, 12);
    }
    text.push('\n');
    // The time of transmission is not kept; the standard's value for that.
    const UNKNOWN_TRANSMISSION: f64 = 0.9999e9;
    let orbit = [
        [f64::from(e.iode), e.crs_m, e.delta_n_rad_s, e.m0_rad],
        [e.cuc_rad, e.eccentricity, e.cus_rad, e.sqrt_a],
        [e.toe.tow_s(), e.cic_rad, e.omega0_rad, e.cis_rad],
        [e.i0_rad, e.crc_m, e.omega_rad, e.omega_dot_rad_s],
        [
            e.idot_rad_s,
            f64::from(e.codes_on_l2),
            f64::from(e.toe.week()),
            f64::from(u8::from(e.l2_p_data_off)),
        ],
        [
            accuracy_m(e.ura_index),
            f64::from(e.health),
            e.tgd_s,
            f64::from(e.iodc),
        ],
    ];
    for line in orbit {
        text += "    ";
        for value in line {
            text += &scientific(value, 19, 12);
        }
        text.push('\n');
    }
    text += "    ";
    text += &scientific(UNKNOWN_TRANSMISSION, 19, 12);
    text += &scientific(fit_interval_h(e), 19, 12);
    text.push('\n');
    text
}

/// Accuracy that RINEX gives for a URA index, m (IS-GPS-200, 20.3.3.3.1.3).
pub(crate) fn accuracy_m(ura_index: u8) -> f64 {
    const ACCURACY_M: [f64; 16] = [
        2.0, 2.8, 4.0, 5.7, 8.0, 11.3, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0,
        4096.0, 8192.0,
    ];
    ACCURACY_M[usize::from(ura_index.min(15))]
}

/// Curve fit interval, h (IS-GPS-200, 20.3.4.4 and table 20-XII).
fn fit_interval_h(ephemeris: &Ephemeris) -> f64 {
    match (ephemeris.fit_interval_extended, ephemeris.iodc) {
        (false, _) => 4.0,
        (true, 240..=247) => 8.0,
        (true, 248..=255 | 496) => 14.0,
        (true, 497..=503 | 1021..=1023) => 26.0,
        (true, 504..=510) => 50.0,
        (true, 511 | 752..=756) => 74.0,
        (true, 757) => 98.0,
        (true, _) => 6.0,
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::{ephemeris, start};
    use super::*;
    use crate::rinex_nav;

    #[test]
    fn what_is_written_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = NavigationRinex::create(folder.path()).unwrap();
        for prn in [12, 7, 12] {
            sink.record(&Record::Ephemeris(ephemeris(prn))).unwrap();
        }
        let parameters = IonosphereUtcRecord {
            alpha: [1.118e-8, -7.451e-9, -5.960e-8, 1.192e-7],
            beta: [1.167e5, -2.294e5, -1.311e5, 1.049e6],
            a0_s: -9.313_225_746e-10,
            a1: -5.329_070_52e-15,
            reference: start(),
            leap_seconds: 18,
        };
        sink.record(&Record::IonosphereUtc(parameters)).unwrap();
        sink.finish().unwrap();
        let path = folder.path().join(FILE_NAME);
        let file = rinex_nav::read(&path).unwrap();
        assert_eq!(file.ephemerides, [ephemeris(7), ephemeris(12)]);
        assert_eq!(file.ionosphere.unwrap().alpha, parameters.alpha);
        assert_eq!(file.ionosphere.unwrap().beta, parameters.beta);
        assert_eq!(file.leap_seconds, Some(18));
        let text = std::fs::read_to_string(path).unwrap();
        let header: Vec<&str> = text.lines().take(7).collect();
        assert!(
            header
                .iter()
                .all(|line| line.len() <= 80 && line.len() > 60),
            "{header:?}"
        );
        assert!(
            text.contains("GPUT -9.3132257460E-10-5.329070520E-15 540000 2190"),
            "{text}"
        );
    }

    #[test]
    fn without_an_ephemeris_there_is_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = NavigationRinex::create(folder.path()).unwrap();
        sink.finish().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
