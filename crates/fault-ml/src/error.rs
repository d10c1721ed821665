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
    /// A satellite that occurs more than once in an epoch.
    #[error("satellite {id} occurs twice in one epoch: expected once")]
    Repeated {
        /// The satellite, by the caller's number.
        id: u32,
    },
    /// Settings that exclude one another.
    #[error("{setting} cannot be combined with {other}: {reason}")]
    Combination {
        /// One setting.
        setting: &'static str,
        /// The other.
        other: &'static str,
        /// Why not.
        reason: &'static str,
    },
}

/// Refuses `value` unless it is within `low` to `high`, both allowed.
pub(crate) fn within(
    name: &'static str,
    value: f64,
    (low, high): (f64, f64),
    expected: &'static str,
) -> Result<(), MonitorError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(MonitorError::Value {
        name,
        value,
        expected,
    })
}
