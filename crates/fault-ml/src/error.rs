//! Errors of this crate.

/// What went wrong, with the value and what was allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MonitorError {
    /// A number no monitor can work with.
    #[error("{name} is {value}: expected {expected}")]
    Value {
        /// Which number, with its unit.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What was allowed.
        expected: &'static str,
    },
}
