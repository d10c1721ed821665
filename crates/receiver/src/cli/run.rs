//! `receiver run`.

use std::io::Write;

use gnss_signal::{IfCorrelatorBank, InstructionSet};

use super::{print, with_files};
use crate::ReceiverError;
use crate::config::{Isa, MonitorChoice, RunConfig, RunOptions};
use crate::samples;
use crate::session::Session;

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
    let idle = idle(&config).unwrap_or_default();
    let summary = with_files(config.out.as_deref(), &received?);
    print(out, &format!("{idle}{summary}"))
}

/// Says which monitors were asked for in vain.
fn idle(config: &RunConfig) -> Option<String> {
    let names: Vec<_> = config.idle_monitors().map(MonitorChoice::name).collect();
    let said = format!(
        "{:<12}{} not used: only in --mode vector\n",
        "monitors",
        names.join(", ")
    );
    (!names.is_empty()).then_some(said)
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
