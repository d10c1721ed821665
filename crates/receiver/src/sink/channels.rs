//! `channels.csv`: one row for each channel and navigation epoch.

use std::path::Path;

use super::EventSink;
use super::file::OutputFile;
use super::text::{Fixed, optional};
use crate::ReceiverError;
use crate::record::{ChannelRecord, Record};

/// Name of the file.
pub const FILE_NAME: &str = "channels.csv";

const HEADER: &str = "time_s,sat,prn,cn0_dbhz,lock,loop,prompt_i,prompt_q,code_error_chips,\
frequency_error_hz,pseudorange_m,range_rate_mps,innovation_code_m,innovation_code_sigma_m,\
innovation_rate_mps,innovation_rate_sigma_mps,disposition";

/// Writes `channels.csv`.
#[derive(Debug)]
pub struct ChannelsCsv {
    file: OutputFile,
    monitors: Vec<String>,
}

impl ChannelsCsv {
    /// Opens the file in `directory`, with two columns for each of the running `monitors`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path, monitors: &[String]) -> Result<Self, ReceiverError> {
        let mut file = OutputFile::create(directory, FILE_NAME)?;
        write!(file, "{HEADER}")?;
        for monitor in monitors {
            write!(file, ",score_{monitor},threshold_{monitor}")?;
        }
        writeln!(file)?;
        Ok(Self {
            file,
            monitors: monitors.to_vec(),
        })
    }

    fn channel(&mut self, channel: &ChannelRecord) -> Result<(), ReceiverError> {
        let tracking = channel.tracking;
        write!(
            self.file,
            "{},{},{},{},{},{},{},{},{},{},",
            Fixed(channel.time_s, 6),
            channel.satellite,
            channel.satellite.prn,
            optional(channel.cn0_dbhz, 3),
            tracking.map_or("", |t| t.lock.name()),
            tracking.map_or("", |t| t.membership.name()),
            optional(tracking.map(|t| t.prompt.re), 4),
            optional(tracking.map(|t| t.prompt.im), 4),
            optional(tracking.map(|t| t.code_error_chips), 6),
            optional(tracking.map(|t| t.frequency_error_hz), 4),
        )?;
        let (code, rate) = (channel.innovation_code_m, channel.innovation_rate_mps);
        write!(
            self.file,
            "{},{},{},{},{},{},{}",
            optional(channel.pseudorange_m, 4),
            optional(channel.range_rate_mps, 5),
            optional(code.map(|i| i.value), 4),
            optional(code.map(|i| i.sigma), 4),
            optional(rate.map(|i| i.value), 5),
            optional(rate.map(|i| i.sigma), 5),
            channel.disposition.name(),
        )?;
        self.scores(channel)
    }

    fn scores(&mut self, channel: &ChannelRecord) -> Result<(), ReceiverError> {
        for monitor in &self.monitors {
            let score = channel.scores.iter().find(|s| s.monitor == *monitor);
            write!(
                self.file,
                ",{},{}",
                optional(score.map(|s| s.score), 6),
                optional(score.map(|s| s.threshold), 6)
            )?;
        }
        writeln!(self.file)
    }
}

impl EventSink for ChannelsCsv {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Channel(channel) => self.channel(channel),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        self.file.commit()
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_records::channel;
    use super::*;
    use crate::record::ScoreRecord;

    #[test]
    fn monitors_have_their_columns_and_a_silent_one_leaves_them_empty() {
        let folder = tempfile::tempdir().unwrap();
        let monitors = ["svm".to_owned(), "ewma".to_owned()];
        let mut sink = ChannelsCsv::create(folder.path(), &monitors).unwrap();
        let mut row = channel(0.1, 7);
        row.scores.push(ScoreRecord {
            monitor: "ewma".to_owned(),
            score: 0.5,
            threshold: 1.0,
        });
        sink.record(&Record::Channel(row)).unwrap();
        sink.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join(FILE_NAME)).unwrap();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!(lines[0].len(), 17 + 4);
        assert_eq!(lines[1].len(), lines[0].len());
        assert_eq!(
            lines[0][17..],
            ["score_svm", "threshold_svm", "score_ewma", "threshold_ewma"]
        );
        assert_eq!(lines[1][17..], ["", "", "0.500000", "1.000000"]);
        assert_eq!(lines[1][1..3], ["G07", "7"]);
    }
}
