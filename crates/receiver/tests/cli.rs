//! The built command: same bytes however samples come in, and one clear line for bad input.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

const SIMULATED: &[&str] = &["--format", "c1_msb", "--sample-rate", "2600000"];
const REAL_8BIT: &[&str] = &["--format", "ri8", "--sample-rate", "4e6", "--if", "1e6"];

fn command(input: &Path, options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_receiver"));
    command.arg("run").arg("--input").arg(input).args(options);
    command.stdin(Stdio::null());
    command
}

fn run(input: &Path, options: &[&str]) -> Output {
    command(input, options).output().unwrap()
}

fn run_into(out: &Path, input: &Path, options: &[&str]) -> Output {
    let mut command = command(input, options);
    command.arg("--out").arg(out).output().unwrap()
}

/// The one line of a refusal: exit status 2, nothing on standard output.
fn refusal(output: &Output) -> String {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(output.stdout.is_empty(), "standard output of: {text}");
    assert!(
        text.lines().count() == 1 && text.starts_with("receiver: "),
        "{text}"
    );
    text
}

/// What a successful run says; nothing on standard error.
fn said(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Bytes without pattern, the same every time.
fn noise(count: usize) -> Vec<u8> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let next = |_| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    (0..count).map(next).collect()
}

/// Little-endian floats without pattern.
fn float_noise(count: usize) -> Vec<u8> {
    let values = noise(count).into_iter().map(|b| f32::from(b) - 127.5);
    values.flat_map(f32::to_le_bytes).collect()
}

fn file(folder: &TempDir, name: &str, content: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, content).unwrap();
    path
}

/// Every file of a directory but `cost.json`, which holds times.
fn results(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(directory).unwrap().map(Result::unwrap);
    entries
        .map(|e| (e.file_name().into_string().unwrap(), e.path()))
        .filter(|(name, _)| name != "cost.json")
        .map(|(name, path)| (name, fs::read(path).unwrap()))
        .collect()
}

#[allow(clippy::print_stdout, reason = "a skipped test says so")]
fn say(text: &str) {
    println!("{text}");
}

/// Three seconds of a simulated recording, its ephemerides and the options of an assisted start.
struct Assisted {
    folder: TempDir,
    samples: PathBuf,
    nav: PathBuf,
}

impl Assisted {
    fn new() -> Option<Self> {
        let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
        let data = std::env::var_os("GNSS_TEST_DATA").map_or_else(|| default.into(), PathBuf::from);
        let data = data.join("if/simulated_static");
        let Ok(whole) = fs::read(data.join("gpsl1_static_2600k_1bit.iq1")) else {
            say("SKIPPED: no test data");
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        Some(Self {
            // 2.6 MHz, 2 bits a sample.
            samples: file(&folder, "samples", &whole[..3 * 650_000]),
            nav: data.join("brdc0010.22n"),
            folder,
        })
    }

    fn options<'a>(nav: &'a Path, time: &'a str) -> Vec<&'a str> {
        let nav = nav.to_str().unwrap();
        let aid = ["--time", time, "--position", "35.7,139.8,0", "--nav", nav];
        [SIMULATED, &aid].concat()
    }
}

/// Runs `samples` from the file, again, with two threads and from standard input, and compares.
fn same_however_they_come(folder: &Path, samples: &Path, options: &[&str]) {
    let out = |name: &str| folder.join(name);
    said(&run_into(&out("file"), samples, options));
    said(&run_into(&out("again"), samples, options));
    let two = [options, &["--threads", "2"]].concat();
    said(&run_into(&out("threads"), samples, &two));
    let mut piped = command(Path::new("-"), options);
    piped.arg("--out").arg(out("stdin"));
    piped.stdin(File::open(samples).unwrap());
    said(&piped.output().unwrap());
    let expected = results(&out("file"));
    assert!(expected.contains_key("summary.json"));
    for other in ["again", "threads", "stdin"] {
        let found = results(&out(other));
        assert!(found.keys().eq(expected.keys()), "{other}");
        for (name, bytes) in &expected {
            assert!(&found[name] == bytes, "{other}: {name} differs");
        }
    }
}

#[test]
fn a_recording_gives_the_same_bytes_from_file_and_pipe_and_on_two_threads() {
    let Some(assisted) = Assisted::new() else {
        return;
    };
    let mut options = Assisted::options(&assisted.nav, "2190:540000");
    options.extend(["--dump", "taps"]);
    let folder = assisted.folder.path();
    same_however_they_come(folder, &assisted.samples, &options);
    let fixes = fs::read_to_string(folder.join("file/pvt.csv")).unwrap();
    // At 10 Hz, from the first tenths of a second on.
    assert!(fixes.lines().count() > 25, "{fixes}");
}

#[test]
fn noise_gives_the_same_bytes_and_the_last_line_says_what_was_looked_for() {
    let folder = tempfile::tempdir().unwrap();
    let samples = file(&folder, "noise", &noise(300_000));
    same_however_they_come(folder.path(), &samples, REAL_8BIT);
    let text = said(&run(&samples, REAL_8BIT));
    for part in [
        "no satellite acquired in 0.075 s",
        "looked for 32 satellites within +-12.0 kHz",
        "wrong format, sample rate or intermediate frequency?",
    ] {
        assert!(text.lines().last().unwrap().contains(part), "{text}");
    }
}

#[test]
fn a_wrong_format_or_rate_acquires_nothing() {
    let Some(assisted) = Assisted::new() else {
        return;
    };
    for options in [
        ["--format", "ci8", "--sample-rate", "2600000"],
        ["--format", "c1_msb", "--sample-rate", "2500000"],
    ] {
        let text = said(&run(&assisted.samples, &options));
        assert!(text.contains("no satellite acquired"), "{text}");
    }
}

#[test]
fn what_holds_no_samples_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (folder.path().join("missing"), "missing: No such file"),
        (
            file(&folder, "empty", &[]),
            "empty: empty: expected samples",
        ),
        (folder.path().to_owned(), "is a directory"),
        // A code period has 4000 samples.
        (file(&folder, "short", &noise(3000)), "less than 1 ms"),
        (PathBuf::from("-"), "standard input: empty"),
    ];
    for (path, expected) in cases {
        let line = refusal(&run(&path, REAL_8BIT));
        assert!(line.contains(expected), "{line}");
    }
}

#[test]
fn odd_ends_of_a_recording_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let whole = noise(320_000);
    for format in ["ci8", "ci16_le", "ri16_le"] {
        let options = ["--format", format, "--sample-rate", "4e6", "--if", "0"];
        let summary = |length: usize| {
            let samples = file(&folder, "samples", &whole[..length]);
            let out = folder.path().join(format);
            said(&run_into(&out, &samples, &options));
            fs::read(out.join("summary.json")).unwrap()
        };
        assert_eq!(summary(319_993), summary(319_992), "{format}");
    }
}

#[test]
fn a_pipe_that_ends_in_the_middle_of_a_sample_is_received() {
    let mut command = command(
        Path::new("-"),
        &["--format", "cf32_le", "--sample-rate", "2e6"],
    );
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let bytes = float_noise(40_000);
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&bytes[..bytes.len() - 3]).unwrap();
    drop(pipe);
    let text = said(&child.wait_with_output().unwrap());
    // 20000 samples less the broken one.
    assert!(text.contains("no satellite acquired in 0.010 s"), "{text}");
}

#[test]
fn samples_that_are_no_numbers_are_refused_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = float_noise(400_000);
    let options = ["--format", "cf32_le", "--sample-rate", "4e6"];
    said(&run(&file(&folder, "good", &bytes), &options));
    bytes[4 * 300_001..4 * 300_002].copy_from_slice(&f32::NAN.to_le_bytes());
    let out = folder.path().join("out");
    let line = refusal(&run_into(&out, &file(&folder, "bad", &bytes), &options));
    assert!(line.contains("bad: sample 150000 is not finite"), "{line}");
    assert_eq!(fs::read_dir(&out).unwrap().count(), 0, "files are left");
}

#[test]
fn a_broken_sidecar_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let samples = file(&folder, "a.bin", &noise(100_000));
    for broken in [
        "{\"global\":",
        "[]",
        "{\"global\":{\"core:datatype\":\"ci7\"}}",
        "{\"global\":{\"core:datatype\":\"two\\nlines\"}}",
    ] {
        file(&folder, "a.bin.sigmf-meta", broken.as_bytes());
        let line = refusal(&run(&samples, REAL_8BIT));
        assert!(line.contains("a.bin.sigmf-meta: "), "{line}");
    }
    file(&folder, "a.bin.sigmf-meta", b"{\"global\":{}}");
    let line = refusal(&run(&samples, &[]));
    assert!(line.contains("--format is missing"), "{line}");
}

#[test]
fn options_out_of_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let samples = file(&folder, "a", &noise(100_000));
    for (option, value, expected) in [
        ("--duration", "0", "above 0"),
        ("--duration", "-1", "above 0"),
        ("--duration", "0.0001", "less than 1 ms"),
        ("--start", "100", "ends before --start 100"),
        ("--rate", "1000", "at most 50"),
        ("--elevation-mask", "91", "0 to 90"),
        ("--prn", "38", "1 to 37"),
        ("--time", "2190", "WEEK:TOW"),
        ("--position", "95,0,0", "LAT,LON,H"),
    ] {
        let options = [REAL_8BIT, &[option, value]].concat();
        let line = refusal(&run(&samples, &options));
        assert!(line.contains(expected), "{option} {value}: {line}");
    }
    for (rate, frequency) in [("1e12", "0"), ("nan", "0"), ("4e6", "3e6"), ("4e6", "inf")] {
        let options = ["--format", "ri8", "--sample-rate", rate, "--if", frequency];
        refusal(&run(&samples, &options));
    }
}

#[test]
fn ephemerides_of_another_day_and_none_at_all_are_refused() {
    let Some(assisted) = Assisted::new() else {
        return;
    };
    let options = Assisted::options(&assisted.nav, "2192:540000");
    let line = refusal(&run(&assisted.samples, &options));
    let expected = ["brdc0010.22n: ", "same day"];
    assert!(expected.iter().all(|part| line.contains(part)), "{line}");
    let empty = file(&assisted.folder, "none.22n", b"");
    let options = Assisted::options(&empty, "2190:540000");
    let line = refusal(&run(&assisted.samples, &options));
    assert!(line.contains("none.22n: "), "{line}");
}

#[test]
fn without_the_needed_ephemerides_the_last_line_says_what_each_satellite_lacks() {
    let Some(assisted) = Assisted::new() else {
        return;
    };
    let text = fs::read_to_string(&assisted.nav).unwrap();
    let end = text.find("END OF HEADER").unwrap();
    let (header, body) = text.split_at(end + text[end..].find('\n').unwrap() + 1);
    // A record of RINEX 2 has eight lines and begins with the satellite; three are kept.
    let lines: Vec<&str> = body.lines().collect();
    let kept = |record: &&[&str]| {
        ["31", "26", "32"]
            .iter()
            .any(|prn| record[0].starts_with(prn))
    };
    let records: Vec<&str> = lines.chunks(8).filter(kept).flatten().copied().collect();
    let reduced = format!("{header}{}\n", records.join("\n"));
    let few = file(&assisted.folder, "few.22n", reduced.as_bytes());
    let options = Assisted::options(&few, "2190:540000");
    let text = said(&run(&assisted.samples, &options));
    let last = text.lines().last().unwrap();
    for part in [
        "no fix",
        "9 satellites acquired, 0 ready of the 4",
        "G26 G31 G32 without the time of week",
        "G29 without frame synchronisation and an ephemeris",
    ] {
        assert!(last.contains(part), "{last}");
    }
}

#[test]
fn a_directory_that_cannot_be_written_to_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let samples = file(&folder, "a", &noise(100_000));
    let in_the_way = file(&folder, "regular", b"content");
    for out in [in_the_way.join("out"), in_the_way.clone()] {
        let line = refusal(&run_into(&out, &samples, REAL_8BIT));
        assert!(line.contains(out.to_str().unwrap()), "{line}");
    }
    assert_eq!(fs::read(&in_the_way).unwrap(), b"content");
}

#[test]
fn nobody_reading_the_output_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let samples = file(&folder, "a", &noise(100_000));
    let out = folder.path().join("out");
    let mut command = command(&samples, REAL_8BIT);
    command.arg("--out").arg(&out).stdout(Stdio::piped());
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    said(&child.wait_with_output().unwrap());
    assert!(out.join("summary.json").exists());
}

#[test]
fn output_that_cannot_be_written_is_an_error() {
    let Ok(full) = File::options().write(true).open("/dev/full") else {
        say("SKIPPED: no /dev/full");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut command = command(&file(&folder, "a", &noise(100_000)), REAL_8BIT);
    let line = refusal(&command.stdout(full).output().unwrap());
    assert!(line.contains("standard output: No space left"), "{line}");
}

/// A file system of 64 KiB, gone when dropped.
struct SmallDisk(TempDir);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"]);
        let output = mount.arg(folder.path()).output();
        let mounted = output.is_ok_and(|o| o.status.success());
        if !mounted {
            say("SKIPPED: no permission to mount a small disk");
        }
        mounted.then(|| Self(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

#[test]
fn a_full_disk_is_one_line_and_leaves_nothing_half_written() {
    let (Some(assisted), Some(disk)) = (Assisted::new(), SmallDisk::new()) else {
        return;
    };
    let out = disk.0.path().join("out");
    let mut options = Assisted::options(&assisted.nav, "2190:540000");
    options.extend(["--rate", "50", "--dump", "taps"]);
    let line = refusal(&run_into(&out, &assisted.samples, &options));
    assert!(line.contains("No space left"), "{line}");
    assert_eq!(fs::read_dir(&out).unwrap().count(), 0, "files are left");
}
