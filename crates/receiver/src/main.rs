//! The `receiver` command.

use std::io::{self, Write};
use std::process::ExitCode;

use receiver::cli;

fn main() -> ExitCode {
    match cli::execute(std::env::args_os(), &mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if cli::is_closed_output(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // One line, even where a file name or a value has more.
            let line = error.to_string().replace(['\n', '\r'], " ");
            // Where standard error is closed too, the exit status has to say it all.
            let _ = writeln!(io::stderr(), "receiver: {line}");
            ExitCode::from(2)
        }
    }
}
