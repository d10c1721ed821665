//! What a repeated experiment leaves behind: figures, checks, a report and pictures.

use std::fmt;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;
use serde_json::{Value, json};

/// One statement and whether it holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What is claimed, with the bound.
    pub name: String,
    /// The paper's number, where it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paper: Option<f64>,
    /// Ours.
    pub ours: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Whether the claim holds of ours.
    pub holds: bool,
}

impl Check {
    /// `ours` within `tolerance` of the number of the paper.
    #[must_use]
    pub fn near(name: String, paper: f64, ours: f64, tolerance: f64, unit: &'static str) -> Self {
        Self {
            name: format!("{name} within {tolerance} {unit} of the paper"),
            paper: Some(paper),
            ours,
            unit,
            holds: (ours - paper).abs() <= tolerance,
        }
    }

    /// `ours` at most `limit`.
    #[must_use]
    pub fn at_most(name: String, ours: f64, limit: f64, unit: &'static str) -> Self {
        Self {
            name: format!("{name} at most {limit:.4} {unit}")
                .trim_end()
                .to_owned(),
            paper: None,
            ours,
            unit,
            holds: ours <= limit,
        }
    }

    /// `ours` at least `limit`.
    #[must_use]
    pub fn at_least(name: String, ours: f64, limit: f64, unit: &'static str) -> Self {
        Self {
            name: format!("{name} at least {limit:.4} {unit}")
                .trim_end()
                .to_owned(),
            paper: None,
            ours,
            unit,
            holds: ours >= limit,
        }
    }
}

/// A repeated experiment.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Key of the paper.
    pub paper: &'static str,
    /// Every number of the tables and plots.
    pub figures: Value,
    /// What is claimed of them.
    pub checks: Vec<Check>,
    /// The report, Markdown.
    pub report: String,
    /// Pictures: file name and SVG.
    pub pictures: Vec<(String, String)>,
    /// Tables too long for the report: file name and CSV.
    pub tables: Vec<(String, String)>,
}

impl Outcome {
    /// Whether every check holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.checks.iter().all(|check| check.holds)
    }

    /// Writes the folder of the paper below `out`.
    pub(super) fn write(&self, out: &Path) -> Result<()> {
        let folder = out.join(self.paper);
        let shown = folder.display();
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {shown}"))?;
        let summary = json!({
            "paper": self.paper,
            "figures": self.figures,
            "checks": self.checks,
        });
        let summary = serde_json::to_string_pretty(&summary)? + "\n";
        let texts = [("summary.json", &summary), ("report.md", &self.report)];
        let others = self.pictures.iter().chain(&self.tables);
        let others = others.map(|(name, text)| (name.as_str(), text));
        for (name, text) in texts.into_iter().chain(others) {
            let path = folder.join(name);
            fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for check in &self.checks {
            let verdict = if check.holds { "holds" } else { "FAILS" };
            write!(
                f,
                "{verdict}  {}: {:.3} {}",
                check.name, check.ours, check.unit
            )?;
            match check.paper {
                Some(paper) => writeln!(f, " (paper {paper})")?,
                None => writeln!(f)?,
            }
        }
        let held = self.checks.iter().filter(|check| check.holds).count();
        write!(
            f,
            "{}: {held} of {} checks hold",
            self.paper,
            self.checks.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_says_what_it_claims() {
        let near = Check::near("median alarm".to_owned(), 518.0, 520.0, 2.0, "s");
        assert_eq!(near.name, "median alarm within 2 s of the paper");
        assert!(near.holds);
        assert!(!Check::at_most("false alarms".to_owned(), 0.06, 0.05, "").holds);
        assert!(Check::at_least("named".to_owned(), 0.99, 0.99, "").holds);
    }

    #[test]
    fn a_folder_holds_summary_report_and_pictures() {
        let folder = std::env::temp_dir().join(format!("outcome-{}", std::process::id()));
        let outcome = Outcome {
            paper: "nobody1999",
            figures: json!({"answer": 42}),
            checks: vec![Check::at_most("delay".to_owned(), 1.0, 2.0, "s")],
            report: "# Report\n".to_owned(),
            pictures: vec![("figure1.svg".to_owned(), "<svg/>".to_owned())],
            tables: vec![("errors.csv".to_owned(), "time_s\n".to_owned())],
        };
        outcome.write(&folder).unwrap();
        let below = folder.join("nobody1999");
        let summary = fs::read_to_string(below.join("summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        assert_eq!(summary["paper"], "nobody1999");
        assert_eq!(summary["figures"]["answer"], 42);
        assert_eq!(summary["checks"][0]["holds"], true);
        assert!(summary["checks"][0].get("paper").is_none());
        assert_eq!(
            fs::read_to_string(below.join("figure1.svg")).unwrap(),
            "<svg/>"
        );
        assert_eq!(
            fs::read_to_string(below.join("errors.csv")).unwrap(),
            "time_s\n"
        );
        fs::remove_dir_all(&folder).unwrap();
    }
}
