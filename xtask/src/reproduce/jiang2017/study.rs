//! The runs: both scenarios, every seed, every receiver.

use anyhow::Result;
use gnss_nav::SatelliteId;
use nalgebra::Vector3;
use receiver::record::{Event, EventKind, Lock, LoopMembership};

use super::learned::WatchedRuns;
use super::receivers::Variant;
use crate::judged::{self, Judged};
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;

/// First seed of a scenario's runs.
pub const FIRST_SEED: u64 = 50;
/// Errors count from so long after the navigation filter took over, s: it starts from least squares, whose
/// error fades by then.
pub const SETTLING_S: f64 = 5.0;
/// End of the runs, s.
pub const END_S: f64 = 40.0;

/// One scenario of the paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blockage {
    /// Its number in the paper, and that of the figure.
    pub number: u32,
    /// Figure that shows it.
    pub figure: u32,
    /// Name in the catalogue.
    pub name: &'static str,
    /// The satellite that is blocked.
    pub prn: u8,
    /// From here to the end, s.
    pub begin_s: f64,
    /// Largest error with detection in the paper, m.
    pub paper_m: f64,
}

/// Both.
pub const BLOCKAGES: [Blockage; 2] = [
    Blockage {
        number: 1,
        figure: 6,
        name: "jiang2017-1",
        prn: 17,
        begin_s: 22.0,
        paper_m: 10.0,
    },
    Blockage {
        number: 2,
        figure: 7,
        name: "jiang2017-2",
        prn: 11,
        begin_s: 20.0,
        paper_m: 5.0,
    },
];

/// One run of one receiver.
#[derive(Debug, Clone)]
pub struct Run {
    /// Time, s, and position error, ECEF, m.
    pub errors: Vec<(f64, Vector3<f64>)>,
    /// Largest three-dimensional error between settling and the blockage, m.
    pub before_m: f64,
    /// Largest after it, m.
    pub after_m: f64,
    /// When the navigation filter took over, s.
    pub switched_s: Option<f64>,
    /// First exclusion of the blocked satellite after the blockage, s.
    pub excluded_s: Option<f64>,
    /// When the channel of the blocked satellite saw that its signal was gone, s.
    pub lost_s: Option<f64>,
    /// Exclusions before the blockage, when all satellites are healthy.
    pub excluded_before: usize,
    /// Exclusions of the other satellites after it.
    pub healthy_after: usize,
    /// Part of the epochs from settling on with a solution.
    pub availability: f64,
}

impl Run {
    /// What the receiver did with the signal of `blockage`.
    #[must_use]
    pub fn new(judged: &Judged, blockage: &Blockage) -> Self {
        let largest = |begin_s, end_s| {
            let errors = judged.between(begin_s, end_s);
            errors.map(|e| e.position_enu_m.norm()).fold(0.0, f64::max)
        };
        let switched_s = judged.events.iter().find(is_switch).map(|e| e.time_s);
        let settled_s = switched_s.map_or(f64::INFINITY, |s| s + SETTLING_S);
        let blocked = Some(SatelliteId::gps(blockage.prn));
        let (before, after): (Vec<_>, Vec<_>) = judged
            .events
            .iter()
            .filter(|e| switched_s.is_some_and(|s| e.time_s >= s))
            .partition(|e| e.time_s < blockage.begin_s);
        let first = |holds: &dyn Fn(&Event) -> bool| {
            let mut found = after.iter().filter(|e| e.satellite == blocked && holds(e));
            found.next().map(|e| e.time_s)
        };
        let healthy = |e: &&&Event| is_exclusion(e) && e.satellite != blocked;
        Self {
            errors: judged
                .epochs
                .iter()
                .map(|e| (e.pvt.time_s, e.position_ecef_m()))
                .collect(),
            before_m: largest(settled_s, blockage.begin_s),
            after_m: largest(settled_s.max(blockage.begin_s), f64::INFINITY),
            switched_s,
            excluded_s: first(&is_exclusion),
            lost_s: first(&is_loss),
            excluded_before: before.iter().filter(|e| is_exclusion(e)).count(),
            healthy_after: after.iter().filter(healthy).count(),
            availability: judged.between(settled_s, END_S + 0.05).count() as f64
                / ((END_S - settled_s) * 10.0).floor().max(1.0),
        }
    }

    /// Largest three-dimensional error from settling to the end, m.
    #[must_use]
    pub const fn largest_m(&self) -> f64 {
        self.before_m.max(self.after_m)
    }
}

fn is_switch(event: &&Event) -> bool {
    let to = LoopMembership::Vector;
    event.kind == EventKind::ModeSwitched { to }
}

fn is_loss(event: &Event) -> bool {
    matches!(event.kind, EventKind::LockChanged { to: Lock::Lost, .. })
}

fn is_exclusion(event: &Event) -> bool {
    matches!(event.kind, EventKind::Excluded { .. })
}

/// All runs of one scenario: by seed, in the order of [`Variant::ALL`].
#[derive(Debug, Clone)]
pub struct Case {
    /// The scenario.
    pub blockage: Blockage,
    /// Runs.
    pub seeds: Vec<[Run; 4]>,
}

impl Case {
    /// The runs of one receiver, by seed.
    pub fn runs(&self, variant: Variant) -> impl Iterator<Item = &Run> + Clone {
        self.seeds.iter().map(move |runs| &runs[variant as usize])
    }
}

/// Everything.
#[derive(Debug, Clone)]
pub struct Study {
    /// How the signal was made.
    pub level: Level,
    /// Both scenarios.
    pub cases: Vec<Case>,
    /// The receivers watched by trained monitors; none where they were not asked for.
    pub learned: Vec<WatchedRuns>,
}

impl Study {
    /// Runs every receiver over both scenarios with `seeds` seeds each.
    ///
    /// # Errors
    /// Where a signal cannot be made or a receiver fails.
    pub fn run(level: Level, seeds: usize) -> Result<Self> {
        let count = BLOCKAGES.len() * seeds;
        let all = judged::in_parallel(count, |number| {
            let seed = FIRST_SEED + (number % seeds) as u64;
            runs(&BLOCKAGES[number / seeds], level, seed)
        })?;
        let cases = BLOCKAGES.iter().zip(all.chunks(seeds));
        let case = |(blockage, runs): (&Blockage, &[[Run; 4]])| Case {
            blockage: *blockage,
            seeds: runs.to_vec(),
        };
        Ok(Self {
            level,
            cases: cases.map(case).collect(),
            learned: Vec::new(),
        })
    }
}

/// One signal, received by every receiver.
fn runs(blockage: &Blockage, level: Level, seed: u64) -> Result<[Run; 4]> {
    let scenario = Scenario::new(&catalogue::find(blockage.name)?, Some(seed))?;
    let settings = Variant::ALL.map(|variant| variant.settings(&scenario));
    let judged = judged::receive_by_each(&scenario, level, &settings)?;
    let runs: Vec<_> = judged.iter().map(|j| Run::new(j, blockage)).collect();
    runs.try_into()
        .map_err(|_| anyhow::anyhow!("a receiver left no result"))
}
