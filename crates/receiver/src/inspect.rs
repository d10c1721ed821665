//! What a file holds, as text with bars.

mod model;
mod scenario;

pub use model::model_text;
pub use scenario::scenario_text;

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use gnss_signal::sample::{
    ReaderSource, SampleDescription, SampleFormat, SampleRing, SampleSource,
};
use num_complex::Complex64;

use crate::ReceiverError;
use crate::rinex_nav::NavigationFile;
use crate::samples;
use crate::summary::Summary;

/// What kind of file it is.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Results of a run; the path is that of `summary.json`.
    Result(PathBuf),
    /// RINEX navigation data, as far as its first line tells.
    Navigation,
    /// Weights or card of a trained monitor.
    Model,
    /// A scenario of the generator of signals.
    Scenario(toml::Table),
    /// Anything else.
    Recording,
}

/// A recording to look into.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Where it is.
    pub path: PathBuf,
    /// Encoding of its samples, where known.
    pub format: Option<SampleFormat>,
    /// Samples per second, where known.
    pub sample_rate_hz: Option<f64>,
}

/// Samples looked at, from the beginning: enough for a spectrum, little enough to wait for.
const SAMPLES: usize = 1 << 20;
/// Points of the spectrum.
const POINTS: usize = 64;
/// Characters of the longest bar.
const BAR: usize = 50;

/// Tells what kind of file `path` is from its name and its first bytes.
///
/// # Errors
/// [`ReceiverError::File`] where it cannot be read.
pub fn kind(path: &Path) -> Result<Kind, ReceiverError> {
    if path.is_dir() {
        return Ok(Kind::Result(path.join("summary.json")));
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(80).read_to_end(&mut start));
    read.map_err(|source| file_error(path, source))?;
    let gzip = start.starts_with(&[0x1f, 0x8b]);
    let rinex = start.windows(13).any(|window| window == b"RINEX VERSION");
    if path.file_name().is_some_and(|name| name == "summary.json") {
        Ok(Kind::Result(path.to_owned()))
    } else if rinex || gzip {
        Ok(Kind::Navigation)
    } else if is_model(path, &start) {
        Ok(Kind::Model)
    } else if let Some(scenario) = scenario::read(path) {
        Ok(Kind::Scenario(scenario))
    } else {
        Ok(Kind::Recording)
    }
}

fn is_model(path: &Path, start: &[u8]) -> bool {
    let format = fault_ml::learned::FORMAT.as_bytes();
    let is_card = start.first() == Some(&b'{') && start.windows(format.len()).any(|w| w == format);
    is_card
        || path
            .extension()
            .is_some_and(|extension| extension == "safetensors")
}

/// The result of a run.
///
/// # Errors
/// [`ReceiverError::File`] or [`ReceiverError::Content`].
pub fn result_text(path: &Path) -> Result<String, ReceiverError> {
    let text = std::fs::read_to_string(path).map_err(|source| file_error(path, source))?;
    let summary: Summary = serde_json::from_str(&text).map_err(|error| ReceiverError::Content {
        path: path.to_owned(),
        what: format!("no summary of a run: {error}"),
    })?;
    Ok(summary.to_string())
}

/// Satellites and times of ephemerides.
#[must_use]
pub fn navigation_text(file: &NavigationFile) -> String {
    let mut text = format!(
        "RINEX navigation: {} ephemerides of {} GPS satellites\n",
        file.ephemerides.len(),
        file.satellites().len()
    );
    for satellite in file.satellites() {
        let toes = file.ephemerides.iter().filter(|e| e.satellite == satellite);
        let times: Vec<String> = toes
            .map(|e| {
                let health = if e.health == 0 { "" } else { " unhealthy" };
                format!("{}:{}{health}", e.toe.week(), e.toe.second())
            })
            .collect();
        let _ = writeln!(text, "{satellite}  toe {}", times.join("  "));
    }
    match &file.ionosphere {
        Some(k) => {
            let _ = writeln!(text, "Klobuchar  alpha {:?}  beta {:?}", k.alpha, k.beta);
        }
        None => text += "no Klobuchar parameters\n",
    }
    if let Some(leap) = file.leap_seconds {
        let _ = writeln!(text, "leap seconds {leap}");
    }
    text
}

/// Length, values, power, offset and spectrum of a recording; its bytes where the format is not
/// known.
///
/// # Errors
/// [`ReceiverError::File`], [`ReceiverError::Content`] where it is empty, or an error of a sample.
pub fn recording_text(recording: &Recording) -> Result<String, ReceiverError> {
    let path = &recording.path;
    let file = File::open(path).map_err(|source| file_error(path, source))?;
    let length = file
        .metadata()
        .map_err(|source| file_error(path, source))?
        .len();
    let input = crate::config::Input::File(path.clone());
    if length == 0 {
        return Err(samples::empty(&input));
    }
    let Some(format) = recording.format else {
        return bytes_text(file, length).map_err(|source| file_error(path, source));
    };
    let description = SampleDescription {
        format,
        sample_rate_hz: recording.sample_rate_hz.unwrap_or(1e6),
        intermediate_frequency_hz: 0.0,
        swap_iq: false,
    };
    let values = first_samples(ReaderSource::new(file, description))
        .map_err(|error| samples::in_recording(&input, error))?;
    let mut text = length_text(length, recording, format);
    text += &values_text(&values, format.is_complex());
    text += &spectrum_text(&values, format.is_complex(), recording.sample_rate_hz);
    Ok(text)
}

fn length_text(length: u64, recording: &Recording, format: SampleFormat) -> String {
    let bits = format.bits_per_sample() as u64;
    let count = length * 8 / bits;
    let mut text = format!("{length} bytes, {count} samples of {format}");
    if let Some(rate_hz) = recording.sample_rate_hz {
        let _ = write!(text, ", {:.6} s at {rate_hz} Hz", count as f64 / rate_hz);
    }
    if !(length * 8).is_multiple_of(bits) {
        text += "; the last one is cut off";
    }
    text + "\n"
}

fn first_samples<S: SampleSource>(source: S) -> Result<Vec<i8>, gnss_signal::SignalError> {
    let rate_hz = source.description().sample_rate_hz;
    let mut ring = SampleRing::new(source, SAMPLES as f64 / rate_hz)?;
    let end = ring.advance_to(SAMPLES as u64)?;
    let mut values = Vec::new();
    ring.unpack(0, end.min(SAMPLES as u64), &mut values)?;
    Ok(values)
}

fn values_text(values: &[i8], complex: bool) -> String {
    let mut text = String::new();
    let names: &[&str] = if complex { &["I", "Q"] } else { &["value"] };
    for (component, name) in names.iter().enumerate() {
        let of: Vec<f64> = values
            .iter()
            .skip(component)
            .step_by(names.len())
            .map(|v| f64::from(*v))
            .collect();
        let count = of.len().max(1) as f64;
        let mean = of.iter().sum::<f64>() / count;
        let power = of.iter().map(|v| v * v).sum::<f64>() / count;
        let _ = writeln!(
            text,
            "{name}: mean {mean:.3}, root mean square {:.3} (8-bit units, first {} samples)",
            power.sqrt(),
            of.len()
        );
        text += &histogram(&of);
    }
    text
}

/// Bars over the values, at most about twenty of them.
fn histogram(values: &[f64]) -> String {
    let mut counts = [0usize; 256];
    for value in values {
        counts[(*value as i16 + 128).clamp(0, 255) as usize] += 1;
    }
    let first = counts.iter().position(|n| *n > 0).unwrap_or(0);
    let last = counts.iter().rposition(|n| *n > 0).unwrap_or(0);
    let step = (last - first).div_ceil(20).max(1);
    let bins: Vec<(usize, usize)> = (first..=last)
        .step_by(step)
        .map(|at| (at, counts[at..(at + step).min(256)].iter().sum()))
        .collect();
    let most = bins.iter().map(|(_, n)| *n).max().unwrap_or(1).max(1);
    bins.iter()
        .filter(|(_, n)| step > 1 || *n > 0)
        .fold(String::new(), |mut text, (at, n)| {
            let share = 100.0 * *n as f64 / values.len().max(1) as f64;
            let bar = "#".repeat((n * BAR).div_ceil(most).min(BAR));
            let _ = writeln!(text, "{:>5} {share:>6.2} % {bar}", *at as i64 - 128);
            text
        })
}

/// Mean power in [`POINTS`] bands: Hann-windowed blocks, transformed by the definition.
fn spectrum_text(values: &[i8], complex: bool, sample_rate_hz: Option<f64>) -> String {
    let samples: Vec<Complex64> = if complex {
        let pairs = values.chunks_exact(2);
        pairs
            .map(|p| Complex64::new(p[0].into(), p[1].into()))
            .collect()
    } else {
        values
            .iter()
            .map(|v| Complex64::new((*v).into(), 0.0))
            .collect()
    };
    // A few thousand blocks settle each band to a fraction of a decibel.
    let blocks = samples.chunks_exact(POINTS).take(4096);
    if blocks.len() == 0 {
        return String::new();
    }
    let turn = |k: usize| Complex64::from_polar(1.0, -TAU * k as f64 / POINTS as f64);
    let turns: Vec<Complex64> = (0..POINTS).map(turn).collect();
    let mut power = [0.0; POINTS];
    for block in blocks {
        for (k, power) in power.iter_mut().enumerate() {
            let windowed = block.iter().enumerate().map(|(n, x)| {
                let window = 0.5 - 0.5 * turns[n].re;
                x * window * turns[k * n % POINTS]
            });
            *power += windowed.sum::<Complex64>().norm_sqr();
        }
    }
    let order: Vec<usize> = if complex {
        (POINTS / 2..POINTS).chain(0..POINTS / 2).collect()
    } else {
        (0..POINTS / 2).collect()
    };
    bands_text(&power, &order, sample_rate_hz)
}

fn bands_text(power: &[f64], order: &[usize], sample_rate_hz: Option<f64>) -> String {
    let decibels = |k: usize| 10.0 * power[k].max(1e-9).log10();
    let most = order.iter().map(|k| decibels(*k)).fold(f64::MIN, f64::max);
    let unit = if sample_rate_hz.is_some() {
        "MHz"
    } else {
        "of the sample rate"
    };
    let mut text = format!("spectrum ({unit}; dB below the strongest band)\n");
    for k in order {
        let below = decibels(*k) - most;
        let signed = if *k < POINTS / 2 {
            *k as f64
        } else {
            *k as f64 - POINTS as f64
        };
        let frequency = signed / POINTS as f64 * sample_rate_hz.map_or(1.0, |hz| hz / 1e6);
        // Two characters a decibel down to 25 dB.
        let bar = "#".repeat(((25.0 + below).max(0.0) * 2.0) as usize);
        let _ = writeln!(text, "{frequency:>9.4} {below:>6.1} {bar}");
    }
    text
}

fn bytes_text(mut file: File, length: u64) -> std::io::Result<String> {
    let mut bytes = Vec::new();
    file.by_ref().take(SAMPLES as u64).read_to_end(&mut bytes)?;
    let signed: Vec<f64> = bytes.iter().map(|b| f64::from(b.cast_signed())).collect();
    Ok(format!(
        "{length} bytes; give --format to see samples. As signed bytes:\n{}",
        histogram(&signed)
    ))
}

fn file_error(path: &Path, source: std::io::Error) -> ReceiverError {
    ReceiverError::File {
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_is_where_it_is() {
        // A complex tone at +1/8 of the sample rate: band 8 of 64.
        let values: Vec<i8> = (0..8192)
            .flat_map(|n| {
                let (sine, cosine) = (TAU * f64::from(n) / 8.0).sin_cos();
                [(100.0 * cosine) as i8, (100.0 * sine) as i8]
            })
            .collect();
        let text = spectrum_text(&values, true, Some(8e6));
        let strongest = text
            .lines()
            .find(|line| line.contains("   0.0 ") || line.contains("  -0.0 "));
        assert!(
            strongest.unwrap().trim_start().starts_with("1.0000"),
            "{text}"
        );
    }

    #[test]
    fn recordings_are_described_and_bad_ones_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        std::fs::write(&path, [1u8, 255, 1, 255, 3]).unwrap();
        let mut recording = Recording {
            path: path.clone(),
            format: Some(SampleFormat::Ci8),
            sample_rate_hz: Some(1e6),
        };
        let text = recording_text(&recording).unwrap();
        assert!(text.contains("2 samples of ci8, 0.000002 s"), "{text}");
        assert!(
            text.contains("cut off") && text.contains("I: mean 1.000"),
            "{text}"
        );
        recording.format = None;
        assert!(
            recording_text(&recording)
                .unwrap()
                .contains("5 bytes; give --format")
        );
        std::fs::write(&path, []).unwrap();
        assert!(
            recording_text(&recording)
                .unwrap_err()
                .to_string()
                .contains("empty")
        );
        assert_eq!(kind(&path).unwrap(), Kind::Recording);
        assert!(kind(&folder.path().join("b")).is_err());
    }
}
