//! What can be wrong with data and models.

/// What went wrong with a data set, a model file or a training.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnedError {
    /// A number that cannot be worked with.
    #[error(transparent)]
    Value(#[from] crate::MonitorError),
    /// A row of a data set.
    #[error("line {line}, {column}: found {found:?}, expected {expected}")]
    Row {
        /// Line, from 1.
        line: usize,
        /// Column.
        column: String,
        /// What stands there.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// A file that is no model, damaged, newer than this program, or not of one piece.
    #[error("model {part}: {what}")]
    Model {
        /// Which part: the card or the weights.
        part: &'static str,
        /// What is wrong, and what was expected.
        what: String,
    },
    /// A training that cannot be done with this data.
    #[error("training: {what}")]
    Training {
        /// What is missing or wrong.
        what: String,
    },
    /// Reading or writing.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

impl LearnedError {
    /// A fault of a part of a model.
    pub(super) fn model(part: &'static str, what: impl Into<String>) -> Self {
        let what = what.into();
        Self::Model { part, what }
    }
}

#[cfg(feature = "train")]
impl LearnedError {
    /// What a training needs and has not.
    pub(super) fn training(what: impl ToString) -> Self {
        let what = what.to_string();
        Self::Training { what }
    }
}

#[cfg(feature = "train")]
impl From<candle_core::Error> for LearnedError {
    fn from(error: candle_core::Error) -> Self {
        Self::training(error)
    }
}
