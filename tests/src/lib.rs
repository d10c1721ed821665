//! What the end-to-end tests share: the recordings, and runs of the receiver on them.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "support of tests: a failure here is a failed test"
)]

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

/// Folder of the recordings, or a loud word that it is absent.
///
/// `GNSS_TEST_DATA` names another one.
#[must_use]
pub fn test_data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("GNSS_TEST_DATA").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    announce_skip("the recordings (GNSS_TEST_DATA) are absent");
    None
}

/// Says aloud that a test did not run.
#[allow(clippy::print_stderr, reason = "a skip must not be silent")]
pub fn announce_skip(why: &str) {
    eprintln!("SKIPPED: {why}");
}

/// A recording and what is needed to read it.
#[derive(Debug, Clone, Copy)]
pub struct Recording {
    /// Its name in `reference_acquisition.json`.
    pub reference: &'static str,
    /// File below the folder of the recordings.
    pub file: &'static str,
    /// Arguments that describe its samples.
    pub samples: [&'static str; 6],
}

/// Describes a recording.
const fn recording(
    reference: &'static str,
    file: &'static str,
    format: &'static str,
    rate: &'static str,
    intermediate: &'static str,
) -> Recording {
    Recording {
        reference,
        file,
        samples: [
            "--format",
            format,
            "--sample-rate",
            rate,
            "--if",
            intermediate,
        ],
    }
}

/// 107 ms in flight, real.
pub const FLIGHT: Recording = recording(
    "braunschweig_flight",
    "if/braunschweig_flight/sxnsr_test_data_flight.stream",
    "r2_lsb",
    "20.48e6",
    "5499998.47412109",
);
/// 500 ms, real, spectrum inverted.
pub const POCKET_4MHZ: Recording = recording(
    "pocketsdr_4MHz",
    "if/pocketsdr/L1_20211202_084700_4MHz_IQ.bin",
    "ci8",
    "4e6",
    "0",
);
/// 100 ms, real, with samples lost after 87 ms.
pub const POCKET_12MHZ: Recording = recording(
    "pocketsdr_12MHz",
    "if/pocketsdr/L1_20211125_004000_12MHz_I.bin",
    "ri8",
    "12e6",
    "3e6",
);
/// 4 ms, real.
pub const CTTC: Recording = recording(
    "cttc",
    "if/cttc/GSoC_CTTC_capture_2012_07_26_4Msps_4ms.dat",
    "cf32_le",
    "4e6",
    "0",
);
/// 11 ms, real.
pub const PEREGRINE: Recording = recording(
    "peregrine",
    "if/peregrine/test_samples.dat",
    "ri8",
    "16.368e6",
    "4.092e6",
);
/// 89.9 s by an independent simulator, one bit a component.
pub const STATIC: Recording = recording(
    "simulated_static",
    "if/simulated_static/gpsl1_static_2600k_1bit.iq1",
    "c1_msb",
    "2.6e6",
    "0",
);

/// Options with which every channel of vector tracking is watched by all there is.
pub const EVERY_MONITOR: [&str; 8] = [
    "--monitor",
    "innovation",
    "--monitor",
    "svm",
    "--monitor",
    "lstm",
    "--monitor",
    "ewma",
];

/// What a run of the receiver left behind.
pub struct Run {
    /// What it printed.
    pub stdout: String,
    folder: TempDir,
}

impl Run {
    /// Path of an output file.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Text of an output file.
    #[must_use]
    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect("output file")
    }

    /// `summary.json`.
    #[must_use]
    pub fn summary(&self) -> Value {
        serde_json::from_str(&self.text("summary.json")).expect("summary is JSON")
    }

    /// `events.jsonl`, those of one kind.
    #[must_use]
    pub fn events(&self, kind: &str) -> Vec<Value> {
        let text = self.text("events.jsonl");
        let all = text
            .lines()
            .map(|l| serde_json::from_str::<Value>(l).expect("event"));
        all.filter(|e| e["kind"] == kind).collect()
    }

    /// Rows of a CSV output file by column name.
    #[must_use]
    pub fn rows(&self, name: &str) -> Vec<BTreeMap<String, String>> {
        table(&self.text(name))
    }
}

/// Rows of the text of a CSV file by column name.
#[must_use]
pub fn table(text: &str) -> Vec<BTreeMap<String, String>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("header").split(',').collect();
    let row = |line: &str| {
        let pairs = names.iter().zip(line.split(','));
        pairs
            .map(|(n, v)| ((*n).to_owned(), v.to_owned()))
            .collect()
    };
    lines.map(row).collect()
}

/// Runs `receiver run` on a recording.
#[must_use]
pub fn receive(data: &Path, recording: &Recording, more: &[&str]) -> Run {
    let folder = tempfile::tempdir().expect("temporary folder");
    let input = data.join(recording.file);
    let mut arguments: Vec<OsString> = vec!["receiver".into(), "run".into(), "--input".into()];
    arguments.push(input.into());
    arguments.extend(recording.samples.iter().chain(more).map(OsString::from));
    arguments.extend(["--quiet".into(), "--out".into(), folder.path().into()]);
    let mut stdout = Vec::new();
    receiver::cli::execute(arguments, &mut stdout).expect("the run succeeds");
    Run {
        stdout: String::from_utf8(stdout).expect("text"),
        folder,
    }
}

/// A number of a CSV row.
#[must_use]
pub fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name]
        .parse()
        .unwrap_or_else(|_| panic!("{name} is '{}'", row[name]))
}
