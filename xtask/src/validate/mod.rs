//! Experiments that take minutes: kept commands, each a table and a verdict.

pub mod consistency;
pub mod front_ends;
pub mod generalisation;
pub mod levels;
pub mod monitors;
pub mod sensitivity;
pub mod shape;
pub mod starts;
pub mod threshold;
pub mod urban;

/// A verdict in words.
pub(crate) const fn verdict(holds: bool) -> &'static str {
    if holds { "holds" } else { "does not hold" }
}
