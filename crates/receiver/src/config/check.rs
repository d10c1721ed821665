//! Options as given to options as valid values.

use std::path::{Path, PathBuf};

use gnss_nav::{Geodetic, GpsTime};
use gnss_signal::SignalId;
use gnss_signal::sample::{SampleDescription, SampleFormat};

use super::{
    AcquireConfig, AcquireOptions, Input, Ionosphere, Isa, Mode, MonitorChoice, Recording,
    RunConfig, RunOptions, Troposphere,
};
use crate::ReceiverError;
use crate::pipeline::{FilterKind, Policy};
use crate::sigmf::{self, Sidecar};

/// Where an option was given, for errors.
pub(super) enum Origin {
    CommandLine,
    File(PathBuf),
}

impl Origin {
    fn name(&self, option: &str) -> String {
        match self {
            Self::CommandLine => format!("--{option}"),
            Self::File(path) => format!("{}: {}", path.display(), option.replace('-', "_")),
        }
    }
}

/// Samples as given, for either command.
struct RecordingOptions<'a> {
    input: Option<&'a Path>,
    format: Option<&'a str>,
    sample_rate: Option<f64>,
    intermediate_frequency: Option<f64>,
    swap_iq: bool,
    start: Option<f64>,
    duration: Option<f64>,
}

/// Checks options of one origin.
pub(super) struct Checks<'a>(pub(super) &'a Origin);

impl Checks<'_> {
    pub(super) fn run(&self, given: &RunOptions) -> Result<RunConfig, ReceiverError> {
        self.run_values(given)?;
        self.needs_out(given.truth.as_ref(), given.out.as_ref())?;
        Ok(RunConfig {
            recording: self.recording(&recording_options(given))?,
            nav: given.nav.clone(),
            position: given
                .position
                .as_deref()
                .map(|t| self.position(t))
                .transpose()?,
            time: given.time.as_deref().map(|t| self.time(t)).transpose()?,
            mode: self.mode(given)?,
            filter: self.filter(given)?,
            monitors: self.monitors(given)?,
            policy: self.policy(given)?,
            raim: self.run_raim(given)?,
            rate_hz: given.rate.unwrap_or(10.0),
            ionosphere: self.ionosphere(given.ionosphere.as_deref())?,
            troposphere: self.troposphere(given.troposphere.as_deref())?,
            elevation_mask_rad: given.elevation_mask.unwrap_or(0.0).to_radians(),
            prns: self.prns(given.prn.as_deref())?,
            truth: given.truth.clone(),
            dump_taps: given.dump.is_some(),
            out: given.out.clone(),
            seed: given.seed.unwrap_or(0),
            quiet: given.quiet,
            isa: self.isa(given)?,
            threads: given.threads.unwrap_or(1),
        })
    }

    /// Errors against a truth are computed from an output file.
    pub(super) fn needs_out(
        &self,
        truth: Option<&PathBuf>,
        out: Option<&PathBuf>,
    ) -> Result<(), ReceiverError> {
        if truth.is_none() || out.is_some() {
            return Ok(());
        }
        Err(self.missing(
            "out",
            "a directory, as errors are computed from its pvt.csv",
        ))
    }

    /// The mask in degrees, if possible.
    pub(super) fn elevation_mask(&self, mask: Option<f64>) -> Result<Option<f64>, ReceiverError> {
        self.number("elevation-mask", mask, "0 to 90 (degrees)", |v| {
            (0.0..=90.0).contains(&v)
        })?;
        Ok(mask)
    }

    /// Checks every value by itself; nothing has to be present.
    pub(super) fn run_values(&self, given: &RunOptions) -> Result<(), ReceiverError> {
        self.recording_values(&recording_options(given))?;
        self.number("rate", given.rate, "above 0 and at most 50 (Hz)", |v| {
            v > 0.0 && v <= 50.0
        })?;
        self.elevation_mask(given.elevation_mask)?;
        self.mode(given)?;
        self.filter(given)?;
        self.monitors(given)?;
        self.policy(given)?;
        self.run_raim(given)?;
        self.choice("dump", given.dump.as_deref(), "taps", &[("taps", ())])?;
        self.threads(given.threads)?;
        given
            .position
            .as_deref()
            .map(|t| self.position(t))
            .transpose()?;
        given.time.as_deref().map(|t| self.time(t)).transpose()?;
        self.ionosphere(given.ionosphere.as_deref())?;
        self.troposphere(given.troposphere.as_deref())?;
        self.isa(given)?;
        self.prns(given.prn.as_deref()).map(|_| ())
    }

    pub(super) fn acquire(&self, given: &AcquireOptions) -> Result<AcquireConfig, ReceiverError> {
        let recording = RecordingOptions {
            input: given.input.as_deref(),
            format: given.format.as_deref(),
            sample_rate: given.sample_rate,
            intermediate_frequency: given.intermediate_frequency,
            swap_iq: given.swap_iq,
            start: given.start,
            duration: None,
        };
        self.recording_values(&recording)?;
        let doppler = given.doppler_max;
        self.number("doppler-max", doppler, "500 to 100000 (Hz)", |v| {
            (500.0..=100e3).contains(&v)
        })?;
        let integration = given.integration.map(f64::from);
        self.number("integration", integration, "1 to 500 (ms)", |v| {
            (1.0..=500.0).contains(&v)
        })?;
        self.threads(given.threads)?;
        Ok(AcquireConfig {
            recording: self.recording(&recording)?,
            prns: self.prns(given.prn.as_deref())?,
            doppler_max_hz: doppler.unwrap_or(12e3),
            integration_ms: given.integration,
            json: given.json,
            threads: given.threads.unwrap_or(1),
        })
    }

    fn recording_values(&self, given: &RecordingOptions<'_>) -> Result<(), ReceiverError> {
        if let Some(name) = given.format {
            self.format(name)?;
        }
        self.number("sample-rate", given.sample_rate, RATE_EXPECTED, is_rate)?;
        let frequency = given.intermediate_frequency;
        self.number("if", frequency, "a frequency (Hz)", f64::is_finite)?;
        self.number("start", given.start, "0 or more (s)", |v| {
            v.is_finite() && v >= 0.0
        })?;
        self.number("duration", given.duration, "above 0 (s)", |v| {
            v.is_finite() && v > 0.0
        })
    }

    fn recording(&self, given: &RecordingOptions<'_>) -> Result<Recording, ReceiverError> {
        let path = given
            .input
            .ok_or_else(|| self.missing("input", "a recording, or - for standard input"))?;
        let (input, sidecar) = if path.as_os_str() == "-" {
            (Input::Stdin, Sidecar::default())
        } else {
            (Input::File(path.to_owned()), sigmf::read(path)?)
        };
        Ok(Recording {
            samples: self.samples(given, &sidecar)?,
            input,
            start_s: given.start.unwrap_or(0.0),
            duration_s: given.duration,
        })
    }

    fn samples(
        &self,
        given: &RecordingOptions<'_>,
        sidecar: &Sidecar,
    ) -> Result<SampleDescription, ReceiverError> {
        let sidecar_hint = "one, or a SigMF sidecar FILE.sigmf-meta beside the recording";
        let format = match given.format {
            Some(name) => self.format(name)?,
            None => sidecar
                .format
                .ok_or_else(|| self.missing("format", sidecar_hint))?,
        };
        let sample_rate_hz = given
            .sample_rate
            .or(sidecar.sample_rate_hz)
            .ok_or_else(|| self.missing("sample-rate", sidecar_hint))?;
        let complex = format.is_complex();
        let intermediate_frequency_hz = given
            .intermediate_frequency
            .or(sidecar.intermediate_frequency_hz)
            .or(complex.then_some(0.0))
            .ok_or_else(|| self.missing("if", "one, as the samples are real"))?;
        // A sidecar's values are not the options' and have not been checked yet.
        self.number("sample-rate", Some(sample_rate_hz), RATE_EXPECTED, is_rate)?;
        let (limit_hz, expected) = if complex {
            (sample_rate_hz, "between minus and plus the sample rate")
        } else {
            (
                sample_rate_hz / 2.0,
                "at most half the sample rate, as the samples are real",
            )
        };
        self.number("if", Some(intermediate_frequency_hz), expected, |v| {
            v.abs() <= limit_hz
        })?;
        Ok(SampleDescription {
            format,
            sample_rate_hz,
            intermediate_frequency_hz,
            swap_iq: given.swap_iq || sidecar.swap_iq.unwrap_or(false),
        })
    }

    fn format(&self, name: &str) -> Result<SampleFormat, ReceiverError> {
        let formats = SampleFormat::ALL.map(SampleFormat::name).join(" ");
        name.parse()
            .map_err(|_| self.wrong("format", name, &format!("one of {formats}")))
    }

    fn position(&self, text: &str) -> Result<Geodetic, ReceiverError> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|n| n.trim().parse().ok())
            .collect();
        let valid = |lat: f64, lon: f64, h: f64| {
            lat.abs() <= 90.0 && (-180.0..=360.0).contains(&lon) && (-10e3..=5e7).contains(&h)
        };
        match numbers[..] {
            [lat, lon, h] if text.split(',').count() == 3 && valid(lat, lon, h) => {
                Ok(Geodetic::from_degrees(lat, lon, h))
            }
            _ => Err(self.wrong(
                "position",
                text,
                "LAT,LON,H in degrees (north, east) and metres over the ellipsoid",
            )),
        }
    }

    fn time(&self, text: &str) -> Result<GpsTime, ReceiverError> {
        let parsed = text.split_once(':').and_then(|(week, tow)| {
            let week: i32 = week.trim().parse().ok()?;
            let tow_s: f64 = tow.trim().parse().ok()?;
            ((0..=99_999).contains(&week) && (0.0..604_800.0).contains(&tow_s))
                .then(|| GpsTime::new(week, tow_s))
        });
        parsed.ok_or_else(|| {
            let expected = "WEEK:TOW, the unrolled GPS week and seconds 0 to 604800";
            self.wrong("time", text, expected)
        })
    }

    fn prns(&self, list: Option<&str>) -> Result<Vec<u8>, ReceiverError> {
        let Some(text) = list else {
            return Ok((1..=32).collect());
        };
        let one = |item: &str| {
            let digits = item.trim().trim_start_matches('G');
            let prn = digits.parse().ok()?;
            SignalId::gps_l1_ca(prn).ok().map(|_| prn)
        };
        let range = |item: &str| match item.split_once('-') {
            Some((first, last)) => Some(one(first)?..=one(last)?).filter(|range| !range.is_empty()),
            None => one(item).map(|prn| prn..=prn),
        };
        let ranges: Option<Vec<_>> = text.split(',').map(range).collect();
        let mut prns: Vec<u8> = ranges.unwrap_or_default().into_iter().flatten().collect();
        prns.sort_unstable();
        prns.dedup();
        if prns.is_empty() {
            return Err(self.wrong("prn", text, "GPS numbers 1 to 37, for instance 1,7,20-25"));
        }
        Ok(prns)
    }

    fn mode(&self, given: &RunOptions) -> Result<Mode, ReceiverError> {
        let modes = [("scalar", Mode::Scalar), ("vector", Mode::Vector)];
        self.choice("mode", given.mode.as_deref(), "scalar", &modes)
    }

    fn filter(&self, given: &RunOptions) -> Result<FilterKind, ReceiverError> {
        let filters = [
            ("sequential", FilterKind::Sequential),
            ("batch", FilterKind::Batch),
        ];
        self.choice("filter", given.filter.as_deref(), "sequential", &filters)
    }

    fn monitors(&self, given: &RunOptions) -> Result<Vec<MonitorChoice>, ReceiverError> {
        use MonitorChoice::{Ewma, Innovation, Lstm, Svm};
        let named = [Innovation, Svm, Lstm, Ewma].map(|m| (m.name(), Some(m)));
        let choices: Vec<_> = named.into_iter().chain([("none", None)]).collect();
        let chosen = |name: &String| self.choice("monitor", Some(name), "", &choices);
        if given.monitor.is_empty() {
            let default = (self.mode(given)? == Mode::Vector).then_some(Innovation);
            return Ok(default.into_iter().collect());
        }
        let all = given
            .monitor
            .iter()
            .map(chosen)
            .collect::<Result<Vec<_>, _>>()?;
        if all.contains(&None) && all.len() > 1 {
            return Err(self.wrong("monitor", "none", "nothing beside it"));
        }
        let mut monitors: Vec<MonitorChoice> = all.into_iter().flatten().collect();
        monitors.sort_unstable();
        monitors.dedup();
        Ok(monitors)
    }

    fn policy(&self, given: &RunOptions) -> Result<Policy, ReceiverError> {
        let deweight = Policy::Deweight {
            variance_factor: Policy::VARIANCE_FACTOR,
        };
        let policies = [
            ("observe", Policy::Observe),
            ("deweight", deweight),
            ("exclude", Policy::Exclude),
        ];
        self.choice("policy", given.policy.as_deref(), "exclude", &policies)
    }

    pub(super) fn ionosphere(&self, given: Option<&str>) -> Result<Ionosphere, ReceiverError> {
        let models = [
            ("klobuchar", Ionosphere::Klobuchar),
            ("none", Ionosphere::None),
        ];
        self.choice("ionosphere", given, "klobuchar", &models)
    }

    pub(super) fn troposphere(&self, given: Option<&str>) -> Result<Troposphere, ReceiverError> {
        let models = [
            ("saastamoinen", Troposphere::Saastamoinen),
            ("none", Troposphere::None),
        ];
        self.choice("troposphere", given, "saastamoinen", &models)
    }

    fn isa(&self, given: &RunOptions) -> Result<Isa, ReceiverError> {
        let sets = [
            ("auto", Isa::Auto),
            ("reference", Isa::Reference),
            ("portable", Isa::Portable),
            ("avx2", Isa::Avx2),
            ("avx512", Isa::Avx512),
        ];
        self.choice("isa", given.isa.as_deref(), "auto", &sets)
    }

    fn threads(&self, threads: Option<usize>) -> Result<(), ReceiverError> {
        let number = threads.map(|n| n as f64);
        self.number("threads", number, "1 to 256", |v| {
            (1.0..=256.0).contains(&v)
        })
    }

    pub(super) fn choice<T: Copy>(
        &self,
        option: &str,
        given: Option<&str>,
        default: &str,
        choices: &[(&str, T)],
    ) -> Result<T, ReceiverError> {
        let name = given.unwrap_or(default);
        let found = choices.iter().find(|(choice, _)| *choice == name);
        found.map(|(_, value)| *value).ok_or_else(|| {
            let names: Vec<&str> = choices.iter().map(|(choice, _)| *choice).collect();
            let expected = match names[..] {
                [only] => format!("{only} (the only one in this version)"),
                _ => format!("one of {}", names.join(", ")),
            };
            self.wrong(option, name, &expected)
        })
    }

    pub(super) fn number(
        &self,
        option: &str,
        value: Option<f64>,
        expected: &str,
        valid: impl Fn(f64) -> bool,
    ) -> Result<(), ReceiverError> {
        match value {
            Some(value) if !valid(value) => Err(self.wrong(option, &value.to_string(), expected)),
            _ => Ok(()),
        }
    }

    pub(super) fn wrong(&self, option: &str, value: &str, expected: &str) -> ReceiverError {
        ReceiverError::Option {
            what: format!("{} is '{value}': expected {expected}", self.0.name(option)),
        }
    }

    pub(super) fn missing(&self, option: &str, expected: &str) -> ReceiverError {
        ReceiverError::Option {
            what: format!("{} is missing: expected {expected}", self.0.name(option)),
        }
    }
}

/// Below this the C/A code is lost, above it no such recorder exists.
const RATE_EXPECTED: &str = "5e5 to 1e9 (Hz)";

fn is_rate(sample_rate_hz: f64) -> bool {
    (5e5..=1e9).contains(&sample_rate_hz)
}

fn recording_options(given: &RunOptions) -> RecordingOptions<'_> {
    RecordingOptions {
        input: given.input.as_deref(),
        format: given.format.as_deref(),
        sample_rate: given.sample_rate,
        intermediate_frequency: given.intermediate_frequency,
        swap_iq: given.swap_iq,
        start: given.start,
        duration: given.duration,
    }
}
