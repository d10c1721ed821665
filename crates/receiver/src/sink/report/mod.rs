//! `report.html`: one self-contained page with drawings, made without any network.

mod chart;
mod page;
mod series;
mod sky;
mod stanford;

use std::collections::BTreeMap;
use std::path::Path;

use gnss_nav::{Geodetic, SatelliteId};
use nalgebra::Vector3;

use super::file::OutputFile;
use crate::ReceiverError;
use crate::record::{
    ChannelRecord, Event, EventKind, InnovationRecord, LoopMembership, ObservationEpoch, PvtRecord,
    Record, Status,
};
use crate::summary::Summary;
use crate::truth::SolutionError;
use chart::Mark;
use series::Series;
use stanford::Stanford;

/// Name of the file.
pub const FILE_NAME: &str = "report.html";

/// Most events marked in the charts; a page with more is not read.
const MOST_MARKS: usize = 60;

/// Most marks with their names beside them; more would cover one another, and the table of faults has them.
const MOST_LABELS: usize = 8;

/// The monitor whose chart is drawn.
const SHAPE_MONITOR: &str = "ewma";

/// Collects what the page shows, in memory that does not grow with the length of the run.
#[derive(Debug)]
pub struct Report {
    file: OutputFile,
    title: String,
    satellites: BTreeMap<SatelliteId, SatelliteHistory>,
    marks: Vec<(f64, String)>,
    origin: Option<(Geodetic, Vector3<f64>)>,
    track: sky::Path<2>,
    height_m: Series,
    horizontal_error_m: Series,
    vertical_error_m: Series,
    /// Horizontal, then vertical.
    stanford: [Stanford; 2],
    /// Whether the run went over to vector tracking, which states no protection levels: those of the few epochs before
    /// are no picture of the run.
    is_vector: bool,
}

#[derive(Debug, Default)]
struct SatelliteHistory {
    cn0_dbhz: Series,
    /// Innovation of the pseudorange over its standard deviation.
    innovation: Series,
    /// Mean of the chart on the shape of the correlation over its limit.
    shape: Series,
    sky: sky::Path<2>,
}

impl Report {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path, title: &str) -> Result<Self, ReceiverError> {
        Ok(Self {
            file: OutputFile::create(directory, FILE_NAME)?,
            title: title.to_owned(),
            satellites: BTreeMap::new(),
            marks: Vec::new(),
            origin: None,
            track: sky::Path::default(),
            height_m: Series::default(),
            horizontal_error_m: Series::default(),
            vertical_error_m: Series::default(),
            stanford: Default::default(),
            is_vector: false,
        })
    }

    /// Takes one record.
    pub fn record(&mut self, record: &Record) {
        match record {
            Record::Channel(channel) => self.channel(channel),
            Record::Observations(epoch) => self.observations(epoch),
            Record::Pvt(pvt) => self.solution(pvt),
            Record::Event(event) => self.event(event),
            Record::Ephemeris(_) | Record::IonosphereUtc(_) | Record::Taps(_) => {}
        }
    }

    /// Takes the error of one solution, after the run.
    pub fn error(&mut self, error: &SolutionError) {
        let p = &error.position_enu_m;
        self.horizontal_error_m.push(error.time_s, p.x.hypot(p.y));
        self.vertical_error_m.push(error.time_s, p.z);
        let stated = error.protection_m.filter(|_| !self.is_vector);
        if let Some([horizontal_m, vertical_m]) = stated {
            let [horizontal, vertical] = &mut self.stanford;
            horizontal.push(p.x.hypot(p.y), horizontal_m);
            vertical.push(p.z, vertical_m);
        }
    }

    /// Draws the page.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn finish(mut self, summary: &Summary) -> Result<(), ReceiverError> {
        let text = page::page(&self, summary);
        write!(self.file, "{text}")?;
        self.file.commit()
    }

    fn channel(&mut self, channel: &ChannelRecord) {
        let history = self.satellites.entry(channel.satellite).or_default();
        if let Some(cn0_dbhz) = channel.cn0_dbhz {
            history.cn0_dbhz.push(channel.time_s, cn0_dbhz);
        }
        if let Some(InnovationRecord { value, sigma }) = channel.innovation_code_m {
            history.innovation.push(channel.time_s, value / sigma);
        }
        if let Some(score) = channel.scores.iter().find(|s| s.monitor == SHAPE_MONITOR) {
            history
                .shape
                .push(channel.time_s, score.score / score.threshold);
        }
    }

    fn observations(&mut self, epoch: &ObservationEpoch) {
        for observation in &epoch.observations {
            if let (Some(azimuth), Some(elevation)) =
                (observation.azimuth_rad, observation.elevation_rad)
            {
                let history = self.satellites.entry(observation.satellite).or_default();
                history.sky.push([azimuth, elevation]);
            }
        }
    }

    fn solution(&mut self, pvt: &PvtRecord) {
        if pvt.status == Status::Unreliable {
            return;
        }
        let place = Geodetic::from_ecef(&pvt.position_ecef_m);
        let (origin, origin_ecef_m) = self.origin.get_or_insert((place, pvt.position_ecef_m));
        let enu = origin.enu_from_ecef() * (pvt.position_ecef_m - *origin_ecef_m);
        self.track.push([enu.x, enu.y]);
        self.height_m.push(pvt.time_s, place.height_m);
    }

    fn event(&mut self, event: &Event) {
        self.is_vector |= matches!(
            event.kind,
            EventKind::ModeSwitched {
                to: LoopMembership::Vector
            }
        );
        let what = match &event.kind {
            EventKind::Excluded { .. } => "excluded",
            EventKind::Readmitted => "readmitted",
            EventKind::Discontinuity { .. } => "sample jump",
            EventKind::FirstFix => "first fix",
            EventKind::FixLost => "fix lost",
            EventKind::Alarm { .. } => "alarm",
            EventKind::FilterReset { .. } => "filter reset",
            EventKind::TooFewLeft { weighted: 0 } => "faulty left out",
            EventKind::TooFewLeft { .. } => "faulty weighted",
            EventKind::ModeSwitched {
                to: LoopMembership::Vector,
            } => "vector tracking",
            EventKind::ModeSwitched {
                to: LoopMembership::Scalar,
            } => "scalar tracking",
            _ => return,
        };
        if self.marks.len() < MOST_MARKS {
            let label = event.satellite.map_or_else(
                || what.to_owned(),
                |satellite| format!("{satellite} {what}"),
            );
            self.marks.push((event.time_s, label));
        }
    }

    fn chart_marks(&self) -> Vec<Mark> {
        let is_legible = self.marks.len() <= MOST_LABELS;
        self.marks
            .iter()
            .map(|(time_s, label)| Mark {
                time_s: *time_s,
                label: if is_legible {
                    label.clone()
                } else {
                    String::new()
                },
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::{channel, observations, pvt};
    use super::*;
    use crate::summary::SummaryBuilder;

    #[test]
    fn the_page_is_self_contained_and_survives_hostile_text() {
        let folder = tempfile::tempdir().unwrap();
        let mut report = Report::create(folder.path(), "<script>&").unwrap();
        let mut builder = SummaryBuilder::default();
        for i in 0..3 {
            let time_s = f64::from(i);
            let mut row = channel(time_s, 7);
            row.innovation_code_m = Some(InnovationRecord {
                value: f64::NAN,
                sigma: 1.0,
            });
            for record in [
                Record::Observations(observations(time_s)),
                Record::Channel(row),
                Record::Pvt(pvt(time_s)),
            ] {
                report.record(&record);
                builder.record(&record);
            }
        }
        report.finish(&builder.finish(3.0, None)).unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        assert!(text.contains("&lt;script&gt;&amp;"));
        for foreign in ["http://", "https://", "<script", "NaN"] {
            assert!(!text.contains(foreign), "{foreign}");
        }
    }

    /// The page of a run of one epoch, with these events.
    fn page_of(events: &[EventKind]) -> String {
        let folder = tempfile::tempdir().unwrap();
        let mut report = Report::create(folder.path(), "run").unwrap();
        for kind in events {
            report.record(&Record::Event(Event {
                time_s: 0.5,
                satellite: None,
                kind: kind.clone(),
            }));
        }
        report.error(&SolutionError {
            time_s: 1.0,
            position_enu_m: Vector3::new(1.0, -2.0, 3.0),
            velocity_enu_mps: None,
            protection_m: Some([12.0, 20.0]),
        });
        report
            .finish(&SummaryBuilder::default().finish(1.0, None))
            .unwrap();
        std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap()
    }

    #[test]
    fn protection_is_drawn_of_runs_that_state_it() {
        assert!(page_of(&[]).contains("Horizontal protection"));
        let to = LoopMembership::Vector;
        assert!(!page_of(&[EventKind::ModeSwitched { to }]).contains("Horizontal protection"));
    }

    #[test]
    fn a_run_without_anything_still_has_a_page_that_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let report = Report::create(folder.path(), "empty").unwrap();
        let reason = Some("no satellite acquired".to_owned());
        report
            .finish(&SummaryBuilder::default().finish(1.0, reason))
            .unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        assert!(text.contains("no satellite acquired"));
    }
}
