//! Errors of this crate.

use std::path::PathBuf;

/// What went wrong, where, and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReceiverError {
    /// The signal layer failed.
    #[error(transparent)]
    Signal(#[from] gnss_signal::SignalError),
    /// The navigation layer failed.
    #[error(transparent)]
    Nav(#[from] gnss_nav::NavError),
    /// A monitor was given what it cannot judge.
    #[error(transparent)]
    Monitor(#[from] fault_ml::MonitorError),
    /// A trained monitor is none.
    #[error(transparent)]
    Model(#[from] fault_ml::learned::LearnedError),
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An option or configuration value is impossible.
    #[error("{what}")]
    Option {
        /// What was given, where, and what was expected.
        what: String,
    },
    /// The content of a file is not what it should be.
    #[error("{}: {what}", path.display())]
    Content {
        /// Which file.
        path: PathBuf,
        /// What was found and what was expected.
        what: String,
    },
}
