//! `track.pos`: solutions in the form of `RTKLIB`'s position files, ECEF.

use std::path::Path;

use super::EventSink;
use super::calendar::on_grid;
use super::file::OutputFile;
use super::text::Fixed;
use crate::ReceiverError;
use crate::record::{PvtRecord, Record, Status};

/// Name of the file.
pub const FILE_NAME: &str = "track.pos";

const HEADER: &str = concat!(
    "% program   : receiver ",
    env!("CARGO_PKG_VERSION"),
    "\n%\n% (x/y/z-ecef=WGS84,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)\n",
    "%  GPST              x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns   sdx(m)   sdy(m)   ",
    "sdz(m)  sdxy(m)  sdyz(m)  sdzx(m) age(s)  ratio",
);

/// Quality of a position without carrier phases or corrections.
const SINGLE: u8 = 5;

/// Writes `track.pos`: reliable solutions alone, as the format knows no other.
#[derive(Debug)]
pub struct PositionFile {
    file: OutputFile,
}

impl PositionFile {
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
        let time = on_grid(pvt.time, 3);
        let (p, c) = (&pvt.position_ecef_m, &pvt.position_covariance_ecef_m2);
        writeln!(
            self.file,
            "{:4} {:10} {:14} {:14} {:14} {SINGLE:3} {:3} {:8} {:8} {:8} {:8} {:8} {:8} {:6} {:6}",
            time.week(),
            Fixed(time.tow_s(), 3),
            Fixed(p.x, 4),
            Fixed(p.y, 4),
            Fixed(p.z, 4),
            pvt.satellites_used,
            root(c[(0, 0)]),
            root(c[(1, 1)]),
            root(c[(2, 2)]),
            root(c[(0, 1)]),
            root(c[(1, 2)]),
            root(c[(2, 0)]),
            Fixed(0.0, 2),
            Fixed(0.0, 1),
        )
    }
}

/// A covariance as the format writes it: its root, with its sign.
fn root(covariance_m2: f64) -> Fixed {
    Fixed(covariance_m2.abs().sqrt().copysign(covariance_m2), 4)
}

impl EventSink for PositionFile {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Pvt(pvt) if pvt.status != Status::Unreliable => self.solution(pvt),
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
    fn columns_stand_where_other_programs_look_for_them() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = PositionFile::create(folder.path()).unwrap();
        let mut solution = pvt(0.1);
        solution.position_covariance_ecef_m2[(0, 1)] = -4.0;
        sink.record(&Record::Pvt(solution)).unwrap();
        let mut unreliable = pvt(0.2);
        unreliable.status = Status::Unreliable;
        sink.record(&Record::Pvt(unreliable)).unwrap();
        sink.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        let rows: Vec<&str> = text.lines().filter(|l| !l.starts_with('%')).collect();
        assert_eq!(rows.len(), 1);
        let fields: Vec<&str> = rows[0].split_whitespace().collect();
        assert_eq!(fields.len(), 15);
        assert_eq!(fields[..2], ["2190", "540000.100"]);
        assert_eq!((fields[5], fields[6], fields[10]), ("5", "9", "-2.0000"));
        // Every column is as wide as in RTKLIB's own files.
        assert_eq!(rows[0].len(), 136);
    }
}
