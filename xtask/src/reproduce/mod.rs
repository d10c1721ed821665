//! Experiments of the papers, repeated: figures, tables, and what of them holds.

mod outcome;
pub mod wang2016;

use std::path::Path;

use anyhow::{Result, bail};
use clap::ValueEnum;

pub use outcome::{Check, Outcome};

/// A paper by its key in docs/references.md.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Paper {
    /// Vector tracking with a support-vector machine.
    Jiang2017,
    /// Vector tracking with a long short-term memory.
    Zhu2020,
    /// EWMA chart on the shape of the correlation.
    Zhang2014,
    /// Particle filters moved by a swarm.
    Wang2016,
    /// Vector tracking with sequential updates.
    Li2019,
    /// All of them.
    All,
}

/// Repeats `paper` and writes its folder below `out`; tells whether every check holds.
///
/// # Errors
/// Where the paper cannot be repeated yet or a file cannot be written.
pub fn reproduce(paper: Paper, out: &Path) -> Result<Outcome> {
    let outcome = match paper {
        Paper::Wang2016 => wang2016::reproduce()?,
        Paper::Jiang2017 | Paper::Zhu2020 | Paper::Zhang2014 | Paper::Li2019 | Paper::All => {
            let name = paper.to_possible_value();
            let name = name.as_ref().map_or("this paper", |value| value.get_name());
            bail!("reproduce {name}: not there yet, only wang2016 is");
        }
    };
    outcome.write(out)?;
    Ok(outcome)
}
