//! The command line.

mod acquire;
mod inspect;
mod run;
mod solve;

use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};

use crate::ReceiverError;
use crate::config::{AcquireOptions, RunOptions, SolveOptions};
use crate::summary::Summary;

/// GPS software receiver: samples in, positions out.
#[derive(Debug, Parser)]
#[command(name = "receiver", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Receive a recording: satellites, positions, observations
    #[command(after_help = RUN_NOTES)]
    Run(Box<RunOptions>),
    /// Say which satellites are at the start of a recording
    Acquire(AcquireOptions),
    /// Positions from the observations of another receiver
    #[command(after_help = SOLVE_NOTES)]
    Solve(Box<SolveOptions>),
    /// Say what a recording, a result or a RINEX navigation file holds
    #[command(after_help = INSPECT_NOTES)]
    Inspect {
        /// Recordings, result directories, summary.json, RINEX navigation files
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Sample format of recordings, as for `receiver run` [default: from the SigMF sidecar]
        #[arg(long, value_name = "F")]
        format: Option<String>,
        /// Samples (I, Q pairs where complex) per second [default: from the SigMF sidecar]
        #[arg(long, value_name = "HZ")]
        sample_rate: Option<f64>,
    },
}

const RUN_NOTES: &str = "\
Output files (--out): summary.json cost.json pvt.csv channels.csv events.jsonl observations.rnx
navigation.rnx track.kml track.nmea report.html, and taps.csv with --dump taps.
A position needs 4 satellites, and either 18 to 36 s of signal for their ephemerides or --nav;
less than about 6 s of signal need --nav, --position and --time.

Exit status: 0 done (also where no position was possible, which the last line says), 2 bad usage
or input.";

const SOLVE_NOTES: &str = "\
Output files (--out): summary.json cost.json pvt.csv channels.csv events.jsonl observations.rnx
track.pos track.kml track.nmea report.html. GPS L1 C/A; times are seconds since the first epoch.";

const INSPECT_NOTES: &str = "A recording without --format and sidecar is shown as bytes.";

/// Runs the command that `arguments` (program name first) ask for; what it finds goes to `out`.
///
/// # Errors
/// Any [`ReceiverError`]; its text is one line.
pub fn execute(
    arguments: impl IntoIterator<Item = OsString>,
    out: &mut dyn Write,
) -> Result<(), ReceiverError> {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => return Err(usage(&error)),
        Err(help) => return print(out, &help.render().to_string()),
    };
    match cli.command {
        Command::Run(options) => run::run(*options, out),
        Command::Acquire(options) => acquire::acquire(&options, out),
        Command::Solve(options) => solve::solve(&options, out),
        Command::Inspect {
            files,
            format,
            sample_rate,
        } => files
            .iter()
            .try_for_each(|file| inspect::inspect(file, format.as_deref(), sample_rate, out)),
    }
}

/// Whether an error only says that nobody reads the output any more, as with `| head`.
#[must_use]
pub fn is_closed_output(error: &ReceiverError) -> bool {
    matches!(error, ReceiverError::File { path, source }
        if path.as_os_str() == STANDARD_OUTPUT && source.kind() == ErrorKind::BrokenPipe)
}

const STANDARD_OUTPUT: &str = "standard output";

/// Writes `text` to standard output.
fn print(out: &mut dyn Write, text: &str) -> Result<(), ReceiverError> {
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(|source| ReceiverError::File {
        path: STANDARD_OUTPUT.into(),
        source,
    })
}

/// What is said on the screen: where the files are, what was found; the reason for no fix comes
/// last.
fn with_files(directory: Option<&Path>, summary: &Summary) -> String {
    let files = directory.map_or_else(String::new, |directory| {
        format!("{:<12}{}\n", "files", directory.display())
    });
    format!("{files}{summary}")
}

/// What is wrong with the options.
fn usage(error: &clap::Error) -> ReceiverError {
    let said = on_one_line(error);
    let what = if said.is_empty() || said.starts_with("GPS software") {
        "no command: expected run, acquire, solve or inspect"
    } else {
        &said
    };
    ReceiverError::Option {
        what: format!("{what} (see --help)"),
    }
}

/// The first paragraph of what clap says, on one line.
#[must_use]
pub fn on_one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let paragraph: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.is_empty())
        .collect();
    let said = paragraph.join(" ");
    said.strip_prefix("error: ").unwrap_or(&said).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn execute_words(words: &str) -> (Result<(), String>, String) {
        let mut out = Vec::new();
        let arguments = words.split_whitespace().map(OsString::from);
        let result = execute(arguments, &mut out).map_err(|error| error.to_string());
        (result, String::from_utf8(out).unwrap())
    }

    #[test]
    fn bad_usage_is_one_line() {
        for words in [
            "receiver",
            "receiver frobnicate",
            "receiver run --ratte 3",
            "receiver run --rate x",
            "receiver run --rate",
            "receiver run",
            "receiver run --input - --format ri8 --sample-rate 4e6 --if 0 --duration 0",
            "receiver acquire --input /nonexistent --format ri8 --sample-rate 4e6 --if 0",
            "receiver inspect /nonexistent",
            "receiver run --config /nonexistent.toml",
            "receiver solve",
            "receiver solve --obs /nonexistent",
            "receiver solve --obs /nonexistent --nav /nonexistent",
            "receiver solve --obs a --nav b --elevation-mask 95",
            "receiver solve --obs a --nav b --inject G01",
            "receiver solve --obs a --nav b --raim x",
            "receiver solve --obs a --nav b --truth c",
        ] {
            let message = execute_words(words).0.unwrap_err();
            assert!(
                !message.contains('\n') && message.len() > 10,
                "{words}: {message}"
            );
        }
    }

    #[test]
    fn help_names_units_and_defaults() {
        let (result, help) = execute_words("receiver run --help");
        result.unwrap();
        for option in [
            "--sample-rate <HZ>",
            "[default: 10]",
            "--position <LAT,LON,H>",
            "seconds",
        ] {
            assert!(help.contains(option), "{option} in {help}");
        }
        let help = execute_words("receiver solve --help").1;
        for option in ["--inject <FAULT>", "[default: 10]", "pso-pf", "track.pos"] {
            assert!(help.contains(option), "{option} in {help}");
        }
        assert!(
            execute_words("receiver --version")
                .1
                .starts_with("receiver 0.")
        );
    }

    #[test]
    fn a_closed_output_is_told_from_other_errors() {
        struct Closed;
        impl Write for Closed {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let error = execute(["receiver", "--help"].map(OsString::from), &mut Closed).unwrap_err();
        assert!(is_closed_output(&error));
        assert!(!is_closed_output(&usage(
            &Cli::try_parse_from(["receiver"]).unwrap_err()
        )));
    }
}
