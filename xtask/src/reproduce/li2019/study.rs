//! The runs: every receiver on every seed's signal.

use anyhow::{Context, Result};
use nalgebra::Vector3;
use receiver::record::Status;

use super::receivers::{self, Receiver, place};
use super::theory::Theory;
use crate::judged::{self, Judged, JudgedEpoch, rms};
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;

/// The scenario.
pub const SCENARIO: &str = "li2019-vehicle";
/// First seed of the runs.
const FIRST_SEED: u64 = 80;
/// Epochs a second.
const RATE_HZ: f64 = 10.0;
/// Epochs before the overpass by which errors are compared, s: settled, road signs included.
pub const OPEN_S: (f64, f64) = (5.0, 30.0);
/// The overpass, s.
pub const OVERPASS_S: (f64, f64) = (30.0, 32.0);
/// Half an epoch: those on a limit belong to what it begins.
const HALF_EPOCH_S: f64 = 0.05;
/// A solution this close to the truth is good again after the overpass, m and m/s.
const GOOD_M: f64 = 5.0;
const GOOD_MPS: f64 = 1.0;

/// Everything.
#[derive(Debug, Clone)]
pub struct Study {
    /// How the signal was made.
    pub level: Level,
    /// What theory says of it.
    pub theory: Theory,
    /// The receivers.
    pub receivers: Vec<Receiver>,
    /// What they did, by seed, then receiver.
    pub runs: Vec<Vec<Judged>>,
    /// Length of a run, s.
    pub duration_s: f64,
}

impl Study {
    /// Runs every receiver over the scenario with `seeds` seeds.
    ///
    /// # Errors
    /// Where a signal cannot be made or a receiver fails.
    pub fn run(level: Level, seeds: usize) -> Result<Self> {
        Self::of(level, seeds, |_| true)
    }

    /// The same with the receivers that are `wanted` by their place; the others have no epochs.
    pub(super) fn of(
        level: Level,
        seeds: usize,
        wanted: impl Fn(usize) -> bool + Sync,
    ) -> Result<Self> {
        let first = scenario(FIRST_SEED)?;
        let product = &receivers::all(&Theory::default())[place::PRODUCT];
        let judged = judged::receive(&first, Level::Correlator, &product.settings(&first))?;
        let theory = Theory::new(&first, &judged)?;
        let receivers = receivers::all(&theory);
        let runs = judged::in_parallel(seeds, |number| {
            runs(FIRST_SEED + number as u64, level, &receivers, &wanted)
        })?;
        Ok(Self {
            level,
            theory,
            receivers,
            runs,
            duration_s: first.duration_s,
        })
    }

    /// What a receiver did on every seed's signal.
    pub fn of_receiver(&self, receiver: usize) -> impl Iterator<Item = &Judged> + Clone {
        self.runs.iter().filter_map(move |seed| seed.get(receiver))
    }

    /// Reliable solutions of a receiver before the overpass, seeds joined.
    pub fn open(&self, receiver: usize) -> impl Iterator<Item = &JudgedEpoch> + Clone {
        self.of_receiver(receiver)
            .flat_map(|j| reliable(j, OPEN_S.0, OPEN_S.1))
    }

    /// Velocity error before the overpass, rms along x, y and z (ECEF), m/s.
    #[must_use]
    pub fn velocity_mps(&self, receiver: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| rms(self.open(receiver).map(|e| e.velocity_ecef_mps()[axis])))
    }

    /// Velocity error before the overpass in three dimensions, rms, m/s.
    #[must_use]
    pub fn speed_mps(&self, receiver: usize) -> f64 {
        rms(self.open(receiver).map(|e| e.velocity_enu_mps.norm()))
    }

    /// Position error before the overpass in three dimensions, rms, m.
    #[must_use]
    pub fn position_m(&self, receiver: usize) -> f64 {
        rms(self.open(receiver).map(|e| e.position_enu_m.norm()))
    }

    /// Change of the position error from epoch to epoch before the overpass, rms in three dimensions, m:
    /// zero for an error that stands, twice the error for one that is white.
    #[must_use]
    pub fn roughness_m(&self, receiver: usize) -> f64 {
        let each = self
            .of_receiver(receiver)
            .flat_map(|j| changes(&reliable(j, OPEN_S.0, OPEN_S.1).collect::<Vec<_>>()));
        rms(each.map(|change| change.norm()))
    }

    /// Largest error of a solution called reliable under the overpass, in three dimensions, m.
    #[must_use]
    pub fn overpass_m(&self, receiver: usize) -> f64 {
        let errors = self.of_receiver(receiver).flat_map(under_overpass);
        errors.map(|e| e.position_enu_m.norm()).fold(0.0, f64::max)
    }

    /// Solutions called reliable under the overpass, part of those due.
    #[must_use]
    pub fn overpass_available(&self, receiver: usize) -> f64 {
        let due = (OVERPASS_S.1 - OVERPASS_S.0) * RATE_HZ * self.runs.len() as f64;
        let count: usize = self
            .of_receiver(receiver)
            .map(|j| under_overpass(j).count())
            .sum();
        count as f64 / due
    }

    /// Part of all epochs due from the first fix on with a reliable solution, of the worst run.
    #[must_use]
    pub fn availability(&self, receiver: usize) -> f64 {
        self.of_receiver(receiver)
            .map(|j| j.availability(self.duration_s, RATE_HZ))
            .fold(1.0, f64::min)
    }

    /// How long after the overpass a receiver's solutions are good for good, s, latest of the runs; those
    /// that never are count to the end.
    #[must_use]
    pub fn recovered_s(&self, receiver: usize) -> f64 {
        let each = self.of_receiver(receiver).map(|judged| {
            let after = judged.between(OVERPASS_S.1 + HALF_EPOCH_S, f64::INFINITY);
            let last_bad = after.filter(|e| !is_good(e)).map(|e| e.pvt.time_s).last();
            last_bad.map_or(0.0, |s| s + 1.0 / RATE_HZ - OVERPASS_S.1)
        });
        each.fold(0.0, f64::max)
    }

    /// Largest distance between the positions of two receivers at the same instant, m.
    #[must_use]
    pub fn apart_m(&self, one: usize, other: usize) -> f64 {
        let pairs = self.of_receiver(one).zip(self.of_receiver(other));
        let each = pairs.flat_map(|(a, b)| a.epochs.iter().zip(&b.epochs));
        let apart = each.map(|(a, b)| (a.pvt.position_ecef_m - b.pvt.position_ecef_m).norm());
        apart.fold(0.0, f64::max)
    }
}

fn is_good(epoch: &JudgedEpoch) -> bool {
    epoch.pvt.status != Status::Unreliable
        && epoch.position_enu_m.norm() < GOOD_M
        && epoch.velocity_enu_mps.norm() < GOOD_MPS
}

/// Solutions from `begin_s` on, up to `end_s`, that the receiver does not call unreliable.
fn reliable(
    judged: &Judged,
    begin_s: f64,
    end_s: f64,
) -> impl Iterator<Item = &JudgedEpoch> + Clone {
    judged
        .between(begin_s + HALF_EPOCH_S, end_s + HALF_EPOCH_S)
        .filter(|e| e.pvt.status != Status::Unreliable)
}

/// Every one of these epochs has samples of the overpass.
fn under_overpass(judged: &Judged) -> impl Iterator<Item = &JudgedEpoch> + Clone {
    reliable(judged, OVERPASS_S.0, OVERPASS_S.1)
}

/// Change of the position error, ECEF, m, between epochs that follow each other.
fn changes(epochs: &[&JudgedEpoch]) -> Vec<Vector3<f64>> {
    let pairs = epochs.iter().zip(epochs.iter().skip(1));
    let following = pairs.filter(|(a, b)| b.pvt.time_s - a.pvt.time_s < 1.5 / RATE_HZ);
    following
        .map(|(a, b)| b.position_ecef_m() - a.position_ecef_m())
        .collect()
}

fn scenario(seed: u64) -> Result<Scenario> {
    Scenario::new(&catalogue::find(SCENARIO)?, Some(seed))
}

/// One signal, received by every receiver that is wanted.
fn runs(
    seed: u64,
    level: Level,
    receivers: &[Receiver],
    wanted: &(impl Fn(usize) -> bool + Sync),
) -> Result<Vec<Judged>> {
    let scenario = scenario(seed)?;
    let places = (0..receivers.len()).filter(|k| wanted(*k));
    let settings: Vec<_> = places
        .clone()
        .map(|k| receivers[k].settings(&scenario))
        .collect();
    let judged = judged::receive_by_each(&scenario, level, &settings)
        .with_context(|| format!("seed {seed}"))?;
    let mut all = vec![Judged::default(); receivers.len()];
    for (place, judged) in places.zip(judged) {
        // Channels by the thousand are not looked at again.
        all[place] = Judged {
            channels: Vec::new(),
            ..judged
        };
    }
    Ok(all)
}
