//! The rules of the house that no compiler checks: layers, module comments, who touches the world.
//!
//! Findings carry file and line. Errors fail the task; warnings are listed.

mod layers;
mod sources;
mod text;

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Worth a look.
    Warning,
    /// Against the rules.
    Error,
}

/// Something that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// How bad.
    pub severity: Severity,
    /// File, relative to the workspace.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// What is wrong and what is expected.
    pub what: String,
}

impl Finding {
    pub(super) fn error(file: &str, line: usize, what: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            file: file.to_owned(),
            line,
            what: what.into(),
        }
    }

    pub(super) fn warning(file: &str, line: usize, what: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(file, line, what)
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        write!(f, "{}:{}: {severity}: {}", self.file, self.line, self.what)
    }
}

/// A text file of the tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct SourceFile {
    /// Path relative to the workspace, with `/`.
    pub(super) path: String,
    /// Its text.
    pub(super) text: String,
}

/// Checks the workspace at `root`.
///
/// # Errors
/// Where cargo or git do not answer, or a file cannot be read; findings are no errors.
pub fn tidy(root: &Path) -> Result<Vec<Finding>> {
    let metadata = output(root, "cargo", &METADATA)?;
    let mut findings = layers::check(&metadata)?;
    let files = tracked_files(root)?;
    findings.extend(sources::check(&files));
    findings.extend(text::check(&files));
    findings.sort_by(|a, b| (&a.file, a.line).cmp(&(&b.file, b.line)));
    Ok(findings)
}

const METADATA: [&str; 5] = [
    "metadata",
    "--no-deps",
    "--offline",
    "--format-version",
    "1",
];

/// The workspace this tool was built from.
#[must_use]
pub fn workspace_root() -> PathBuf {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.parent().unwrap_or(manifest).to_path_buf()
}

fn output(root: &Path, program: &str, arguments: &[&str]) -> Result<String> {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(root)
        .output()
        .with_context(|| format!("cannot run {program}"))?;
    ensure!(
        output.status.success(),
        "{program} {}: {}",
        arguments.join(" "),
        String::from_utf8_lossy(&output.stderr).trim()
    );
    Ok(String::from_utf8(output.stdout)?)
}

/// Text files that git tracks or would add.
fn tracked_files(root: &Path) -> Result<Vec<SourceFile>> {
    let list = output(
        root,
        "git",
        &["ls-files", "--cached", "--others", "--exclude-standard"],
    )?;
    let mut files = Vec::new();
    for path in list.lines() {
        // A file deleted but not yet committed, or one that is no text.
        let Ok(text) = fs::read_to_string(root.join(path)) else {
            continue;
        };
        let path = path.to_owned();
        files.push(SourceFile { path, text });
    }
    ensure!(!files.is_empty(), "{}: no files", root.display());
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_read_as_compiler_messages() {
        let finding = Finding::error("a/b.rs", 3, "no");
        assert_eq!(finding.to_string(), "a/b.rs:3: error: no");
    }

    #[test]
    fn files_are_found_with_their_text() {
        let files = tracked_files(&workspace_root()).unwrap();
        let own = files
            .iter()
            .find(|f| f.path == "xtask/src/tidy/mod.rs")
            .unwrap();
        assert!(own.text.starts_with("//!"));
    }
}
