//! `events.jsonl`: one JSON object a line for everything that happens.

use std::path::Path;

use serde::Serialize;

use super::EventSink;
use super::file::OutputFile;
use super::text::rounded;
use crate::ReceiverError;
use crate::record::{Event, EventKind, Record};

/// Name of the file.
pub const FILE_NAME: &str = "events.jsonl";

/// Writes `events.jsonl`.
#[derive(Debug)]
pub struct EventsJsonl {
    file: OutputFile,
}

impl EventsJsonl {
    /// Opens the file in `directory`.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn create(directory: &Path) -> Result<Self, ReceiverError> {
        Ok(Self {
            file: OutputFile::create(directory, FILE_NAME)?,
        })
    }
}

impl EventSink for EventsJsonl {
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError> {
        match record {
            Record::Event(event) => writeln!(self.file, "{}", line(event)),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), ReceiverError> {
        self.file.commit()
    }
}

#[derive(Serialize)]
struct Line<'a> {
    time_s: f64,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    sat: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    prn: Option<u8>,
    #[serde(flatten)]
    detail: Detail<'a>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Detail<'a> {
    Acquired {
        doppler_hz: f64,
        code_phase_chips: f64,
        statistic: f64,
        cn0_dbhz: f64,
    },
    Lock {
        from: &'static str,
        to: &'static str,
    },
    FrameSync {
        tow_s: f64,
    },
    Discontinuity {
        jump_s: f64,
        channels: usize,
    },
    Ephemeris {
        iode: u8,
        iodc: u16,
    },
    Mode {
        to: &'static str,
    },
    Reset {
        channels: usize,
    },
    ClockStep {
        size_m: f64,
    },
    TooFewLeft {
        weighted: usize,
    },
    Alarm {
        monitor: &'a str,
        score: f64,
        threshold: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        residual_m: Option<f64>,
    },
    EpochShort {
        line: u64,
        missing: usize,
    },
    EpochSkipped {
        line: u64,
    },
    Integrity {
        to: &'static str,
    },
    Nothing {},
}

/// Name of a kind of event in the file.
#[must_use]
pub const fn kind_name(kind: &EventKind) -> &'static str {
    match kind {
        EventKind::Acquired(_) => "acquired",
        EventKind::LockChanged { .. } => "lock_changed",
        EventKind::BitSync => "bit_sync",
        EventKind::FrameSync { .. } => "frame_sync",
        EventKind::Dropped => "dropped",
        EventKind::Discontinuity { .. } => "discontinuity",
        EventKind::SpectrumInverted => "spectrum_inverted",
        EventKind::EphemerisDecoded { .. } => "ephemeris_decoded",
        EventKind::IonosphereUtcDecoded => "ionosphere_utc_decoded",
        EventKind::FirstFix => "first_fix",
        EventKind::FixLost => "fix_lost",
        EventKind::Excluded { .. } => "excluded",
        EventKind::Readmitted => "readmitted",
        EventKind::Alarm { .. } => "alarm",
        EventKind::ModeSwitched { .. } => "mode_switched",
        EventKind::EpochShort { .. } => "epoch_short",
        EventKind::EpochSkipped { .. } => "epoch_skipped",
        EventKind::IntegrityChanged { .. } => "integrity_changed",
        EventKind::FilterReset { .. } => "filter_reset",
        EventKind::ClockStep { .. } => "clock_step",
        EventKind::TooFewLeft { .. } => "too_few_left",
    }
}

fn line(event: &Event) -> String {
    let line = Line {
        time_s: rounded(event.time_s, 6),
        kind: kind_name(&event.kind),
        sat: event.satellite.map(|satellite| satellite.to_string()),
        prn: event.satellite.map(|satellite| satellite.prn),
        detail: detail(&event.kind),
    };
    // Plain numbers and strings cannot fail to serialise.
    serde_json::to_string(&line).unwrap_or_default()
}

fn detail(kind: &EventKind) -> Detail<'_> {
    match kind {
        EventKind::Acquired(acquired) => Detail::Acquired {
            doppler_hz: rounded(acquired.doppler_hz, 3),
            code_phase_chips: rounded(acquired.code_phase_chips, 4),
            statistic: rounded(acquired.statistic, 3),
            cn0_dbhz: rounded(acquired.cn0_dbhz, 2),
        },
        EventKind::LockChanged { from, to } => Detail::Lock {
            from: from.name(),
            to: to.name(),
        },
        EventKind::FrameSync { tow_s } => Detail::FrameSync { tow_s: *tow_s },
        EventKind::Discontinuity { jump_s, channels } => Detail::Discontinuity {
            jump_s: rounded(*jump_s, 12),
            channels: *channels,
        },
        EventKind::EphemerisDecoded { iode, iodc } => Detail::Ephemeris {
            iode: *iode,
            iodc: *iodc,
        },
        EventKind::ModeSwitched { to } => Detail::Mode { to: to.name() },
        EventKind::ClockStep { size_m } => Detail::ClockStep {
            size_m: rounded(*size_m, 3),
        },
        EventKind::TooFewLeft { weighted } => Detail::TooFewLeft {
            weighted: *weighted,
        },
        EventKind::FilterReset { channels } => Detail::Reset {
            channels: *channels,
        },
        EventKind::Alarm {
            monitor,
            score,
            threshold,
        } => Detail::Alarm {
            monitor,
            score: *score,
            threshold: *threshold,
            residual_m: None,
        },
        EventKind::Excluded {
            monitor,
            score,
            threshold,
            residual_m,
        } => Detail::Alarm {
            monitor,
            score: *score,
            threshold: *threshold,
            residual_m: residual_m.map(|metres| rounded(metres, 3)),
        },
        EventKind::EpochShort { line, missing } => Detail::EpochShort {
            line: *line,
            missing: *missing,
        },
        EventKind::EpochSkipped { line } => Detail::EpochSkipped { line: *line },
        EventKind::IntegrityChanged { is_available } => Detail::Integrity {
            to: if *is_available {
                "available"
            } else {
                "unavailable"
            },
        },
        EventKind::BitSync
        | EventKind::SpectrumInverted
        | EventKind::Dropped
        | EventKind::IonosphereUtcDecoded
        | EventKind::FirstFix
        | EventKind::FixLost
        | EventKind::Readmitted => Detail::Nothing {},
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::SatelliteId;

    use super::*;
    use crate::record::Lock;

    #[test]
    fn lines_begin_with_time_kind_and_satellite() {
        let event = Event {
            time_s: 1.5,
            satellite: Some(SatelliteId::gps(7)),
            kind: EventKind::LockChanged {
                from: Lock::PullIn,
                to: Lock::Carrier,
            },
        };
        assert_eq!(
            line(&event),
            r#"{"time_s":1.5,"kind":"lock_changed","sat":"G07","prn":7,"from":"pull_in","to":"carrier"}"#
        );
    }

    #[test]
    fn an_event_of_the_whole_receiver_names_no_satellite() {
        let event = Event {
            time_s: 20.0,
            satellite: None,
            kind: EventKind::FirstFix,
        };
        assert_eq!(line(&event), r#"{"time_s":20.0,"kind":"first_fix"}"#);
    }
}
