//! `taps.csv`: every tap of every integration.

use std::path::Path;

use super::EventSink;
use super::file::OutputFile;
use super::text::Fixed;
use crate::ReceiverError;
use crate::record::{Record, TapsRecord};

/// Name of the file.
pub const FILE_NAME: &str = "taps.csv";

/// Writes `taps.csv`, one row for each tap, so that channels may have different taps.
#[derive(Debug)]
pub struct TapsCsv {
    file: OutputFile,
}

impl TapsCsv {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        let mut file = OutputFile::create(directory, FILE_NAME)?;
        writeln!(file, "time_s,sat,prn,duration_s,offset_chips,i,q")?;
        Ok(Self { file })
    }

    fn taps(&mut self, taps: &TapsRecord) -> Result<(), ReceiverError> {
        for (offset_chips, sum) in taps.offsets_chips.iter().zip(&taps.sums) {
            writeln!(
                self.file,
                "{},{},{},{},{},{},{}",
                Fixed(taps.time_s, 9),
                taps.satellite,
                taps.satellite.prn,
                Fixed(taps.duration_s, 9),
                Fixed(*offset_chips, 6),
                Fixed(sum.re, 4),
                Fixed(sum.im, 4),
            )?;
        }
        Ok(())
    }
}

impl EventSink for TapsCsv {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Taps(taps) => self.taps(taps),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        self.file.commit()
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::SatelliteId;
    use num_complex::Complex64;

    use super::*;

    #[test]
    fn one_row_for_each_tap() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = TapsCsv::create(folder.path()).unwrap();
        sink.record(&Record::Taps(TapsRecord {
            time_s: 0.001,
            satellite: SatelliteId::gps(3),
            duration_s: 0.001,
            offsets_chips: vec![-0.5, 0.0],
            sums: vec![Complex64::new(1.0, -2.0), Complex64::new(3.0, 4.0)],
        }))
        .unwrap();
        sink.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(
            rows[0],
            "0.001000000,G03,3,0.001000000,-0.500000,1.0000,-2.0000"
        );
        assert_eq!(rows.len(), 2);
    }
}
