//! `track.nmea`: NMEA 0183 sentences GGA, RMC, GSA, GSV and GST for every solution.

use std::collections::BTreeSet;
use std::path::Path;

use gnss_nav::{Geodetic, GpsTime, SatelliteId};
use nalgebra::{Matrix4, Vector4};

use super::EventSink;
use super::calendar::{Calendar, leap_seconds, on_grid};
use super::file::OutputFile;
use super::text::{Fixed, optional};
use crate::ReceiverError;
use crate::record::{Disposition, Observation, PvtRecord, Record, Status};

/// Name of the file.
pub const FILE_NAME: &str = "track.nmea";

/// Writes `track.nmea`. Times are UTC; heights are above the ellipsoid (geoid separation 0), as no
/// geoid model is carried. Without any solution no file is written.
#[derive(Debug)]
pub struct TrackNmea {
    file: OutputFile,
    sky: Vec<Observation>,
    used: BTreeSet<SatelliteId>,
    leap_seconds: Option<i32>,
    any: bool,
}

impl TrackNmea {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        Ok(Self {
            file: OutputFile::create(directory, FILE_NAME)?,
            sky: Vec::new(),
            used: BTreeSet::new(),
            leap_seconds: None,
            any: false,
        })
    }

    fn solution(&mut self, pvt: &PvtRecord) -> Result<(), ReceiverError> {
        self.any = true;
        let moment = Moment::of(pvt, self.leap_seconds);
        let directions: Vec<_> = self
            .sky
            .iter()
            .filter(|o| self.used.contains(&o.satellite))
            .collect();
        let (hdop, vdop) = dilutions(&directions);
        for body in [
            moment.gga(pvt, hdop),
            moment.rmc(pvt),
            gsa(pvt, &self.used, hdop, vdop),
            moment.gst(pvt),
        ] {
            write!(self.file, "{}", sentence(&body))?;
        }
        for body in gsv(&self.sky) {
            write!(self.file, "{}", sentence(&body))?;
        }
        Ok(())
    }
}

impl EventSink for TrackNmea {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Observations(epoch) => self.sky.clone_from(&epoch.observations),
            Record::Channel(channel) => {
                match channel.disposition {
                    Disposition::Use | Disposition::Deweight { .. } => {
                        self.used.insert(channel.satellite)
                    }
                    Disposition::Exclude | Disposition::Unavailable => {
                        self.used.remove(&channel.satellite)
                    }
                };
            }
            Record::IonosphereUtc(parameters) => self.leap_seconds = Some(parameters.leap_seconds),
            Record::Pvt(pvt) => {
                self.solution(pvt)?;
                // Those of the next epoch tell of themselves.
                self.used.clear();
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        if self.any { self.file.commit() } else { Ok(()) }
    }
}

/// Time and place of a solution as the sentences write them.
struct Moment {
    time: String,
    date: String,
    latitude: String,
    longitude: String,
    height_m: f64,
    /// Speed over ground, knots, and course, degrees; `None` where no velocity is known.
    motion: Option<(f64, f64)>,
}

impl Moment {
    fn of(pvt: &PvtRecord, leap: Option<i32>) -> Self {
        let leap = f64::from(leap_seconds(pvt.time, leap));
        let utc: GpsTime = on_grid(pvt.time - leap, 2);
        let c = Calendar::of(utc);
        let place = Geodetic::from_ecef(&pvt.position_ecef_m);
        let motion = pvt.velocity.map(|velocity| {
            const KNOTS_PER_MPS: f64 = 3600.0 / 1852.0;
            let v = place.enu_from_ecef() * velocity.ecef_mps;
            let course_deg = v.x.atan2(v.y).to_degrees().rem_euclid(360.0);
            (v.x.hypot(v.y) * KNOTS_PER_MPS, course_deg)
        });
        Self {
            time: format!("{:02}{:02}{:05.2}", c.hour, c.minute, c.seconds()),
            date: format!("{:02}{:02}{:02}", c.day, c.month, c.year % 100),
            latitude: angle(place.lat_rad.to_degrees(), 2, ['N', 'S']),
            longitude: angle(place.lon_rad.to_degrees(), 3, ['E', 'W']),
            height_m: place.height_m,
            motion,
        }
    }

    fn gga(&self, pvt: &PvtRecord, hdop: f64) -> String {
        let quality = match pvt.status {
            Status::Fix => 1,
            Status::Predicted => 6,
            Status::Unreliable => 0,
        };
        format!(
            "GPGGA,{},{},{},{quality},{:02},{},{},M,0.0,M,,",
            self.time,
            self.latitude,
            self.longitude,
            pvt.satellites_used,
            Fixed(hdop, 1),
            Fixed(self.height_m, 3),
        )
    }

    fn rmc(&self, pvt: &PvtRecord) -> String {
        let (validity, mode) = match pvt.status {
            Status::Fix => ('A', 'A'),
            Status::Predicted => ('A', 'E'),
            Status::Unreliable => ('V', 'N'),
        };
        format!(
            "GPRMC,{},{validity},{},{},{},{},{},,,{mode}",
            self.time,
            self.latitude,
            self.longitude,
            optional(self.motion.map(|m| m.0), 3),
            optional(self.motion.map(|m| m.1), 1),
            self.date,
        )
    }

    fn gst(&self, pvt: &PvtRecord) -> String {
        let [east, north, up] = pvt.sigma_enu_m;
        format!(
            "GPGST,{},,,,,{},{},{}",
            self.time,
            Fixed(north, 3),
            Fixed(east, 3),
            Fixed(up, 3)
        )
    }
}

fn gsa(pvt: &PvtRecord, used: &BTreeSet<SatelliteId>, hdop: f64, vdop: f64) -> String {
    let fix = if pvt.status == Status::Unreliable {
        1
    } else {
        3
    };
    let mut satellites: Vec<String> = used.iter().map(|s| format!("{:02}", s.prn)).collect();
    satellites.resize(12, String::new());
    format!(
        "GPGSA,A,{fix},{},{},{},{}",
        satellites.join(","),
        Fixed(pvt.pdop, 1),
        Fixed(hdop, 1),
        Fixed(vdop, 1)
    )
}

/// Satellites in view, four in a sentence.
fn gsv(sky: &[Observation]) -> Vec<String> {
    let groups = sky.chunks(4);
    let total = groups.len();
    let satellite = |o: &Observation| {
        let field = |value: Option<f64>, width: usize| {
            value.map_or_else(String::new, |v| format!("{:0width$}", v.round() as i64))
        };
        format!(
            ",{:02},{},{},{}",
            o.satellite.prn,
            field(o.elevation_rad.map(f64::to_degrees), 2),
            field(o.azimuth_rad.map(|a| a.to_degrees().rem_euclid(360.0)), 3),
            field(o.cn0_dbhz, 2)
        )
    };
    groups
        .enumerate()
        .map(|(i, group)| {
            let list: String = group.iter().map(satellite).collect();
            format!("GPGSV,{total},{},{:02}{list}", i + 1, sky.len())
        })
        .collect()
}

/// Degrees and minutes with the hemisphere.
fn angle(degrees: f64, width: usize, hemispheres: [char; 2]) -> String {
    const STEPS_PER_DEGREE: f64 = 60e6;
    let steps = (degrees.abs() * STEPS_PER_DEGREE).round();
    let whole = (steps / STEPS_PER_DEGREE).floor();
    let minutes = (steps - whole * STEPS_PER_DEGREE) / 1e6;
    let hemisphere = hemispheres[usize::from(degrees < 0.0)];
    format!("{whole:0width$}{minutes:09.6},{hemisphere}")
}

/// Horizontal and vertical dilution of precision of satellites in these directions.
fn dilutions(satellites: &[&Observation]) -> (f64, f64) {
    let mut normal = Matrix4::zeros();
    for satellite in satellites {
        let (Some(azimuth), Some(elevation)) = (satellite.azimuth_rad, satellite.elevation_rad)
        else {
            continue;
        };
        let row = Vector4::new(
            azimuth.sin() * elevation.cos(),
            azimuth.cos() * elevation.cos(),
            elevation.sin(),
            1.0,
        );
        normal += row * row.transpose();
    }
    match normal.try_inverse() {
        Some(q) => ((q[(0, 0)] + q[(1, 1)]).sqrt(), q[(2, 2)].sqrt()),
        None => (f64::NAN, f64::NAN),
    }
}

/// `body` between `$` and its checksum.
fn sentence(body: &str) -> String {
    let checksum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{checksum:02X}\r\n")
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::{channel, observations, pvt};
    use super::*;

    #[test]
    fn a_known_checksum() {
        let body = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,";
        assert!(sentence(body).ends_with("*47\r\n"));
    }

    #[test]
    fn angles_carry_into_the_degree() {
        assert_eq!(angle(-33.5, 2, ['N', 'S']), "3330.000000,S");
        assert_eq!(angle(9.999_999_999_9, 3, ['E', 'W']), "01000.000000,E");
    }

    #[test]
    fn every_solution_has_its_sentences() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = TrackNmea::create(folder.path()).unwrap();
        sink.record(&Record::Observations(observations(0.1)))
            .unwrap();
        for prn in [7, 12, 25, 31] {
            sink.record(&Record::Channel(channel(0.1, prn))).unwrap();
        }
        sink.record(&Record::Pvt(pvt(0.1))).unwrap();
        // Of the others nothing is heard any more.
        sink.record(&Record::Channel(channel(0.2, 12))).unwrap();
        sink.record(&Record::Pvt(pvt(0.2))).unwrap();
        sink.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        // 06:00:00.1 GPS time is 18 s ahead of UTC.
        assert!(
            lines[0].starts_with("$GPGGA,055942.10,3540.877880,N,13945.974820,E,1,09,"),
            "{}",
            lines[0]
        );
        assert!(lines[0].contains(",10.000,M,0.0,M,,*"));
        assert!(
            lines[1].contains(",A,") && lines[1].contains(",010122,"),
            "{}",
            lines[1]
        );
        assert!(
            lines[2].starts_with("$GPGSA,A,3,07,12,25,31,,,,,,,,,1.9,"),
            "{}",
            lines[2]
        );
        let last = lines.iter().rfind(|line| line.starts_with("$GPGSA"));
        assert!(last.unwrap().starts_with("$GPGSA,A,3,12,,,"), "{last:?}");
        assert!(lines[3].contains(",,,,,0.600,0.500,1.100*"), "{}", lines[3]);
        assert!(
            lines[4].starts_with("$GPGSV,1,1,04,07,70,010,4"),
            "{}",
            lines[4]
        );
    }
}
