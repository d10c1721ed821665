//! Experiments of the papers, repeated: figures, tables, and what of them holds.

pub mod chart;
mod index;
pub mod jiang2017;
pub mod li2019;
mod outcome;
pub mod report;
pub mod wang2016;
pub mod zhang2014;
pub mod zhu2020;

use std::path::Path;

use anyhow::{Context, Result};
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

impl Paper {
    const EACH: [Self; 5] = [
        Self::Jiang2017,
        Self::Li2019,
        Self::Wang2016,
        Self::Zhang2014,
        Self::Zhu2020,
    ];
}

/// Repeats `paper`, or all of them one after the other, and writes a folder each below `out`; `told` is given each
/// outcome as it comes. All of them leave an index, `out/report.md`.
///
/// # Errors
/// Where a paper cannot be repeated or a file cannot be written.
pub fn reproduce(
    paper: Paper,
    making: Making,
    out: &Path,
    mut told: impl FnMut(&Outcome) -> Result<()>,
) -> Result<Vec<Outcome>> {
    let papers = match &paper {
        Paper::All => &Paper::EACH[..],
        one => std::slice::from_ref(one),
    };
    let mut outcomes = Vec::new();
    for paper in papers {
        let outcome = match paper {
            Paper::Jiang2017 => jiang2017::reproduce(making)?,
            Paper::Li2019 => li2019::reproduce(making)?,
            Paper::Wang2016 => wang2016::reproduce()?,
            Paper::Zhu2020 => zhu2020::reproduce(making)?,
            Paper::Zhang2014 => zhang2014::reproduce()?,
            Paper::All => continue,
        };
        outcome.write(out)?;
        told(&outcome)?;
        outcomes.push(outcome);
    }
    if paper == Paper::All {
        let path = out.join("report.md");
        let text = index::page(&outcomes);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(outcomes)
}
