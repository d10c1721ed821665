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

/// Seconds from the epoch `last_s` to `time_s`, none where there was none before.
///
/// # Errors
/// Where time has not grown.
pub(crate) fn check_later(time_s: f64, last_s: Option<f64>) -> Result<Option<f64>, MonitorError> {
    let elapsed_s = last_s.map(|last_s| time_s - last_s);
    if time_s.is_finite() && elapsed_s.is_none_or(|elapsed_s| elapsed_s > 0.0) {
        return Ok(elapsed_s);
    }
    Err(MonitorError::Value {
        name: "time (s)",
        value: time_s,
        expected: "a number above that of the epoch before",
    })
}
