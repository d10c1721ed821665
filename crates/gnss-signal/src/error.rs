//! Errors of this crate.

/// What went wrong, with the value and what was allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// No such ranging code.
    #[error("no ranging code with PRN {prn}: expected {first} to {last}")]
    UnknownPrn {
        /// The number asked for.
        prn: u8,
        /// First valid number.
        first: u8,
        /// Last valid number.
        last: u8,
    },
    /// A parameter outside its range.
    #[error("{name} is {value}: expected {expected}")]
    Parameter {
        /// The parameter, with its unit.
        name: &'static str,
        /// Its value.
        value: String,
        /// What was allowed.
        expected: &'static str,
    },
    /// A sample format name that is not known.
    #[error("unknown sample format '{name}': expected one of {expected}")]
    UnknownFormat {
        /// The name given.
        name: String,
        /// The names that exist.
        expected: String,
    },
    /// Samples asked for that are no longer, or not yet, held.
    #[error("samples {start} to {end} are not held: expected within {oldest} to {newest}")]
    NotHeld {
        /// First tick asked for.
        start: u64,
        /// End tick asked for (exclusive).
        end: u64,
        /// Oldest tick held.
        oldest: u64,
        /// End of the held ticks (exclusive).
        newest: u64,
    },
    /// A sample that is not a number.
    #[error("sample {tick} is not finite")]
    NotFinite {
        /// Its tick.
        tick: u64,
    },
    /// The stream of samples could not be read.
    #[error("cannot read samples: {0}")]
    Read(#[from] std::io::Error),
}
