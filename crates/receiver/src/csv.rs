//! Reads CSV files with a header, line by line.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::ReceiverError;
use crate::lines::Lines;

/// Rows of a CSV file with a header, reduced to the columns asked for.
pub(crate) struct Table {
    path: PathBuf,
    lines: Lines,
    columns: Vec<usize>,
    names: Rc<[String]>,
}

/// One row, reduced to the columns asked for.
pub(crate) struct Row {
    path: PathBuf,
    line: u64,
    cells: Vec<String>,
    names: Rc<[String]>,
}

impl Table {
    /// Opens `path` and finds the columns `names` in its header.
    pub(crate) fn open(path: &Path, names: &[&str]) -> Result<Self, ReceiverError> {
        let file_error = |source| ReceiverError::File {
            path: path.to_owned(),
            source,
        };
        let mut lines = Lines::open(path).map_err(file_error)?;
        lines.advance().map_err(file_error)?;
        let header = String::from_utf8_lossy(lines.current()).into_owned();
        let titles: Vec<&str> = header.trim().split(',').map(str::trim).collect();
        let column = |name: &&str| {
            let found = titles.iter().position(|title| title == name);
            let expected = names.join(",");
            found.ok_or_else(|| content(path, format!("no column '{name}': expected {expected}")))
        };
        Ok(Self {
            path: path.to_owned(),
            lines,
            columns: names.iter().map(column).collect::<Result<_, _>>()?,
            names: names.iter().map(|name| (*name).to_owned()).collect(),
        })
    }
}

impl Iterator for Table {
    type Item = Result<Row, ReceiverError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.lines.advance() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(source) => {
                    let path = self.path.clone();
                    return Some(Err(ReceiverError::File { path, source }));
                }
            }
            let line = String::from_utf8_lossy(self.lines.current());
            if line.trim().is_empty() {
                continue;
            }
            let cells: Vec<&str> = line.trim().split(',').collect();
            let cell = |column: &usize| cells.get(*column).unwrap_or(&"").trim().to_owned();
            return Some(Ok(Row {
                path: self.path.clone(),
                line: self.lines.number(),
                cells: self.columns.iter().map(cell).collect(),
                names: Rc::clone(&self.names),
            }));
        }
    }
}

impl Row {
    pub(crate) fn text(&self, column: usize) -> &str {
        &self.cells[column]
    }

    pub(crate) fn number(&self, column: usize) -> Result<f64, ReceiverError> {
        match self.cells[column].parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.error(&format!(
                "{} is '{}': expected a number",
                self.names[column], self.cells[column]
            ))),
        }
    }

    pub(crate) fn error(&self, what: &str) -> ReceiverError {
        content(&self.path, format!("line {}: {what}", self.line))
    }
}

/// An error of the content of `path`.
pub(crate) fn content(path: &Path, what: String) -> ReceiverError {
    ReceiverError::Content {
        path: path.to_owned(),
        what,
    }
}
