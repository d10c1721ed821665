//! `track.kml`: the track for a map.

use std::path::Path;

use gnss_nav::Geodetic;

use super::EventSink;
use super::file::OutputFile;
use super::text::Fixed;
use crate::ReceiverError;
use crate::record::{PvtRecord, Record, Status};

/// Name of the file.
pub const FILE_NAME: &str = "track.kml";

const OPENING: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2">
<Document>
<name>Track</name>
<Style id="track"><LineStyle><color>ff2f6fdb</color><width>3</width></LineStyle></Style>
"#;

const TRACK_OPENING: &str = "<Placemark><styleUrl>#track</styleUrl><LineString>\
<altitudeMode>absolute</altitudeMode><coordinates>\n";

const TRACK_CLOSING: &str = "</coordinates></LineString></Placemark>\n";

/// Writes `track.kml`: one line for each stretch of solutions, interrupted where they are
/// unreliable, and a mark at the first and the last. Heights are above the ellipsoid. Without any
/// solution no file is written.
#[derive(Debug)]
pub struct TrackKml {
    file: OutputFile,
    first: Option<Geodetic>,
    last: Option<Geodetic>,
    in_track: bool,
}

impl TrackKml {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        let mut file = OutputFile::create(directory, FILE_NAME)?;
        write!(file, "{OPENING}")?;
        Ok(Self {
            file,
            first: None,
            last: None,
            in_track: false,
        })
    }

    fn solution(&mut self, pvt: &PvtRecord) -> Result<(), ReceiverError> {
        if pvt.status == Status::Unreliable {
            return self.end_track();
        }
        if !self.in_track {
            write!(self.file, "{TRACK_OPENING}")?;
            self.in_track = true;
        }
        let place = Geodetic::from_ecef(&pvt.position_ecef_m);
        writeln!(self.file, "{}", coordinates(&place))?;
        self.first.get_or_insert(place);
        self.last = Some(place);
        Ok(())
    }

    fn end_track(&mut self) -> Result<(), ReceiverError> {
        if std::mem::take(&mut self.in_track) {
            write!(self.file, "{TRACK_CLOSING}")?;
        }
        Ok(())
    }

    fn mark(&mut self, name: &str, place: &Geodetic) -> Result<(), ReceiverError> {
        writeln!(
            self.file,
            "<Placemark><name>{name}</name><Point><altitudeMode>absolute</altitudeMode>\
             <coordinates>{}</coordinates></Point></Placemark>",
            coordinates(place)
        )
    }
}

impl EventSink for TrackKml {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Pvt(pvt) => self.solution(pvt),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        self.end_track()?;
        let (Some(first), Some(last)) = (self.first, self.last) else {
            return Ok(());
        };
        self.mark("first", &first)?;
        self.mark("last", &last)?;
        writeln!(self.file, "</Document>\n</kml>")?;
        self.file.commit()
    }
}

fn coordinates(place: &Geodetic) -> String {
    format!(
        "{},{},{}",
        Fixed(place.lon_rad.to_degrees(), 9),
        Fixed(place.lat_rad.to_degrees(), 9),
        Fixed(place.height_m, 3)
    )
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::pvt;
    use super::*;

    #[test]
    fn an_unreliable_solution_interrupts_the_line() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = TrackKml::create(folder.path()).unwrap();
        let mut unreliable = pvt(0.3);
        unreliable.status = Status::Unreliable;
        for solution in [pvt(0.1), pvt(0.2), unreliable, pvt(0.4)] {
            sink.record(&Record::Pvt(solution)).unwrap();
        }
        sink.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        assert_eq!(text.matches("<LineString>").count(), 2);
        assert_eq!(text.matches("</LineString>").count(), 2);
        assert_eq!(text.matches("139.766247000,35.681298000,10.000").count(), 5);
    }
}
