//! Experiments on the generator of signals that take minutes: kept commands, each a table and a verdict.

pub mod front_ends;
pub mod levels;
pub mod threshold;

/// A verdict in words.
pub(crate) const fn verdict(holds: bool) -> &'static str {
    if holds { "holds" } else { "does not hold" }
}
