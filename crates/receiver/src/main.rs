//! The `receiver` command.

use std::io::{self, Write};
use std::process::ExitCode;

use receiver::cli;

fn main() -> ExitCode {
    match cli::execute(std::env::args_os(), &mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if cli::is_closed_output(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // Where standard error is closed too, the exit status has to say it all.
            let _ = writeln!(io::stderr(), "receiver: {error}");
            ExitCode::from(2)
        }
    }
}
