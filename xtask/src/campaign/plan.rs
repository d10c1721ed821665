//! What is run: cases, seeds and options, from a TOML file.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;

/// A campaign.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Seeds of every case.
    pub seeds: Seeds,
    /// Level at which signals are made. Default: correlator sums.
    #[serde(default = "correlator")]
    pub level: Level,
    /// Options of `receiver run` for all cases.
    #[serde(default)]
    options: Vec<String>,
    /// Whether the files of every run are kept. Default: its row alone.
    #[serde(default)]
    pub keep: bool,
    /// What is varied.
    #[serde(rename = "case")]
    pub cases: Vec<Case>,
    /// The file itself.
    #[serde(skip)]
    pub text: String,
    #[serde(skip)]
    folder: PathBuf,
}

/// Successive seeds.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seeds {
    /// The first.
    pub first: u64,
    /// How many.
    pub count: u64,
}

/// One scenario, as changed, and how it is received.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Name in the rows: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// Name of an embedded scenario, or a TOML file beside the campaign's.
    pub scenario: String,
    /// Values in place of the scenario's, as `KEY=VALUE`.
    #[serde(default)]
    set: Vec<String>,
    /// Options of `receiver run`, after those for all cases.
    #[serde(default)]
    options: Vec<String>,
}

const fn correlator() -> Level {
    Level::Correlator
}

impl Plan {
    /// Reads a campaign and builds every case once, so that what is wrong is found out now.
    ///
    /// # Errors
    /// Names the file, and the line or the case.
    pub fn read(path: &Path) -> Result<Self> {
        let text =
            fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let parsed: Result<Self, toml::de::Error> = toml::from_str(&text);
        let mut plan = parsed.map_err(|error| {
            let before = error.span().map_or("", |span| &text[..span.start]);
            let line = 1 + before.matches('\n').count();
            anyhow::anyhow!("{}: line {line}: {}", path.display(), error.message())
        })?;
        plan.folder = path.parent().unwrap_or(Path::new("")).to_owned();
        plan.text = text;
        plan.check().with_context(|| path.display().to_string())?;
        Ok(plan)
    }

    fn check(&self) -> Result<()> {
        ensure!(self.seeds.count > 0, "seeds.count is 0: expected 1 or more");
        let last = self.seeds.first.checked_add(self.seeds.count);
        ensure!(last.is_some(), "seeds: expected numbers below 2^64");
        ensure!(!self.cases.is_empty(), "no case: expected [[case]]");
        for (number, case) in self.cases.iter().enumerate() {
            let fits = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
            let is_name =
                !case.name.is_empty() && case.name.chars().all(fits) && !case.name.starts_with('.');
            ensure!(
                is_name,
                "case {:?}: expected a name of letters, digits, -, _ and .",
                case.name
            );
            let twice = self.cases[..number]
                .iter()
                .any(|other| other.name == case.name);
            ensure!(
                !twice,
                "case {:?} is there twice: expected another name",
                case.name
            );
            self.scenario(case, self.seeds.first)
                .with_context(|| format!("case {:?}", case.name))?;
        }
        Ok(())
    }

    /// Case and seed of every run, in the order of the rows.
    #[must_use]
    pub fn runs(&self) -> Vec<(&Case, u64)> {
        let seeds = || (0..self.seeds.count).map(|k| self.seeds.first + k);
        let of_case = |case| seeds().map(move |seed| (case, seed));
        self.cases.iter().flat_map(of_case).collect()
    }

    /// The scenario of a run.
    ///
    /// # Errors
    /// Where it is wrong.
    pub fn scenario(&self, case: &Case, seed: u64) -> Result<Scenario> {
        let beside = self.folder.join(&case.scenario);
        let is_file = Path::new(&case.scenario).extension().is_some();
        let name = if is_file {
            beside.to_string_lossy().into_owned()
        } else {
            case.scenario.clone()
        };
        let file = catalogue::find(&name)?.with(&case.set)?;
        Scenario::new(&file, Some(seed))
    }

    /// Options of the receiver.
    #[must_use]
    pub fn options(&self, case: &Case) -> Vec<OsString> {
        self.options
            .iter()
            .chain(&case.options)
            .map(OsString::from)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        let case = "[[case]]\nname = \"a\"\nscenario = \"static-open-sky\"\n";
        let seeds = "seeds = { first = 1, count = 2 }\n";
        for (text, expected) in [
            (case.to_owned(), "line 1: missing field `seeds`"),
            (
                format!("{seeds}sedes = 1\n{case}"),
                "line 2: unknown field `sedes`",
            ),
            (
                format!("seeds = {{ first = 1, count = 0 }}\n{case}"),
                "seeds.count is 0",
            ),
            (format!("{seeds}case = []\n"), "no case"),
            (format!("{seeds}{case}{case}"), "case \"a\" is there twice"),
            (
                format!("{seeds}{}", case.replace("\"a\"", "\"../a\"")),
                "case \"../a\": expected a name",
            ),
            (
                format!("{seeds}{}", case.replace("static", "statik")),
                "case \"a\"",
            ),
            (
                format!("{seeds}{case}set = [\"duration_s=-1.0\"]\n"),
                "case \"a\"",
            ),
        ] {
            fs::write(&path, &text).unwrap();
            let message = format!("{:#}", Plan::read(&path).unwrap_err());
            assert!(message.contains(expected), "{message}, not {expected}");
            assert!(
                message.contains("plan.toml") && !message.contains('\n'),
                "{message}"
            );
        }
    }
}
