//! Recorded data for tests of this crate.

use std::path::{Path, PathBuf};

/// The file `name`, or a loud word that it is absent; `GNSS_TEST_DATA` names another folder.
// A test that checks nothing has to say so.
#[allow(clippy::print_stdout)]
pub(crate) fn data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GNSS_TEST_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(name);
    if !path.exists() {
        println!("SKIPPED: no test data {}", path.display());
        return None;
    }
    Some(path)
}
