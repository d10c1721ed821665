//! The checks of the tree, all of them: what `.ci/run` runs.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

/// Runs `.ci/run` of the workspace at `root`; tells whether everything passed.
///
/// # Errors
/// Where the script cannot be started.
pub fn ci(root: &Path) -> Result<bool> {
    let script = root.join(".ci/run");
    let status = Command::new(&script)
        .current_dir(root)
        .status()
        .with_context(|| format!("cannot run {}", script.display()))?;
    Ok(status.success())
}
