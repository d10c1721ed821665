//! Opens recordings: a file or standard input, from where the run is to begin.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use gnss_signal::SignalError;
use gnss_signal::sample::ReaderSource;

use crate::ReceiverError;
use crate::config::{Input, Recording};
use crate::progress::{Counted, Progress};

/// Samples of an open recording.
pub type Source = ReaderSource<Counted<Box<dyn Read + Send>>>;

/// Opens `recording` at its start, reporting to the progress bar it returns.
///
/// The start is rounded down to a whole byte where several samples share one.
///
/// # Errors
/// [`ReceiverError::File`] where it cannot be opened or read; [`ReceiverError::Content`] where it
/// is empty or ends before the start.
pub fn open(recording: &Recording, quiet: bool) -> Result<(Source, Progress), ReceiverError> {
    let bits_per_sample = recording.samples.format.bits_per_sample() as f64;
    let bytes_per_s = recording.samples.sample_rate_hz * bits_per_sample / 8.0;
    let skip = start_byte(recording);
    let (reader, length): (Box<dyn Read + Send>, Option<u64>) = match &recording.input {
        Input::File(path) => {
            let file_error = |source| ReceiverError::File {
                path: path.clone(),
                source,
            };
            let mut file = File::open(path).map_err(file_error)?;
            let metadata = file.metadata().map_err(file_error)?;
            if metadata.is_file() {
                let left = left_after(skip, metadata.len(), recording)?;
                file.seek(SeekFrom::Start(skip)).map_err(file_error)?;
                (Box::new(file), Some(left))
            } else if metadata.is_dir() {
                return Err(file_error(io::Error::from(io::ErrorKind::IsADirectory)));
            } else {
                (skipped(Box::new(file), skip, recording)?, None)
            }
        }
        Input::Stdin => (skipped(Box::new(io::stdin()), skip, recording)?, None),
    };
    let used = recording.duration_s.map(|s| (s * bytes_per_s) as u64);
    let total = length.map(|length| used.map_or(length, |used| used.min(length)));
    let progress = Progress::new(total, quiet);
    let counted = Counted::new(reader, progress.clone(), bytes_per_s);
    Ok((ReaderSource::new(counted, recording.samples), progress))
}

/// Says in which recording the signal layer met an error.
#[must_use]
pub fn in_recording(input: &Input, error: SignalError) -> ReceiverError {
    match error {
        SignalError::Read(source) => ReceiverError::File {
            path: input.to_string().into(),
            source,
        },
        SignalError::NotFinite { .. } => ReceiverError::Content {
            path: input.to_string().into(),
            what: format!("{error}: expected numbers, is the format right?"),
        },
        other => other.into(),
    }
}

/// Refuses less signal than a search needs.
///
/// # Errors
/// [`ReceiverError::Content`] for less than a code period, of which a twentieth may be missing.
pub fn enough(input: &Input, signal_s: f64) -> Result<(), ReceiverError> {
    if signal_s <= 0.0 {
        return Err(empty(input));
    }
    if signal_s < 0.95e-3 {
        return Err(ReceiverError::Content {
            path: input.to_string().into(),
            what: "less than 1 ms of samples: expected a code period at least".to_owned(),
        });
    }
    Ok(())
}

/// A recording without a single sample.
#[must_use]
pub fn empty(input: &Input) -> ReceiverError {
    ReceiverError::Content {
        path: input.to_string().into(),
        what: "empty: expected samples".to_owned(),
    }
}

fn start_byte(recording: &Recording) -> u64 {
    let samples = (recording.start_s * recording.samples.sample_rate_hz).round() as u64;
    let bits = recording.samples.format.bits_per_sample() as u64;
    // Whole samples of whole bytes, whole bytes of packed samples.
    samples.saturating_mul(bits) / 8
}

fn left_after(skip: u64, length: u64, recording: &Recording) -> Result<u64, ReceiverError> {
    if length == 0 {
        return Err(empty(&recording.input));
    }
    match length.checked_sub(skip) {
        Some(left) if left > 0 => Ok(left),
        _ => Err(ends_before_start(recording)),
    }
}

fn skipped(
    mut reader: Box<dyn Read + Send>,
    skip: u64,
    recording: &Recording,
) -> Result<Box<dyn Read + Send>, ReceiverError> {
    let copied = io::copy(&mut reader.by_ref().take(skip), &mut io::sink());
    let count = copied.map_err(|source| ReceiverError::File {
        path: recording.input.to_string().into(),
        source,
    })?;
    if count < skip {
        return Err(ends_before_start(recording));
    }
    Ok(reader)
}

fn ends_before_start(recording: &Recording) -> ReceiverError {
    ReceiverError::Content {
        path: recording.input.to_string().into(),
        what: format!("ends before --start {:?} s", recording.start_s),
    }
}

#[cfg(test)]
mod tests {
    use gnss_signal::sample::{SampleDescription, SampleFormat, SampleSource};

    use super::*;

    fn recording(path: std::path::PathBuf, format: SampleFormat, start_s: f64) -> Recording {
        Recording {
            input: Input::File(path),
            samples: SampleDescription {
                format,
                sample_rate_hz: 1e6,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            start_s,
            duration_s: None,
        }
    }

    #[test]
    fn the_start_is_found_and_what_cannot_be_read_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        std::fs::write(&path, [1, 2, 3, 4, 5, 6]).unwrap();
        let (mut source, _) =
            open(&recording(path.clone(), SampleFormat::Ci8, 2e-6), true).unwrap();
        let mut bytes = [0; 8];
        assert_eq!(source.read(&mut bytes).unwrap(), 2);
        assert_eq!(bytes[..2], [5, 6]);

        let message = |path: &std::path::Path, start_s| {
            let recording = recording(path.to_owned(), SampleFormat::Ri8, start_s);
            open(&recording, true).err().unwrap().to_string()
        };
        assert!(message(&path, 1.0).ends_with("a.bin: ends before --start 1.0 s"));
        std::fs::write(&path, []).unwrap();
        assert!(message(&path, 0.0).ends_with("a.bin: empty: expected samples"));
        assert!(message(&folder.path().join("b"), 0.0).contains("b: No such file"));
        assert!(message(folder.path(), 0.0).contains("directory"));
    }
}
