//! `receiver solve`.

use std::io::Write;

use super::{print, with_files};
use crate::ReceiverError;
use crate::config::SolveOptions;
use crate::solve::SolveSession;

pub(super) fn solve(options: &SolveOptions, out: &mut dyn Write) -> Result<(), ReceiverError> {
    let config = options.check()?;
    let directory = config.out.clone();
    let summary = SolveSession::prepare(config)?.run()?;
    print(out, &with_files(directory.as_deref(), &summary))
}
