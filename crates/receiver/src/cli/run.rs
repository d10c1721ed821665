//! `receiver run`.

use std::io::Write;

use gnss_signal::{IfCorrelatorBank, InstructionSet};

use super::print;
use crate::ReceiverError;
use crate::config::{Isa, RunConfig, RunOptions};
use crate::samples;
use crate::session::Session;
use crate::summary::Summary;

/// Samples kept, s: a channel starts at the first sample of its acquisition, so that no
/// navigation bit is lost while the search runs.
const HISTORY_S: f64 = 2.0;

pub(super) fn run(options: RunOptions, out: &mut dyn Write) -> Result<(), ReceiverError> {
    let session = Session::prepare(options.check()?)?;
    let config = session.config().clone();
    let (source, progress) = samples::open(&config.recording, config.quiet)?;
    let bank = IfCorrelatorBank::new(source, HISTORY_S, instruction_set(config.isa))?
        .with_search_threads(config.threads);
    let received = session.run(bank);
    progress.finish();
    print(out, &text(&config, &received?))
}

fn instruction_set(isa: Isa) -> InstructionSet {
    match isa {
        Isa::Auto => InstructionSet::detect(),
        Isa::Reference => InstructionSet::Reference,
        Isa::Portable => InstructionSet::Portable,
        Isa::Avx2 => InstructionSet::Avx2,
        Isa::Avx512 => InstructionSet::Avx512,
    }
}

/// What is said on the screen; the reason for no fix comes last.
fn text(config: &RunConfig, summary: &Summary) -> String {
    let files = config.out.as_ref().map_or_else(String::new, |directory| {
        format!("{:<12}{}\n", "files", directory.display())
    });
    format!("{files}{summary}")
}
