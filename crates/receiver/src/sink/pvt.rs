//! `pvt.csv`: one row for each solution.

use std::path::Path;

use super::EventSink;
use super::calendar::on_grid;
use super::file::OutputFile;
use super::text::{Fixed, optional};
use crate::ReceiverError;
use crate::record::{PvtRecord, Record, VelocityRecord};
use gnss_nav::geodesy::Geodetic;

/// Name of the file.
pub const FILE_NAME: &str = "pvt.csv";

const HEADER: &str = "time_s,week,tow_s,lat_deg,lon_deg,height_m,x_m,y_m,z_m,\
vx_mps,vy_mps,vz_mps,clock_bias_m,clock_drift_mps,satellites_used,pdop,source,\
sigma_e_m,sigma_n_m,sigma_u_m,sigma_v_mps,hpl_m,vpl_m,status";

/// Writes `pvt.csv`.
#[derive(Debug)]
pub struct PvtCsv {
    file: OutputFile,
}

impl PvtCsv {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        let mut file = OutputFile::create(directory, FILE_NAME)?;
        writeln!(file, "{HEADER}")?;
        Ok(Self { file })
    }

    fn solution(&mut self, pvt: &PvtRecord) -> Result<(), ReceiverError> {
        let time = on_grid(pvt.time, 9);
        let place = Geodetic::from_ecef(&pvt.position_ecef_m);
        let p = &pvt.position_ecef_m;
        let velocity = |component: fn(&VelocityRecord) -> f64, decimals| {
            optional(pvt.velocity.as_ref().map(component), decimals)
        };
        let [e, n, u] = pvt.sigma_enu_m;
        write!(
            self.file,
            "{},{},{},{},{},{},{},{},{},{},{},{},",
            Fixed(pvt.time_s, 6),
            time.week(),
            Fixed(time.tow_s(), 9),
            Fixed(place.lat_rad.to_degrees(), 9),
            Fixed(place.lon_rad.to_degrees(), 9),
            Fixed(place.height_m, 4),
            Fixed(p.x, 4),
            Fixed(p.y, 4),
            Fixed(p.z, 4),
            velocity(|v| v.ecef_mps.x, 5),
            velocity(|v| v.ecef_mps.y, 5),
            velocity(|v| v.ecef_mps.z, 5),
        )?;
        writeln!(
            self.file,
            "{},{},{},{},{},{},{},{},{},{},{},{}",
            Fixed(pvt.clock_bias_m, 4),
            velocity(|v| v.clock_drift_mps, 5),
            pvt.satellites_used,
            Fixed(pvt.pdop, 3),
            pvt.source.name(),
            Fixed(e, 3),
            Fixed(n, 3),
            Fixed(u, 3),
            velocity(|v| v.sigma_mps, 4),
            optional(pvt.horizontal_protection_m, 3),
            optional(pvt.vertical_protection_m, 3),
            pvt.status.name(),
        )
    }
}

impl EventSink for PvtCsv {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Pvt(pvt) => self.solution(pvt),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        self.file.commit()
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::pvt;
    use super::*;

    #[test]
    fn a_row_has_every_column_and_names_its_source() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = PvtCsv::create(folder.path()).unwrap();
        sink.record(&Record::Pvt(pvt(0.1))).unwrap();
        sink.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2);
        let names: Vec<&str> = lines[0].split(',').collect();
        let values: Vec<&str> = lines[1].split(',').collect();
        assert_eq!(names.len(), 24);
        assert_eq!(values.len(), names.len());
        assert_eq!(values[0], "0.100000");
        assert_eq!(values[16], "least_squares");
        // No protection level was computed.
        assert_eq!((values[21], values[23]), ("", "fix"));
        let height: f64 = values[5].parse().unwrap();
        // The record's position was made from this height; printed with four decimals.
        assert!((height - 10.0).abs() < 1e-3, "{height}");
    }
}
