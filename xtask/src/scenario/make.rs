//! `cargo xtask scenario make`: a scenario as files.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use gnss_nav::{Geodetic, GpsTime};
use gnss_signal::Signal;
use gnss_signal::sample::{SampleDescription, SampleSource};
use receiver::sink::file::{OutputFile, create_directory};
use serde_json::json;
use toml::{Table, Value};

use super::built::Scenario;
use super::if_signal::Synthesiser;
use super::spec::{IonosphereSpec, TroposphereSpec};
use super::truth_files;

/// Name of the samples.
pub const SAMPLES_NAME: &str = "samples.bin";
/// What an assisted receiver is told is rounded to this.
const ROUGH_DEG: f64 = 0.1;
const ROUGH_HEIGHT_M: f64 = 1000.0;
const ROUGH_TIME_S: f64 = 10.0;

/// At which level a signal is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Intermediate-frequency samples
    If,
    /// Correlator sums, a thousand times faster
    Correlator,
}

impl Level {
    /// Name in summaries.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::If => "if",
            Self::Correlator => "correlator",
        }
    }
}

/// Writes samples with their SigMF sidecar, receiver.toml, truth.csv, satellites.csv, faults.csv and
/// navigation.rnx to `directory`; at the correlator level, which has no samples, all but the first
/// two.
///
/// The files appear when all are complete.
///
/// # Errors
/// Where one cannot be written; nothing is left then.
pub fn make(scenario: &Scenario, level: Level, directory: &Path) -> Result<()> {
    let stage = Stage::open(directory)?;
    truth_files::write(scenario, &stage.folder)?;
    let mut file = OutputFile::create(&stage.folder, "receiver.toml")?;
    write!(file, "{}", toml::to_string(&options(scenario))?)?;
    file.commit()?;
    if level == Level::If {
        sidecar(&scenario.reception.samples, &stage.folder)?;
        samples(scenario, &stage.folder)?;
    }
    stage.publish()
}

/// Options of `receiver run` for the samples of `scenario`, files relative to their folder.
#[must_use]
pub fn options(scenario: &Scenario) -> Table {
    let samples = scenario.reception.samples;
    let mut table = Table::new();
    let mut set = |key: &str, value: Value| table.insert(key.to_owned(), value);
    set("input", SAMPLES_NAME.into());
    set("format", samples.format.name().into());
    set("sample_rate", samples.sample_rate_hz.into());
    set("if", samples.intermediate_frequency_hz.into());
    set("swap_iq", samples.swap_iq.into());
    set("truth", "truth.csv".into());
    // Errors are computed from the files of a run.
    set("out", "received".into());
    if scenario.propagation.ionosphere == IonosphereSpec::None {
        set("ionosphere", "none".into());
    }
    if scenario.propagation.troposphere == TroposphereSpec::None {
        set("troposphere", "none".into());
    }
    if scenario.receiver.assisted {
        set("nav", "navigation.rnx".into());
        let place = rough_place(scenario);
        let degrees = [place.lat_rad, place.lon_rad].map(f64::to_degrees);
        let place = format!("{:.1},{:.1},{:.0}", degrees[0], degrees[1], place.height_m);
        set("position", place.into());
        let time = rough_time(scenario);
        set(
            "time",
            format!("{}:{:.0}", time.week(), time.tow_s()).into(),
        );
    }
    table.extend(scenario.receiver.options.clone());
    table
}

/// Where the receiver is, to a tenth of a degree.
#[must_use]
pub fn rough_place(scenario: &Scenario) -> Geodetic {
    let place = Geodetic::from_ecef(&scenario.truth.trajectory.at(0.0).position_ecef_m);
    let round = |value: f64, step: f64| (value / step).round() * step;
    Geodetic::from_degrees(
        round(place.lat_rad.to_degrees(), ROUGH_DEG),
        round(place.lon_rad.to_degrees(), ROUGH_DEG),
        round(place.height_m, ROUGH_HEIGHT_M),
    )
}

/// When it starts, to ten seconds.
#[must_use]
pub fn rough_time(scenario: &Scenario) -> GpsTime {
    let start = scenario.truth.start;
    let tow_s = (start.tow_s() / ROUGH_TIME_S).floor() * ROUGH_TIME_S;
    GpsTime::from_parts(start.week(), tow_s as i64, 0.0)
}

fn samples(scenario: &Scenario, folder: &Path) -> Result<()> {
    let mut source = Synthesiser::new(scenario.scene())?;
    let mut file = OutputFile::create(folder, SAMPLES_NAME)?;
    let mut bytes = vec![0; 1 << 20];
    loop {
        match source.read(&mut bytes)? {
            0 => return Ok(file.commit()?),
            read => file.write_bytes(&bytes[..read])?,
        }
    }
}

/// The SigMF sidecar; names of its own for what SigMF has none.
fn sidecar(samples: &SampleDescription, folder: &Path) -> Result<()> {
    let format = samples.format.name();
    // SigMF has names for whole bytes alone.
    let datatype = match samples.format.bits_per_sample() / samples.format.components() {
        bits if bits < 8 => "ru8",
        _ => format,
    };
    let carrier_hz = Signal::GpsL1Ca.spec().carrier_hz;
    let metadata = json!({
        "global": {
            "core:version": "1.0.0",
            "core:datatype": datatype,
            "core:sample_rate": samples.sample_rate_hz,
            "gnss:format": format,
            "gnss:if_hz": samples.intermediate_frequency_hz,
            "gnss:swap_iq": samples.swap_iq,
        },
        "captures": [{
            "core:sample_start": 0,
            "core:frequency": carrier_hz - samples.intermediate_frequency_hz,
        }],
        "annotations": [],
    });
    let mut file = OutputFile::create(folder, &format!("{SAMPLES_NAME}.sigmf-meta"))?;
    writeln!(file, "{metadata:#}")?;
    Ok(file.commit()?)
}

/// A folder beside the one asked for, whose files move there when all are complete.
struct Stage {
    folder: PathBuf,
    target: PathBuf,
}

impl Stage {
    fn open(target: &Path) -> Result<Self> {
        create_directory(target)?;
        let folder = target.join(".part");
        // Left by a run that was killed.
        let _ = fs::remove_dir_all(&folder);
        create_directory(&folder)?;
        Ok(Self {
            folder,
            target: target.to_owned(),
        })
    }

    fn publish(self) -> Result<()> {
        let entries: io::Result<Vec<_>> = fs::read_dir(&self.folder)?.collect();
        for entry in entries? {
            let to = self.target.join(entry.file_name());
            fs::rename(entry.path(), &to).with_context(|| to.display().to_string())?;
        }
        Ok(())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        // Nothing can be done about a failure here; the error that led here is reported.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::catalogue;

    fn scenario() -> Scenario {
        let file = catalogue::find("jiang2017-1").unwrap();
        let short = file.with(&["duration_s=0.02".to_owned()]).unwrap();
        Scenario::new(&short, None).unwrap()
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<_> = entries
            .map(|entry| name(entry).into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_scenario_is_a_set_of_files_that_the_receiver_takes() {
        let folder = tempfile::tempdir().unwrap();
        make(&scenario(), Level::If, folder.path()).unwrap();
        let expected = [
            "faults.csv",
            "navigation.rnx",
            "receiver.toml",
            "samples.bin",
            "samples.bin.sigmf-meta",
            "satellites.csv",
            "truth.csv",
        ];
        assert_eq!(names(folder.path()), expected);
        // Two bits a sample.
        let length = fs::metadata(folder.path().join(SAMPLES_NAME))
            .unwrap()
            .len();
        assert_eq!(length, (0.02 * 16.369e6 / 4.0f64).ceil() as u64);
        let options = receiver::config::RunOptions::read(&folder.path().join("receiver.toml"));
        let config = options.unwrap().check().unwrap();
        assert_eq!(config.recording.samples, scenario().reception.samples);
        assert!(config.position.is_some() && config.nav.is_some());
        let sidecar = receiver::sigmf::read(&folder.path().join(SAMPLES_NAME)).unwrap();
        assert_eq!(sidecar.format, Some(scenario().reception.samples.format));
        assert_eq!(sidecar.intermediate_frequency_hz, Some(3.996e6));
        let truth = receiver::truth::Truth::read(&folder.path().join("truth.csv")).unwrap();
        let start = truth.at(0.0).unwrap();
        assert!((start.velocity_ecef_mps.norm() - 1000.0).abs() < 1e-3);
        let faults = fs::read_to_string(folder.path().join("faults.csv")).unwrap();
        assert_eq!(faults.lines().last(), Some("blocked,G17,22,,0,"));
    }

    #[test]
    fn the_same_scenario_gives_the_same_bytes() {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        make(&scenario(), Level::If, a.path()).unwrap();
        make(&scenario(), Level::If, b.path()).unwrap();
        for name in names(a.path()) {
            let read = |folder: &Path| fs::read(folder.join(&name)).unwrap();
            assert!(read(a.path()) == read(b.path()), "{name}");
        }
    }

    #[test]
    fn what_fails_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let in_the_way = folder.path().join("file");
        fs::write(&in_the_way, "").unwrap();
        let error = make(&scenario(), Level::If, &in_the_way.join("x")).unwrap_err();
        assert!(error.to_string().contains("file/x"), "{error}");
        let target = folder.path().join("out");
        let stage = Stage::open(&target).unwrap();
        truth_files::write(&scenario(), &stage.folder).unwrap();
        drop(stage);
        assert!(names(&target).is_empty());
    }
}
