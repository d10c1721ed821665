//! Command line of the project tasks.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};
use receiver::cli::on_one_line;
use xtask::campaign::campaign;
use xtask::ci::ci;
use xtask::code_noise::{self, Experiment, Parts};
use xtask::demo::demo;
use xtask::reproduce::{Making, Outcome, Paper, reproduce};
use xtask::scenario::command::{self as scenario, Command, Which};
use xtask::scenario::make::Level;
use xtask::tidy::{Severity, tidy, workspace_root};
use xtask::train::{Trained, command as training};
use xtask::validate::threshold::Thresholds;
use xtask::validate::{
    consistency, front_ends, generalisation, levels, monitors, sensitivity, shape, starts, urban,
};

#[derive(Debug, Parser)]
#[command(
    name = "cargo xtask",
    about = "Project tasks",
    disable_help_subcommand = true
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// The main job on an embedded default: make, receive, judge, draw
    Demo {
        /// Seed in place of the scenario's
        #[arg(long, value_name = "N")]
        seed: Option<u64>,
        /// Folder of the results
        #[arg(long, value_name = "DIR", default_value = "target/demo")]
        out: PathBuf,
    },
    /// Signals with truth and faults: list, make, run
    #[command(subcommand)]
    Scenario(Command),
    /// Code tracking error at sample rates with and without an integer number of samples per chip.
    CodeNoise {
        /// C/N0 before the front end, dB-Hz.
        #[arg(long, value_name = "DBHZ", default_value_t = 45.0)]
        cn0: f64,
        /// Judged signal of each run, s.
        #[arg(long, value_name = "S", default_value_t = 20.0)]
        judged: f64,
        /// Signal before that, s.
        #[arg(long, value_name = "S", default_value_t = 10.0)]
        settle: f64,
        /// Runs of each case.
        #[arg(long, value_name = "N", default_value_t = 8)]
        seeds: u64,
        /// Code loop bandwidth, Hz [default: the receiver's]
        #[arg(long, value_name = "HZ")]
        code_bandwidth: Option<f64>,
        /// The receiver's loop at 45 dB-Hz from short runs: what sampling does, and noise, apart
        #[arg(long, conflicts_with_all = ["cn0", "judged", "settle", "code_bandwidth"])]
        parts: bool,
    },
    /// Experiments on receiver, monitors and generator that take minutes: tables with a verdict
    #[command(subcommand)]
    Validate(Validation),
    /// Repeat the experiments of a paper: summary.json, report.md and pictures.
    Reproduce {
        /// Which paper.
        #[arg(value_enum)]
        paper: Paper,
        /// How the signals of jiang2017, li2019 and zhu2020 are made [default: if, correlator, correlator]
        #[arg(long, value_enum)]
        level: Option<Level>,
        /// Seeds of each scenario of jiang2017, li2019 and zhu2020 [default: 8, 12, 16]
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
        seeds: Option<u16>,
        /// Folder that receives a folder of the paper's name, and of all papers an index.
        #[arg(long, value_name = "DIR", default_value = "reproduced")]
        out: PathBuf,
    },
    /// Many seeded runs of scenarios, one row each; taken up again where it was left
    Campaign {
        /// Cases, seeds and options (docs/scenarios.md)
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
        /// Folder of the rows
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Train a monitor on made-up runs, write model and card
    Train {
        /// Which monitor
        #[arg(value_enum)]
        monitor: Trained,
        /// Learn from these labelled steps (CSV, as --save-data writes them); choices are made by runs all the same
        #[arg(long, value_name = "CSV")]
        data: Option<PathBuf>,
        /// Also write the labelled steps
        #[arg(long, value_name = "CSV")]
        save_data: Option<PathBuf>,
        /// Scenarios made and received
        #[arg(long, value_name = "N", default_value_t = training::RUNS, value_parser = clap::value_parser!(u32).range(40..))]
        runs: u32,
        /// Folder of the model
        #[arg(long, value_name = "DIR", default_value = "assets/models")]
        out: PathBuf,
    },
    /// Receive a scenario by vector tracking that leaves nothing out, and write what its monitors were shown at every
    /// update, labelled with the truth (steps.csv)
    Steps(Which),
    /// Check the layers, module comments and what no compiler checks.
    Tidy,
    /// Run every check of the tree, as .ci/run does.
    Ci,
}

#[derive(Debug, Subcommand)]
enum Validation {
    /// The receiver, alone, on `static-open-sky` at four sample rates in 1, 2 and 8 bits
    FrontEnds {
        /// Signal of each run, s
        #[arg(long, value_name = "S", default_value_t = 60.0)]
        duration: f64,
        /// Seed in place of the scenario's
        #[arg(long, value_name = "N")]
        seed: Option<u64>,
        /// Folder of what the receiver writes
        #[arg(long, value_name = "DIR", default_value = "target/front-ends")]
        out: PathBuf,
    },
    /// The receiver's position error at the correlator level against that on samples
    Levels {
        /// Runs of each level
        #[arg(long, value_name = "N", default_value_t = 240)]
        runs: u64,
    },
    /// Whether the filter of vector tracking errs as it says (NEES, NIS)
    Consistency {
        /// Runs of each form of the frequency discriminator
        #[arg(long, value_name = "N", default_value_t = 100)]
        runs: u16,
    },
    /// Down to which C/N0 vector tracking knows where it is, on a circle, through turns and at rest
    Sensitivity {
        /// Runs of each motion
        #[arg(long, value_name = "N", default_value_t = 16)]
        runs: u16,
    },
    /// Starts of vector tracking anywhere in a frame, while satellites rise and set
    Starts {
        /// How many
        #[arg(long, value_name = "N", default_value_t = 100)]
        runs: u16,
    },
    /// What the channel monitors find and how often they are wrong, at one rate of false alarms
    Monitors {
        /// Folder of the models
        #[arg(long, value_name = "DIR", default_value = "assets/models")]
        models: PathBuf,
        /// Healthy channel-hours that false alarms are counted in, reckoned with nine channels a run, of which about seven
        /// come; thresholds are found in 0.75 times as many others
        #[arg(long, value_name = "H", default_value_t = 1400.0)]
        hours: f64,
        /// Scenarios with faults
        #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u32).range(40..))]
        runs: u32,
        /// Also write thresholds and figures into the models' cards
        #[arg(long)]
        write: bool,
        /// Folder of ROC, delays, Stanford plots and all figures
        #[arg(long, value_name = "DIR", default_value = "target/monitors")]
        out: PathBuf,
    },
    /// What trained monitors make of faults, motions and clocks that they have not learned from
    Generalisation {
        /// Scenarios learned from, and as many tested on
        #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(120..))]
        runs: u32,
    },
    /// False alarms of the chart on the shape of the correlation in closed loops: the paper's with its table of limits,
    /// and the receiver's as it begins
    Shape {
        /// Simulated over all C/N0, channel-hours
        #[arg(long, value_name = "H", default_value_t = 378.0, value_parser = positive)]
        hours: f64,
    },
    /// What the monitors make of a street between houses, by several seeds
    Urban {
        /// Runs of each receiver, stand-alone and assisted
        #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..))]
        seeds: u16,
    },
    /// The C/N0 at which channels are lost, steered by one filter against loops that share nothing
    Threshold {
        /// Runs of each point
        #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u16).range(1..))]
        runs: u16,
    },
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        // Help and version.
        Err(error) if error.exit_code() == 0 => error.exit(),
        Err(error) => return wrong(&format!("{} (see --help)", on_one_line(&error))),
    };
    match perform(arguments.task) {
        Ok(code) => code,
        Err(error) => wrong(&format!("{error:#}")),
    }
}

fn wrong(what: &str) -> ExitCode {
    // Nothing is left to do where standard error is closed too.
    let _ = writeln!(io::stderr(), "error: {what}");
    ExitCode::from(2)
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "no number".to_owned())?;
    let is_positive = value.is_finite() && value > 0.0;
    is_positive
        .then_some(value)
        .ok_or_else(|| "expected above 0".to_owned())
}

const fn verdict(holds: bool) -> ExitCode {
    if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn validate(validation: &Validation, out: &mut impl Write) -> Result<ExitCode> {
    let (text, holds) = match validation {
        Validation::FrontEnds {
            duration,
            seed,
            out: folder,
        } => {
            let table = front_ends::table(*duration, *seed, folder)?;
            (table.to_string(), table.holds())
        }
        Validation::Levels { runs } => {
            let comparison = levels::compare(*runs)?;
            (comparison.to_string(), comparison.holds())
        }
        Validation::Consistency { runs } => {
            let table = consistency::table(usize::from(*runs))?;
            (table.to_string(), table.holds())
        }
        Validation::Sensitivity { runs } => {
            let table = sensitivity::table(usize::from(*runs))?;
            (table.to_string(), table.holds())
        }
        Validation::Starts { runs } => {
            let table = starts::table(usize::from(*runs))?;
            (table.to_string(), table.holds())
        }
        Validation::Monitors {
            models,
            hours,
            runs,
            write,
            out: folder,
        } => {
            let table = monitors::table(models, *hours, *runs)?;
            table.draw(folder)?;
            if *write {
                table.write(models)?;
            }
            (table.to_string(), table.holds())
        }
        Validation::Generalisation { runs } => (generalisation::table(*runs)?.to_string(), true),
        Validation::Shape { hours } => {
            let table = shape::table(*hours)?;
            (table.to_string(), table.holds())
        }
        Validation::Urban { seeds } => {
            let table = urban::table(usize::from(*seeds))?;
            (table.to_string(), table.holds())
        }
        Validation::Threshold { runs } => {
            let thresholds = Thresholds::sweep(usize::from(*runs))?;
            (thresholds.to_string(), thresholds.holds())
        }
    };
    writeln!(out, "{text}")?;
    Ok(verdict(holds))
}

fn perform(task: Task) -> Result<ExitCode> {
    let mut out = io::stdout().lock();
    match task {
        Task::Demo { seed, out: folder } => {
            let demo = demo(seed, &folder)?;
            writeln!(out, "{demo}")?;
            Ok(verdict(demo.holds()))
        }
        Task::Scenario(command) => {
            write!(out, "{}", scenario::perform(&command)?)?;
            Ok(ExitCode::SUCCESS)
        }
        Task::CodeNoise {
            cn0,
            judged,
            settle,
            seeds,
            code_bandwidth,
            parts,
        } => {
            if parts {
                let parts = Parts::new(seeds);
                writeln!(out, "{}", code_noise::table(|case| parts.measure(case))?)?;
                return Ok(ExitCode::SUCCESS);
            }
            let mut experiment = Experiment {
                cn0_dbhz: cn0,
                judged_s: judged,
                settle_s: settle,
                seeds,
                ..Experiment::default()
            };
            if let Some(bandwidth_hz) = code_bandwidth {
                experiment = experiment.with_code_bandwidth(bandwidth_hz);
            }
            let measure = |case| code_noise::measure(&experiment, case);
            writeln!(out, "{}", code_noise::table(measure)?)?;
            Ok(ExitCode::SUCCESS)
        }
        Task::Validate(validation) => validate(&validation, &mut out),
        Task::Reproduce {
            paper,
            level,
            seeds,
            out: folder,
        } => {
            let seeds = seeds.map(usize::from);
            let told = |outcome: &Outcome| Ok(writeln!(out, "{outcome}")?);
            let outcomes = reproduce(paper, Making { level, seeds }, &folder, told)?;
            Ok(verdict(outcomes.iter().all(Outcome::holds)))
        }
        Task::Campaign { file, out: folder } => {
            write!(out, "{}", campaign(&file, &folder)?)?;
            Ok(ExitCode::SUCCESS)
        }
        Task::Train {
            monitor,
            data,
            save_data,
            runs,
            out: folder,
        } => {
            let data = match data {
                Some(path) => training::read(&path)?,
                None => training::simulate(runs)?,
            };
            if let Some(path) = save_data {
                training::write(&data, &path)?;
            }
            let model = training::train(monitor, &data, runs)?;
            training::write_model(&model, &folder)?;
            write!(out, "{}", training::Summary(&model))?;
            Ok(ExitCode::SUCCESS)
        }
        Task::Steps(which) => {
            write!(out, "{}", training::export(&which)?)?;
            Ok(ExitCode::SUCCESS)
        }
        Task::Tidy => {
            let findings = tidy(&workspace_root())?;
            for finding in &findings {
                writeln!(out, "{finding}")?;
            }
            let errors = findings
                .iter()
                .filter(|f| f.severity == Severity::Error)
                .count();
            writeln!(
                out,
                "tidy: {errors} errors, {} warnings",
                findings.len() - errors
            )?;
            Ok(verdict(errors == 0))
        }
        Task::Ci => Ok(verdict(ci(&workspace_root())?)),
    }
}
