//! Experiments of the papers, repeated: figures, tables, and what of them holds.

pub mod chart;
pub mod jiang2017;
pub mod li2019;
mod outcome;
pub mod report;
pub mod wang2016;
pub mod zhang2014;
pub mod zhu2020;

use std::path::Path;

use anyhow::{Result, bail};
use clap::ValueEnum;

pub use outcome::{Check, Outcome};

use crate::scenario::make::Level;

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

/// How the signals of a reproduction are made, where there are signals.
#[derive(Debug, Clone, Copy, Default)]
pub struct Making {
    /// Level; each reproduction has its own default.
    pub level: Option<Level>,
    /// Seeds of each scenario; likewise.
    pub seeds: Option<usize>,
}

/// Repeats `paper` and writes its folder below `out`; tells whether every check holds.
///
/// # Errors
/// Where the paper cannot be repeated yet or a file cannot be written.
pub fn reproduce(paper: Paper, making: Making, out: &Path) -> Result<Outcome> {
    let outcome = match paper {
        Paper::Jiang2017 => jiang2017::reproduce(making)?,
        Paper::Li2019 => li2019::reproduce(making)?,
        Paper::Wang2016 => wang2016::reproduce()?,
        Paper::Zhu2020 => zhu2020::reproduce(making)?,
        Paper::Zhang2014 => zhang2014::reproduce()?,
        Paper::All => {
            bail!("reproduce all: not there yet; each paper by itself is");
        }
    };
    outcome.write(out)?;
    Ok(outcome)
}
