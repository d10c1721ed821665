//! Options as given: on the command line, in a configuration file, or in both.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Deserializer};

use super::check::{Checks, Origin};
use super::{AcquireConfig, RunConfig};
use crate::ReceiverError;

/// Options of `receiver run`.
#[derive(Debug, Clone, Default, PartialEq, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunOptions {
    /// Recording, or - for standard input
    #[arg(long, value_name = "FILE|-")]
    pub input: Option<PathBuf>,
    /// TOML file with these options (keys without --, - written _); the command line wins, paths
    /// in it are relative to it
    #[arg(long, value_name = "FILE.toml")]
    #[serde(skip)]
    pub config: Option<PathBuf>,
    /// Sample format: ri8 ru8 ri16_le rf32_le ci8 cu8 ci16_le cf32_le r1_msb r1_lsb c1_msb c1_lsb
    /// r2_lsb r2_msb r2sm_lsb r2sm_msb [default: from the SigMF sidecar]
    #[arg(long, value_name = "F")]
    pub format: Option<String>,
    /// Samples (I, Q pairs where complex) per second [default: from the SigMF sidecar]
    #[arg(long, value_name = "HZ")]
    pub sample_rate: Option<f64>,
    /// Intermediate frequency, may be negative [default: from the SigMF sidecar; 0 for complex samples]
    #[arg(long = "if", value_name = "HZ", allow_hyphen_values = true)]
    #[serde(rename = "if")]
    pub intermediate_frequency: Option<f64>,
    /// Exchange I and Q
    #[arg(long)]
    pub swap_iq: bool,
    /// RINEX 2 or 3 navigation file (plain or gzip): assisted start
    #[arg(long, value_name = "RINEX")]
    pub nav: Option<PathBuf>,
    /// Rough position, degrees and metres: assisted start
    #[arg(long, value_name = "LAT,LON,H", allow_hyphen_values = true)]
    pub position: Option<String>,
    /// Rough GPS time of the first sample, week (unrolled) and seconds: assisted start
    #[arg(long, value_name = "WEEK:TOW")]
    pub time: Option<String>,
    /// Tracking mode: scalar, or vector (one filter steers all channels once there is a consistent
    /// fix) [default: scalar]
    #[arg(long, value_name = "MODE")]
    pub mode: Option<String>,
    /// Filter of vector mode: sequential or batch [default: sequential]
    #[arg(long, value_name = "FILTER")]
    pub filter: Option<String>,
    /// Monitor of every channel: ewma (shape of the correlation); in vector mode also innovation, svm,
    /// lstm; or none; may be repeated [default: innovation, in vector mode]
    #[arg(long, value_name = "MONITOR")]
    #[serde(deserialize_with = "one_or_several")]
    pub monitor: Vec<String>,
    /// What follows from a monitor's alarm: observe, deweight (variance times 100, or by the error that
    /// ewma suspects) or exclude [default: exclude]
    #[arg(long, value_name = "POLICY")]
    pub policy: Option<String>,
    /// Navigation epochs per second, up to 50 [default: 10]
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Receiver autonomous integrity monitoring while channels have their own loops: none, ls, glr, pf
    /// or pso-pf, as for `solve` [default: ls]
    #[arg(long, value_name = "RAIM")]
    pub raim: Option<String>,
    /// Ionosphere model: klobuchar or none [default: klobuchar]
    #[arg(long, value_name = "MODEL")]
    pub ionosphere: Option<String>,
    /// Troposphere model: saastamoinen or none [default: saastamoinen]
    #[arg(long, value_name = "MODEL")]
    pub troposphere: Option<String>,
    /// Use no satellite below this elevation, 0 to 90 degrees [default: 0, low ones weigh little]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    pub elevation_mask: Option<f64>,
    /// Satellites to look for, for instance 1,7,20-25 [default: 1-32]
    #[arg(long, value_name = "LIST")]
    pub prn: Option<String>,
    /// Skip this many seconds of the recording [default: 0]
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub start: Option<f64>,
    /// Use this many seconds [default: all]
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub duration: Option<f64>,
    /// Truth (time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps), compared with pvt.csv after the run
    #[arg(long, value_name = "TRUTH.csv")]
    pub truth: Option<PathBuf>,
    /// Write every tap of every integration to taps.csv: taps
    #[arg(long, value_name = "WHAT")]
    pub dump: Option<String>,
    /// Directory for the output files [default: none are written]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Seed of everything random [default: 0]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Instruction set: auto, reference, portable, avx2 or avx512 [default: auto]
    #[arg(long, value_name = "ISA")]
    pub isa: Option<String>,
    /// Threads, 1 to 256; the results do not depend on it [default: 1]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// No progress, only errors and the result
    #[arg(long)]
    pub quiet: bool,
}

/// Options of `receiver acquire`.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct AcquireOptions {
    /// Recording, or - for standard input
    #[arg(long, value_name = "FILE|-")]
    pub input: Option<PathBuf>,
    /// Sample format, as for `receiver run` [default: from the SigMF sidecar]
    #[arg(long, value_name = "F")]
    pub format: Option<String>,
    /// Samples (I, Q pairs where complex) per second [default: from the SigMF sidecar]
    #[arg(long, value_name = "HZ")]
    pub sample_rate: Option<f64>,
    /// Intermediate frequency, may be negative [default: from the SigMF sidecar; 0 for complex samples]
    #[arg(long = "if", value_name = "HZ", allow_hyphen_values = true)]
    pub intermediate_frequency: Option<f64>,
    /// Exchange I and Q
    #[arg(long)]
    pub swap_iq: bool,
    /// Skip this many seconds of the recording [default: 0]
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub start: Option<f64>,
    /// Satellites to look for, for instance 1,7,20-25 [default: 1-32]
    #[arg(long, value_name = "LIST")]
    pub prn: Option<String>,
    /// Largest Doppler to look for, 500 to 100000 [default: 12000]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true)]
    pub doppler_max: Option<f64>,
    /// Signal to use, 1 to 500 [default: in stages, from a few milliseconds up]
    #[arg(long, value_name = "MS")]
    pub integration: Option<u32>,
    /// Threads, 1 to 256; the results do not depend on it [default: 1]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

impl RunOptions {
    /// Reads a configuration file; paths in it become relative to its directory.
    ///
    /// # Errors
    /// [`ReceiverError::File`] or, naming key and line, [`ReceiverError::Content`].
    pub fn read(path: &Path) -> Result<Self, ReceiverError> {
        let text = std::fs::read_to_string(path).map_err(|source| ReceiverError::File {
            path: path.to_owned(),
            source,
        })?;
        let parsed: Result<Self, _> = toml::from_str(&text);
        let mut options = parsed.map_err(|error| ReceiverError::Content {
            path: path.to_owned(),
            what: one_line(&text, &error),
        })?;
        let directory = path.parent().unwrap_or(Path::new(""));
        for file in [
            &mut options.nav,
            &mut options.truth,
            &mut options.out,
            &mut options.input,
        ]
        .into_iter()
        .flatten()
        {
            if file.as_os_str() != "-" {
                *file = directory.join(&*file);
            }
        }
        Ok(options)
    }

    /// These options where given, otherwise those of `fallback`.
    #[must_use]
    pub fn or(self, fallback: Self) -> Self {
        Self {
            input: self.input.or(fallback.input),
            config: self.config.or(fallback.config),
            format: self.format.or(fallback.format),
            sample_rate: self.sample_rate.or(fallback.sample_rate),
            intermediate_frequency: self
                .intermediate_frequency
                .or(fallback.intermediate_frequency),
            swap_iq: self.swap_iq || fallback.swap_iq,
            nav: self.nav.or(fallback.nav),
            position: self.position.or(fallback.position),
            time: self.time.or(fallback.time),
            mode: self.mode.or(fallback.mode),
            filter: self.filter.or(fallback.filter),
            monitor: if self.monitor.is_empty() {
                fallback.monitor
            } else {
                self.monitor
            },
            policy: self.policy.or(fallback.policy),
            rate: self.rate.or(fallback.rate),
            raim: self.raim.or(fallback.raim),
            ionosphere: self.ionosphere.or(fallback.ionosphere),
            troposphere: self.troposphere.or(fallback.troposphere),
            elevation_mask: self.elevation_mask.or(fallback.elevation_mask),
            prn: self.prn.or(fallback.prn),
            start: self.start.or(fallback.start),
            duration: self.duration.or(fallback.duration),
            truth: self.truth.or(fallback.truth),
            dump: self.dump.or(fallback.dump),
            out: self.out.or(fallback.out),
            seed: self.seed.or(fallback.seed),
            isa: self.isa.or(fallback.isa),
            threads: self.threads.or(fallback.threads),
            quiet: self.quiet || fallback.quiet,
        }
    }

    /// These options over those of their configuration file, checked, with defaults and the
    /// recording's sidecar.
    ///
    /// # Errors
    /// [`ReceiverError::Option`] naming the option, its value and what was expected, or an error
    /// of the configuration file or the sidecar.
    pub fn check(self) -> Result<RunConfig, ReceiverError> {
        let Some(path) = self.config.clone() else {
            return Checks(&Origin::CommandLine).run(&self);
        };
        let file = Self::read(&path)?;
        // Each source is checked by itself first, so that an error names the one it is in.
        Checks(&Origin::File(path)).run_values(&file)?;
        Checks(&Origin::CommandLine).run_values(&self)?;
        Checks(&Origin::CommandLine).run(&self.or(file))
    }
}

impl AcquireOptions {
    /// These options, checked, with defaults and the recording's sidecar.
    ///
    /// # Errors
    /// As [`RunOptions::check`].
    pub fn check(&self) -> Result<AcquireConfig, ReceiverError> {
        Checks(&Origin::CommandLine).acquire(self)
    }
}

/// A text, or a list of texts.
fn one_or_several<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Given {
        One(String),
        Several(Vec<String>),
    }
    Ok(match Given::deserialize(deserializer)? {
        Given::One(text) => vec![text],
        Given::Several(texts) => texts,
    })
}

/// Message and line of a TOML error; its own display draws several lines.
fn one_line(text: &str, error: &toml::de::Error) -> String {
    let start = error.span().map_or(0, |span| span.start.min(text.len()));
    let line = text.as_bytes()[..start]
        .iter()
        .filter(|b| **b == b'\n')
        .count()
        + 1;
    let message = error.message().replace('\n', " ");
    format!("line {line}: {message}")
}
