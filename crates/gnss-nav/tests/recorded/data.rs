//! Finding and reading the recorded files.

use std::path::PathBuf;
use std::process::Command;

/// The path of `name` in the test data, or `None` (said aloud) where there are none.
pub(crate) fn find(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GNSS_TEST_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(name);
    if path.exists() {
        Some(path)
    } else {
        eprintln!("SKIPPED: no test data ({name})");
        None
    }
}

/// The text of `name`, unpacked if it ends in `.gz`.
pub(crate) fn text(name: &str) -> Option<String> {
    let path = find(name)?;
    if !name.ends_with(".gz") {
        return Some(std::fs::read_to_string(path).expect("readable text"));
    }
    match Command::new("gzip").arg("-dc").arg(path).output() {
        Ok(output) => Some(String::from_utf8(output.stdout).expect("text")),
        Err(error) => {
            eprintln!("SKIPPED: no gzip ({error})");
            None
        }
    }
}

/// The rows of a comma-separated text after `header_lines`.
pub(crate) fn rows(text: &str, header_lines: usize) -> impl Iterator<Item = Vec<&str>> {
    text.lines()
        .skip(header_lines)
        .map(|line| line.split(',').collect())
}

/// Column `index` of a row as a number.
pub(crate) fn number(row: &[&str], index: usize) -> f64 {
    row[index].trim().parse().expect("a number")
}
