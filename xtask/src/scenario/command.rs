//! `cargo xtask scenario`: list, make and run.

use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use gnss_signal::{IfCorrelatorBank, InstructionSet};
use receiver::config::RunOptions;
use receiver::session::Session;
use receiver::summary::Summary;

use super::built::Scenario;
use super::catalogue;
use super::correlator_level::CorrelatorLevelBank;
use super::if_signal::Synthesiser;
use super::make::{self, Level};
use super::spec::ScenarioFile;

/// What to do with scenarios.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Name the embedded scenarios
    List,
    /// Write a scenario: samples with SigMF sidecar, receiver.toml, truth.csv, satellites.csv,
    /// faults.csv, navigation.rnx
    Make(Which),
    /// Make a scenario and receive it in one go, nothing large on disk; options of `receiver run`
    /// may follow
    Run {
        /// Which scenario
        #[command(flatten)]
        which: Which,
        /// Options of `receiver run`, over those of the scenario
        #[arg(
            trailing_var_arg = true,
            allow_hyphen_values = true,
            value_name = "RECEIVER OPTIONS"
        )]
        receiver: Vec<OsString>,
    },
}

/// Which scenario, where to, and at which level.
#[derive(Debug, Args)]
pub struct Which {
    /// Name of an embedded scenario, or a TOML file
    #[arg(value_name = "NAME|FILE.toml")]
    name: String,
    /// Folder of the results
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Level at which signals are made
    #[arg(long, value_enum, default_value = "if")]
    pub(crate) level: Level,
    /// Seed in place of the scenario's
    #[arg(long, value_name = "N")]
    scenario_seed: Option<u64>,
    /// Value in place of the scenario's, for instance front_end.sample_rate_hz=4e6; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
}

impl Which {
    pub(crate) fn scenario(&self) -> Result<Scenario> {
        let mut file = catalogue::find(&self.name)?;
        if !self.overrides.is_empty() {
            file = file.with(&self.overrides)?;
        }
        Scenario::new(&file, self.scenario_seed)
    }
}

/// Does what `command` asks for and returns what is to be said.
///
/// # Errors
/// One line: what, where, what was expected.
pub fn perform(command: &Command) -> Result<String> {
    match command {
        Command::List => list(),
        Command::Make(which) => {
            let scenario = which.scenario()?;
            make::make(&scenario, which.level, &which.out)?;
            Ok(format!("{} is in {}\n", scenario.name, which.out.display()))
        }
        Command::Run { which, receiver } => {
            let summary = receive(&which.scenario()?, which.level, &which.out, receiver)?;
            Ok(summary.to_string())
        }
    }
}

fn list() -> Result<String> {
    let mut text = String::new();
    for name in catalogue::names() {
        let file: ScenarioFile = catalogue::find(name)?;
        let seconds = file.spec.duration_s.get_ref();
        writeln!(text, "{name:20} {seconds:6} s  {}", file.spec.description)?;
    }
    Ok(text)
}

/// The receiver's options as a command, so that they are read and checked as ever.
#[derive(Parser)]
#[command(name = "receiver options", no_binary_name = true)]
struct ReceiverOptions {
    #[command(flatten)]
    options: RunOptions,
}

/// Makes `scenario` at `level` and receives it; its truth goes to `out/scenario`, what the receiver
/// finds to `out`.
///
/// # Errors
/// Where the scenario or the receiver fails.
pub fn receive(
    scenario: &Scenario,
    level: Level,
    out: &Path,
    options: &[OsString],
) -> Result<Summary> {
    let given = ReceiverOptions::try_parse_from(options).map_err(|error| {
        let text = error.render().to_string();
        let line = text.lines().next().unwrap_or_default();
        anyhow::anyhow!("{}", line.trim_start_matches("error: ").to_owned())
    })?;
    if given.options.input.is_some() || given.options.format.is_some() {
        bail!("--input and --format come from the scenario");
    }
    let folder = out.join("scenario");
    make::make(scenario, Level::Correlator, &folder)?;
    let file = RunOptions::read(&folder.join("receiver.toml"))?;
    let mut options = given.options.or(file);
    // Nothing is read from it: the samples come from the scenario.
    options.input = Some("-".into());
    options.out = Some(out.to_owned());
    options.quiet = true;
    let session = Session::prepare(options.check()?)?;
    let scene = scenario.scene();
    match level {
        Level::If => {
            let bank =
                IfCorrelatorBank::new(Synthesiser::new(scene)?, 2.0, InstructionSet::detect())
                    .context("scenario")?;
            Ok(session.run(bank)?)
        }
        Level::Correlator => Ok(session.run(CorrelatorLevelBank::new(scene)?)?),
    }
}
