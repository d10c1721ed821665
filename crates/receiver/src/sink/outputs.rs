//! All output files of a run.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::EventSink;
use super::channels::{self, ChannelsCsv};
use super::events::{self, EventsJsonl};
use super::file::{OutputFile, create_directory};
use super::kml::{self, TrackKml};
use super::navigation::{self, NavigationRinex};
use super::nmea::{self, TrackNmea};
use super::observations::{self, ObservationsRinex};
use super::position::{self, PositionFile};
use super::pvt::{self, PvtCsv};
use super::report::{self, Report};
use super::taps::{self, TapsCsv};
use crate::ReceiverError;
use crate::cost::Cost;
use crate::record::Record;
use crate::summary::{Summary, SummaryBuilder};
use crate::truth::{RunSpan, Truth, compare};

/// What to write, and where.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OutputSettings {
    /// Directory for the files; only the summary is made where absent.
    pub directory: Option<PathBuf>,
    /// Names of the running monitors, which have columns in `channels.csv`.
    pub monitors: Vec<String>,
    /// Whether `taps.csv` is written.
    pub dump_taps: bool,
    /// Whether `track.pos` is written.
    pub position_file: bool,
    /// Title of the report.
    pub title: String,
    /// Files that the run reads: none of them may be one that it writes.
    pub inputs: Vec<PathBuf>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Ending {
    /// Signal received, s.
    pub signal_s: f64,
    /// Why there was no fix, where there was none.
    pub no_fix_reason: Option<String>,
    /// Truth to compare with, and which part of it the run covers.
    pub truth: Option<(Truth, RunSpan)>,
}

/// Writes every output file of a run and builds its summary.
pub struct Outputs {
    directory: Option<PathBuf>,
    sinks: Vec<Box<dyn EventSink>>,
    report: Option<Report>,
    summary: SummaryBuilder,
}

impl Outputs {
    /// Creates the directory and opens all files; what cannot be written is found out now, not
    /// after hours of signal.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn open(settings: &OutputSettings) -> Result<Self, ReceiverError> {
        let mut outputs = Self {
            directory: settings.directory.clone(),
            sinks: Vec::new(),
            report: None,
            summary: SummaryBuilder::default(),
        };
        let Some(directory) = &settings.directory else {
            return Ok(outputs);
        };
        create_directory(directory)?;
        spare(&settings.inputs, directory)?;
        for late in [SUMMARY_NAME, COST_NAME] {
            OutputFile::create(directory, late)?;
        }
        outputs.sinks = vec![
            Box::new(PvtCsv::create(directory)?),
            Box::new(ChannelsCsv::create(directory, &settings.monitors)?),
            Box::new(EventsJsonl::create(directory)?),
            Box::new(ObservationsRinex::create(directory)?),
            Box::new(NavigationRinex::create(directory)?),
            Box::new(TrackKml::create(directory)?),
            Box::new(TrackNmea::create(directory)?),
        ];
        if settings.position_file {
            outputs
                .sinks
                .push(Box::new(PositionFile::create(directory)?));
        }
        if settings.dump_taps {
            outputs.sinks.push(Box::new(TapsCsv::create(directory)?));
        }
        outputs.report = Some(Report::create(directory, &settings.title)?);
        Ok(outputs)
    }

    /// Takes one record.
    ///
    /// # Errors
    /// [`ReceiverError::File`] where a file cannot be written.
    pub fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        self.summary.record(record);
        if let Some(report) = &mut self.report {
            report.record(record);
        }
        self.sinks
            .iter_mut()
            .try_for_each(|sink| sink.record(record))
    }

    /// Mean number of channels over the navigation epochs that had any.
    #[must_use]
    pub fn channels_mean(&self) -> f64 {
        self.summary.channels_mean()
    }

    /// Completes every file, compares with the truth and writes the report and `summary.json`.
    ///
    /// # Errors
    /// The first that occurs; files that could be completed stay.
    pub fn finish(mut self, ending: Ending) -> Result<Summary, ReceiverError> {
        let mut result = Ok(());
        for sink in &mut self.sinks {
            result = result.and(sink.finish());
        }
        result?;
        let mut summary = self.summary.finish(ending.signal_s, ending.no_fix_reason);
        let Some(directory) = &self.directory else {
            return Ok(summary);
        };
        if let Some((truth, span)) = &ending.truth {
            let report = &mut self.report;
            summary.error = compare(&directory.join(pvt::FILE_NAME), truth, span, |error| {
                if let Some(report) = report {
                    report.error(error);
                }
            })?;
        }
        if let Some(report) = self.report {
            report.finish(&summary)?;
        }
        write_json(directory, SUMMARY_NAME, &summary)?;
        Ok(summary)
    }
}

const SUMMARY_NAME: &str = "summary.json";
const COST_NAME: &str = "cost.json";

/// Every file that a run may write.
const NAMES: [&str; 12] = [
    SUMMARY_NAME,
    COST_NAME,
    pvt::FILE_NAME,
    channels::FILE_NAME,
    events::FILE_NAME,
    observations::FILE_NAME,
    navigation::FILE_NAME,
    kml::FILE_NAME,
    nmea::FILE_NAME,
    position::FILE_NAME,
    taps::FILE_NAME,
    report::FILE_NAME,
];

/// Refuses to write over what is read.
fn spare(inputs: &[PathBuf], directory: &Path) -> Result<(), ReceiverError> {
    let written: Vec<PathBuf> = NAMES
        .iter()
        .filter_map(|name| directory.join(name).canonicalize().ok())
        .collect();
    let lost = |input: &&PathBuf| {
        input
            .canonicalize()
            .is_ok_and(|path| written.contains(&path))
    };
    inputs.iter().find(lost).map_or(Ok(()), |input| {
        Err(ReceiverError::Option {
            what: format!(
                "{}: is read and would be written: expected another --out",
                input.display()
            ),
        })
    })
}

/// Writes `cost.json` into `directory`.
///
/// # Errors
/// [`ReceiverError::File`].
pub fn write_cost(directory: &Path, cost: &Cost) -> Result<(), ReceiverError> {
    write_json(directory, COST_NAME, cost)
}

fn write_json(directory: &Path, name: &str, value: &impl Serialize) -> Result<(), ReceiverError> {
    let mut file = OutputFile::create(directory, name)?;
    let text = serde_json::to_string_pretty(value).map_err(|error| ReceiverError::File {
        path: file.path().to_owned(),
        source: error.into(),
    })?;
    writeln!(file, "{text}")?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::sample_records::{channel, ephemeris, observations, pvt};
    use super::*;

    fn run(directory: &Path) -> Summary {
        let settings = OutputSettings {
            directory: Some(directory.to_owned()),
            title: "test".to_owned(),
            ..OutputSettings::default()
        };
        let mut outputs = Outputs::open(&settings).unwrap();
        outputs.record(&Record::Ephemeris(ephemeris(7))).unwrap();
        for i in 1..50 {
            let time_s = 0.1 * f64::from(i);
            outputs
                .record(&Record::Observations(observations(time_s)))
                .unwrap();
            for prn in [7, 12, 25, 31] {
                outputs
                    .record(&Record::Channel(channel(time_s, prn)))
                    .unwrap();
            }
            outputs.record(&Record::Pvt(pvt(time_s))).unwrap();
        }
        let ending = Ending {
            signal_s: 5.0,
            no_fix_reason: None,
            truth: None,
        };
        outputs.finish(ending).unwrap()
    }

    fn files(directory: &Path) -> BTreeMap<String, Vec<u8>> {
        std::fs::read_dir(directory)
            .unwrap()
            .map(|entry| {
                let entry = entry.unwrap();
                let name = entry.file_name().into_string().unwrap();
                (name, std::fs::read(entry.path()).unwrap())
            })
            .collect()
    }

    #[test]
    fn what_is_read_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("navigation.rnx");
        std::fs::write(&input, "of a station").unwrap();
        let settings = OutputSettings {
            directory: Some(folder.path().to_owned()),
            inputs: vec![folder.path().join(".").join("navigation.rnx")],
            ..OutputSettings::default()
        };
        let refused = Outputs::open(&settings).err().unwrap().to_string();
        assert!(refused.contains("navigation.rnx: is read"), "{refused}");
        assert_eq!(std::fs::read_to_string(&input).unwrap(), "of a station");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_same_records_give_the_same_bytes() {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let summary = run(a.path());
        run(b.path());
        assert_eq!(summary.fixes, 49);
        let found = files(a.path());
        assert_eq!(
            found.keys().collect::<Vec<_>>(),
            [
                "channels.csv",
                "events.jsonl",
                "navigation.rnx",
                "observations.rnx",
                "pvt.csv",
                "report.html",
                "summary.json",
                "track.kml",
                "track.nmea"
            ]
        );
        assert!(found == files(b.path()), "files differ");
    }

    #[test]
    fn a_run_that_fails_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let settings = OutputSettings {
            directory: Some(folder.path().join("deep/er")),
            ..OutputSettings::default()
        };
        let mut outputs = Outputs::open(&settings).unwrap();
        outputs.record(&Record::Pvt(pvt(0.1))).unwrap();
        drop(outputs);
        assert!(files(&folder.path().join("deep/er")).is_empty());
    }

    #[test]
    fn a_directory_that_cannot_be_is_named_before_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let in_the_way = folder.path().join("file");
        std::fs::write(&in_the_way, "").unwrap();
        let settings = OutputSettings {
            directory: Some(in_the_way.join("out")),
            ..OutputSettings::default()
        };
        let message = Outputs::open(&settings).err().unwrap().to_string();
        assert!(message.contains("file/out: "), "{message}");
    }
}
