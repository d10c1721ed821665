//! Experiments on the generator of signals that take minutes: kept commands, each a table and a verdict.

pub mod front_ends;
pub mod levels;
