//! A row for each run, in a file that grows and of which a row that is only half there is taken back.

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use receiver::summary::Summary;

const NAME: &str = "runs.csv";

const COLUMNS: [&str; 16] = [
    "case",
    "seed",
    "signal_s",
    "first_fix_s",
    "mode_switch_s",
    "fixes",
    "availability",
    "horizontal_rms_m",
    "horizontal_p95_m",
    "horizontal_max_m",
    "vertical_rms_m",
    "position_3d_max_m",
    "alarms",
    "first_alarm_s",
    "first_alarm_sat",
    "first_alarm_monitor",
];

/// What a run came to, a field a column; empty where it does not apply.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row(Vec<String>);

impl Row {
    pub(super) fn new(case: &str, seed: u64, summary: &Summary) -> Self {
        let number = |value: Option<f64>, places: usize| {
            value.map_or_else(String::new, |value| format!("{value:.places$}"))
        };
        let error = summary.error.as_ref();
        let first = summary.faults.first();
        let text = |value: Option<&String>| value.cloned().unwrap_or_default();
        Self(vec![
            case.to_owned(),
            seed.to_string(),
            number(Some(summary.signal_s), 3),
            number(summary.first_fix_s, 3),
            number(summary.mode_switch_s, 3),
            summary.fixes.to_string(),
            number(error.map(|e| e.availability), 5),
            number(error.map(|e| e.horizontal_rms_m), 4),
            number(error.map(|e| e.horizontal_p95_m), 4),
            number(error.map(|e| e.horizontal_max_m), 4),
            number(error.map(|e| e.vertical_rms_m), 4),
            number(error.map(|e| e.position_3d_max_m), 4),
            summary.faults.len().to_string(),
            number(first.map(|fault| fault.alarm_s), 3),
            text(first.map(|fault| &fault.sat)),
            text(first.map(|fault| &fault.monitor)),
        ])
    }

    fn field(&self, column: &str) -> &str {
        let at = COLUMNS.iter().position(|name| *name == column);
        at.and_then(|at| self.0.get(at)).map_or("", String::as_str)
    }

    pub(super) fn case(&self) -> &str {
        self.field("case")
    }

    /// A number, where the column holds one.
    pub(super) fn number(&self, column: &str) -> Option<f64> {
        self.field(column).parse().ok()
    }
}

/// The rows of a campaign so far.
#[derive(Debug)]
pub(super) struct Rows {
    path: PathBuf,
    file: File,
    rows: Vec<Row>,
}

impl Rows {
    /// Opens the rows in `folder`, whole ones, which are those of the first of `runs`: case and seed.
    ///
    /// # Errors
    /// Where the file cannot be read and written, or holds other rows.
    pub(super) fn open(folder: &Path, runs: &[(&str, u64)]) -> Result<Self> {
        let path = folder.join(NAME);
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(false);
        let mut file = options
            .open(&path)
            .with_context(|| format!("cannot open {}", path.display()))?;
        let mut text = String::new();
        file.read_to_string(&mut text)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut lines = text[..whole].lines();
        let header = COLUMNS.join(",");
        if let Some(found) = lines.next() {
            ensure!(
                found == header,
                "{}: line 1: expected the columns of a campaign",
                path.display()
            );
        }
        let mut rows = Vec::new();
        for (number, line) in lines.enumerate() {
            let row = Row(line.split(',').map(str::to_owned).collect());
            let is_due = runs.get(number).is_some_and(|(case, seed)| {
                row.0.len() == COLUMNS.len()
                    && row.case() == *case
                    && row.field("seed") == seed.to_string()
            });
            ensure!(
                is_due,
                "{}: line {}: expected the next run of the campaign",
                path.display(),
                number + 2
            );
            rows.push(row);
        }
        let mut opened = Self { path, file, rows };
        opened.cut(whole as u64)?;
        if whole == 0 {
            opened.write(&(header + "\n"))?;
        }
        Ok(opened)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn all(&self) -> &[Row] {
        &self.rows
    }

    /// Writes rows behind the others.
    pub(super) fn append(&mut self, rows: Vec<Row>) -> Result<()> {
        let lines = rows.iter().map(|row| row.0.join(",") + "\n");
        self.write(&lines.collect::<String>())?;
        self.rows.extend(rows);
        Ok(())
    }

    /// Goes on after `length` bytes.
    fn cut(&mut self, length: u64) -> Result<()> {
        let cut = self.file.set_len(length);
        cut.and_then(|()| self.file.seek(SeekFrom::End(0)))
            .with_context(|| format!("cannot write {}", self.path.display()))?;
        Ok(())
    }

    fn write(&mut self, text: &str) -> Result<()> {
        let written = self.file.write_all(text.as_bytes());
        written
            .and_then(|()| self.file.sync_data())
            .with_context(|| format!("cannot write {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn foreign_rows_are_refused_and_left_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        let header = COLUMNS.join(",");
        let other = format!("{header}\nb,1{}\n", ",".repeat(14));
        for (text, expected) in [("time_s,x_m\n", "line 1"), (other.as_str(), "line 2")] {
            fs::write(&path, text).unwrap();
            let refused = Rows::open(folder.path(), &[("a", 1)]).unwrap_err();
            assert!(refused.to_string().contains(expected), "{refused}");
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
    }
}
