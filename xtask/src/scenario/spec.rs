//! A scenario file: sections as written, with what is wrong named by file and line.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use gnss_nav::atmosphere::Klobuchar;
use serde::Deserialize;
use toml::Spanned;

use super::clock::ClockSpec;
use super::constellation::{ConstellationSpec, TimeSpec};
use super::fault::FaultSpec;
use super::front_end::FrontEndSpec;
use super::power::PowerSpec;
use super::trajectory::TrajectorySpec;

/// A scenario file; `docs/scenarios.md` describes every field.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioSpec {
    /// What it is, in a line.
    pub description: String,
    /// Reading of the receiver's clock at the first sample.
    pub start: Spanned<TimeSpec>,
    /// Samples made, s.
    pub duration_s: Spanned<f64>,
    /// Seed of noise, clock and bit errors.
    #[serde(default)]
    pub seed: u64,
    /// Rows of truth.csv a second.
    #[serde(default = "default_truth_rate_hz")]
    pub truth_rate_hz: Spanned<f64>,
    /// The satellites.
    pub constellation: Option<Spanned<ConstellationSpec>>,
    /// How the receiver moves.
    pub trajectory: Spanned<TrajectorySpec>,
    /// The receiver's clock.
    pub clock: Option<Spanned<ClockSpec>>,
    /// Delays of the atmosphere.
    #[serde(default)]
    pub propagation: PropagationSpec,
    /// How strong the satellites are.
    pub cn0: Option<Spanned<PowerSpec>>,
    /// From the antenna to samples.
    pub front_end: Spanned<FrontEndSpec>,
    /// What goes wrong.
    #[serde(default)]
    pub fault: Vec<Spanned<FaultSpec>>,
    /// What the receiver is told.
    pub receiver: Option<Spanned<ReceiverSpec>>,
}

fn default_truth_rate_hz() -> Spanned<f64> {
    Spanned::new(0..0, 100.0)
}

/// Delays of the atmosphere in a scenario file.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PropagationSpec {
    /// Ionosphere.
    #[serde(default)]
    pub ionosphere: IonosphereSpec,
    /// Troposphere.
    #[serde(default)]
    pub troposphere: TroposphereSpec,
    /// Klobuchar parameters in place of those of the constellation's file or the built-in ones.
    pub klobuchar: Option<KlobucharSpec>,
}

/// Ionosphere of a scenario file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IonosphereSpec {
    /// The broadcast model.
    #[default]
    Klobuchar,
    /// No delay.
    None,
}

/// Troposphere of a scenario file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TroposphereSpec {
    /// Saastamoinen with a standard atmosphere; it ends at 20 km of height.
    #[default]
    Saastamoinen,
    /// No delay.
    None,
}

/// Klobuchar parameters of a scenario file, units as broadcast.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KlobucharSpec {
    alpha: [f64; 4],
    beta: [f64; 4],
}

impl From<KlobucharSpec> for Klobuchar {
    fn from(spec: KlobucharSpec) -> Self {
        Self {
            alpha: spec.alpha,
            beta: spec.beta,
        }
    }
}

/// What the receiver is told in its configuration file.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceiverSpec {
    /// Whether it gets ephemerides, a rough position and a rough time.
    #[serde(default)]
    pub assisted: bool,
    /// Further options of `receiver run`, by their names in its configuration file.
    #[serde(default)]
    pub options: toml::Table,
}

/// A scenario file that was read: its text stays at hand to name lines.
#[derive(Debug, Clone)]
pub struct ScenarioFile {
    /// Name of the scenario.
    pub name: String,
    /// Folder that files in it are relative to.
    pub folder: PathBuf,
    /// What it says.
    pub spec: ScenarioSpec,
    /// How it is called in errors.
    source: String,
    text: String,
}

impl ScenarioFile {
    /// Reads the scenario file at `path`; the scenario is called after it.
    ///
    /// # Errors
    /// Names the file and, where its content is wrong, the line.
    pub fn read(path: &Path) -> Result<Self> {
        let source = path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(|| source.clone())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&name, &source, folder, text)
    }

    /// Reads `text` as the scenario `name`, called `source` in errors.
    ///
    /// # Errors
    /// Names `source` and the line.
    pub fn parse(name: &str, source: &str, folder: &Path, text: String) -> Result<Self> {
        let spec = toml::from_str(&text).map_err(|error: toml::de::Error| {
            let start = error.span().map_or(0, |span| span.start);
            let message = error.message().replace('\n', " ");
            anyhow!("{source}: line {}: {message}", line_of(&text, start))
        })?;
        Ok(Self {
            name: name.to_owned(),
            folder: folder.to_owned(),
            spec,
            source: source.to_owned(),
            text,
        })
    }

    /// The same file with `KEY=VALUE` in place of what it says; keys of sections are joined by
    /// points, values are TOML or plain text.
    ///
    /// # Errors
    /// Where a key leads nowhere, or the file is wrong with the value.
    pub fn with(&self, overrides: &[String]) -> Result<Self> {
        let mut table: toml::Table = toml::from_str(&self.text)?;
        for entry in overrides {
            let (key, value) = entry
                .split_once('=')
                .with_context(|| format!("{entry:?}: expected KEY=VALUE"))?;
            set(&mut table, key, parsed(value)).with_context(|| format!("key {key}"))?;
        }
        let source = format!("{} with {}", self.source, overrides.join(" "));
        Self::parse(&self.name, &source, &self.folder, toml::to_string(&table)?)
    }

    /// What `make` makes of a section, with the file and the section's line where it fails.
    ///
    /// # Errors
    /// That of `make`, located.
    pub fn locate<S, T>(
        &self,
        section: &Spanned<S>,
        make: impl FnOnce(&S) -> Result<T>,
    ) -> Result<T> {
        make(section.get_ref()).map_err(|error| self.error(section, format!("{error:#}")))
    }

    /// An error in a section.
    pub fn error<S>(&self, section: &Spanned<S>, what: impl Display) -> anyhow::Error {
        let line = line_of(&self.text, section.span().start);
        anyhow!("{}: line {line}: {what}", self.source)
    }
}

fn parsed(value: &str) -> toml::Value {
    let document: Result<toml::Table, _> = toml::from_str(&format!("value = {value}"));
    let found = document.ok().and_then(|mut table| table.remove("value"));
    found.unwrap_or_else(|| value.into())
}

fn set(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<()> {
    let Some((section, rest)) = key.split_once('.') else {
        table.insert(key.to_owned(), value);
        return Ok(());
    };
    let inner = table
        .entry(section)
        .or_insert_with(|| toml::Table::new().into());
    let inner = inner.as_table_mut().context("is no section")?;
    set(inner, rest, value)
}

fn line_of(text: &str, byte: usize) -> usize {
    let before = text.as_bytes().iter().take(byte);
    before.filter(|b| **b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "description = 'x'
start = { week = 2350, tow_s = 392400 }
duration_s = 10

[trajectory]
kind = 'static'
at = { lat_deg = 47, lon_deg = 8, height_m = 400 }

[front_end]
format = 'ci8'
sample_rate_hz = 4e6
";

    fn parse(text: &str) -> Result<ScenarioFile> {
        ScenarioFile::parse("x", "x.toml", Path::new(""), text.to_owned())
    }

    #[test]
    fn the_least_file_has_documented_defaults() {
        let file = parse(LEAST).unwrap();
        assert_eq!(*file.spec.truth_rate_hz.get_ref(), 100.0);
        assert_eq!(file.spec.propagation.ionosphere, IonosphereSpec::Klobuchar);
        assert!(file.spec.fault.is_empty());
    }

    #[test]
    fn what_is_unknown_or_wrong_is_named_by_line() {
        let message = |text: String| parse(&text).unwrap_err().to_string();
        let unknown = message(LEAST.replace("sample_rate_hz", "rate"));
        assert!(
            unknown.starts_with("x.toml: line 11: unknown field `rate`"),
            "{unknown}"
        );
        let wrong = message(LEAST.replace("duration_s = 10", "duration_s = 'long'"));
        assert!(wrong.starts_with("x.toml: line 3: "), "{wrong}");
        let fault = format!("{LEAST}\n[[fault]]\nkind = 'blocked'\nsat = 'G07'\nbegins = 3\n");
        let fault = message(fault);
        assert!(fault.starts_with("x.toml: line 1"), "{fault}");
        assert!(fault.contains("begins"), "{fault}");
        assert!(!fault.contains('\n'));
    }

    #[test]
    fn values_can_be_replaced() {
        let file = parse(LEAST).unwrap();
        let overrides = [
            "front_end.sample_rate_hz=5e6",
            "duration_s=3",
            "front_end.format=ri8",
        ];
        let changed = file.with(&overrides.map(str::to_owned)).unwrap();
        let front_end = changed.spec.front_end.get_ref().reception().unwrap();
        assert_eq!(front_end.samples.sample_rate_hz, 5e6);
        assert_eq!(*changed.spec.duration_s.get_ref(), 3.0);
        assert!(file.with(&["duration_s.x=3".to_owned()]).is_err());
        assert!(file.with(&["front_end.x=3".to_owned()]).is_err());
    }

    #[test]
    fn errors_of_sections_carry_their_line() {
        let file = parse(LEAST).unwrap();
        let located = file.locate(&file.spec.front_end, |_| -> Result<()> {
            anyhow::bail!("no good")
        });
        assert_eq!(located.unwrap_err().to_string(), "x.toml: line 9: no good");
    }
}
