//! What a run is to do: every option as a plain, valid value.
//!
//! Options come from the command line and, where `--config` is given, from a TOML file whose keys
//! are the names of the options (`-` written `_`); the command line wins. [`RunOptions`] holds
//! them as given, [`RunOptions::check`] turns them into a [`RunConfig`].

mod check;
#[cfg(test)]
mod monitor_tests;
mod options;
mod raim;
mod solve;
#[cfg(test)]
mod tests;

use std::fmt;
use std::path::PathBuf;

use gnss_nav::{Geodetic, GpsTime};
use gnss_signal::sample::SampleDescription;

use crate::pipeline::{FilterKind, Policy};
use crate::raim::Raim;

pub use options::{AcquireOptions, RunOptions};
pub use solve::{SolveConfig, SolveOptions};

/// Where samples come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Input {
    /// A file.
    File(PathBuf),
    /// Standard input.
    Stdin,
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Stdin => f.write_str("standard input"),
        }
    }
}

/// Samples and the part of them to use.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Where they come from.
    pub input: Input,
    /// How they are written.
    pub samples: SampleDescription,
    /// What to skip at the beginning, s.
    pub start_s: f64,
    /// How much to use after that, s; all of it where absent.
    pub duration_s: Option<f64>,
}

/// Model of the ionosphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ionosphere {
    /// Klobuchar's with the broadcast parameters.
    Klobuchar,
    /// None.
    None,
}

/// Model of the troposphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Troposphere {
    /// Saastamoinen's with a standard atmosphere.
    Saastamoinen,
    /// None.
    None,
}

/// Who steers the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Each its own loops.
    Scalar,
    /// The navigation filter, once there is a consistent fix.
    Vector,
}

/// A monitor of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MonitorChoice {
    /// The innovation test.
    Innovation,
    /// The support-vector machine that comes with the receiver.
    Svm,
    /// The long short-term memory that comes with it.
    Lstm,
    /// The chart on the shape of the correlation.
    Ewma,
}

impl MonitorChoice {
    /// Name in options and results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Innovation => "innovation",
            Self::Svm => "svm",
            Self::Lstm => "lstm",
            Self::Ewma => "ewma",
        }
    }
}

/// Instruction set of the correlators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// The fastest this processor has.
    Auto,
    /// `f64`, sample by sample.
    Reference,
    /// Any processor.
    Portable,
    /// AVX2.
    Avx2,
    /// AVX-512.
    Avx512,
}

/// Everything `receiver run` needs to know.
#[derive(Debug, Clone, PartialEq)]
pub struct RunConfig {
    /// The samples.
    pub recording: Recording,
    /// RINEX navigation file for an assisted start.
    pub nav: Option<PathBuf>,
    /// Rough position for an assisted start.
    pub position: Option<Geodetic>,
    /// Rough GPS time of the first sample for an assisted start.
    pub time: Option<GpsTime>,
    /// Who steers the channels.
    pub mode: Mode,
    /// Which filter, in vector mode.
    pub filter: FilterKind,
    /// Who watches every channel, each once, in order: the chart always, the others in vector mode.
    pub monitors: Vec<MonitorChoice>,
    /// What follows from a monitor's alarm.
    pub policy: Policy,
    /// What tests the pseudoranges of an epoch while channels have their own loops.
    pub raim: Raim,
    /// Navigation epochs per second.
    pub rate_hz: f64,
    /// Model of the ionosphere.
    pub ionosphere: Ionosphere,
    /// Model of the troposphere.
    pub troposphere: Troposphere,
    /// Satellites below this elevation are not used, rad.
    pub elevation_mask_rad: f64,
    /// Satellites to look for, in order.
    pub prns: Vec<u8>,
    /// Truth to compare with after the run.
    pub truth: Option<PathBuf>,
    /// Whether to write every tap of every integration.
    pub dump_taps: bool,
    /// Directory for the output files.
    pub out: Option<PathBuf>,
    /// Seed of everything random.
    pub seed: u64,
    /// Whether to keep silent while running.
    pub quiet: bool,
    /// Instruction set of the correlators.
    pub isa: Isa,
    /// Threads; the results do not depend on it.
    pub threads: usize,
}

impl RunConfig {
    /// Monitors that watch in this mode.
    pub fn watching(&self) -> impl Iterator<Item = MonitorChoice> {
        let all = self.monitors.iter().copied();
        all.filter(|monitor| self.mode == Mode::Vector || *monitor == MonitorChoice::Ewma)
    }

    /// Monitors that were asked for and have nothing to watch in this mode.
    pub fn idle_monitors(&self) -> impl Iterator<Item = MonitorChoice> {
        let all = self.monitors.iter().copied();
        all.filter(|monitor| self.watching().all(|watching| watching != *monitor))
    }
}

/// Everything `receiver acquire` needs to know.
#[derive(Debug, Clone, PartialEq)]
pub struct AcquireConfig {
    /// The samples.
    pub recording: Recording,
    /// Satellites to look for, in order.
    pub prns: Vec<u8>,
    /// Largest Doppler looked for, Hz.
    pub doppler_max_hz: f64,
    /// Signal used, ms; the receiver's own stages where absent.
    pub integration_ms: Option<u32>,
    /// Whether to print JSON.
    pub json: bool,
    /// Threads; the results do not depend on it.
    pub threads: usize,
}
