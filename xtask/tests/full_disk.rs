//! `cargo xtask scenario make` on a disk that fills up: one clear line, and no half-written set.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A file system of 256 KiB, gone when dropped.
struct SmallDisk(TempDir);

impl SmallDisk {
    #[allow(clippy::print_stderr, reason = "a skip must not be silent")]
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"]);
        let output = mount.arg(folder.path()).output();
        let mounted = output.is_ok_and(|o| o.status.success());
        if !mounted {
            eprintln!("SKIPPED: no permission to mount a small disk");
        }
        mounted.then(|| Self(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

fn make(out: &Path, duration_s: f64) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
    command.args(["scenario", "make", "static-open-sky", "--set"]);
    command.arg(format!("duration_s={duration_s}"));
    command.arg("--out").arg(out).output().unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    names.collect()
}

fn assert_refused(output: &Output) {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(output.stdout.is_empty());
    assert!(
        text.lines().count() == 1 && text.starts_with("error: "),
        "{text}"
    );
    assert!(text.contains("No space left"), "{text}");
}

#[test]
fn a_full_disk_is_one_line_and_leaves_no_half_written_set() {
    let Some(disk) = SmallDisk::new() else { return };
    let out = disk.0.path().join("out");
    // 5.2 MB of samples.
    assert_refused(&make(&out, 1.0));
    assert!(names(&out).is_empty(), "{:?}", names(&out));
}

#[test]
fn a_full_disk_leaves_an_earlier_set_whole() {
    let Some(disk) = SmallDisk::new() else { return };
    let out = disk.0.path().join("out");
    // 104 kB of samples.
    assert!(make(&out, 0.02).status.success());
    let content = |name: &String| (name.clone(), fs::read(out.join(name)).unwrap());
    let before: Vec<_> = names(&out).iter().map(content).collect();
    assert_eq!(before.len(), 7);
    assert_refused(&make(&out, 1.0));
    let after: Vec<_> = names(&out).iter().map(content).collect();
    assert!(before == after, "{:?}", names(&out));
}
