//! Reading the reference figures that lie beside the recorded data.

use std::path::PathBuf;

use serde_json::Value;

/// The text of a reference file, or `None`, said aloud, where there are none.
#[allow(clippy::print_stderr, reason = "a skip must not be silent")]
pub(crate) fn text(name: &str) -> Option<String> {
    let data = std::env::var_os("GNSS_TEST_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = data.join("../oracle").join(name);
    let text = std::fs::read_to_string(path).ok();
    if text.is_none() {
        eprintln!("SKIPPED: no reference figures ({name})");
    }
    text
}

/// Rows of numbers of a comma-separated file, comments aside.
pub(crate) fn rows(name: &str) -> Option<Vec<Vec<f64>>> {
    let text = text(name)?;
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let row = |line: &str| line.split(',').map(|x| x.trim().parse().unwrap()).collect();
    Some(lines.map(row).collect())
}

/// The array at `pointer` as numbers.
pub(crate) fn numbers(value: &Value, pointer: &str) -> Vec<f64> {
    let array = value.pointer(pointer).unwrap().as_array().unwrap();
    array.iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The array of arrays at `pointer`.
pub(crate) fn matrix(value: &Value, pointer: &str) -> Vec<Vec<f64>> {
    let rows = value.pointer(pointer).unwrap().as_array().unwrap().len();
    (0..rows)
        .map(|row| numbers(value, &format!("{pointer}/{row}")))
        .collect()
}

/// How far two numbers may be apart: 1e-8 of their size or of one.
pub(crate) fn assert_close(found: f64, expected: f64, what: &str) {
    let apart = (found - expected).abs();
    assert!(
        apart <= 1e-8 * expected.abs().max(1.0),
        "{what}: {found}, expected {expected}"
    );
}
