//! Many seeded runs of one detector: clean for 500 s, then every step in turn.

use std::ops::Range;
use std::thread;

use anyhow::{Context, Result};

use super::detector::{Decision, Detector, Kind, Observation};
use super::setting::{
    EPOCHS, FIRST_JUDGED, Geometry, ONSET, Residuals, STEPS_M, Truth, residuals, sights,
};

/// Threads the seeds are shared between; results do not depend on it.
const THREADS: u64 = 2;
/// Epochs after the onset from which on the error of an undetected fault is taken.
const SETTLED: usize = 30;

/// One detector in one truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Campaign {
    /// What is true.
    pub truth: Truth,
    /// Standard deviation the detector assumes, m.
    pub sigma_m: f64,
    /// The detector.
    pub kind: Kind,
}

/// What one seed gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Largest decision before the onset, by statistic.
    pub clean_largest: Vec<f64>,
    /// Mean square of the three-dimensional error before the onset, m^2.
    pub clean_square_m2: f64,
    /// Mean spread of the main cloud before the onset, m.
    pub spread_m: f64,
    /// By step.
    pub steps: Vec<StepRun>,
}

/// What a step did.
#[derive(Debug, Clone, PartialEq)]
pub struct StepRun {
    /// Decisions of every epoch from the onset on, by statistic.
    pub decisions: Vec<Vec<Decision>>,
    /// Mean effective particles over the whole run.
    pub effective: f64,
    /// Mean three-dimensional error 30 s and more after a step nobody has reacted to, m.
    pub error_m: f64,
}

impl Campaign {
    /// Runs all `seeds`, in their order.
    ///
    /// # Errors
    /// Where a detector cannot be made or fed.
    pub fn runs(&self, geometry: &Geometry, seeds: Range<u64>) -> Result<Vec<Run>> {
        let share = |first: u64| -> Result<Vec<(u64, Run)>> {
            let own = seeds.clone().filter(|seed| seed % THREADS == first);
            own.map(|seed| Ok((seed, self.run(geometry, seed)?)))
                .collect()
        };
        let shares = thread::scope(|scope| {
            let share = &share;
            let threads = (0..THREADS).map(|first| scope.spawn(move || share(first)));
            let threads: Vec<_> = threads.collect();
            threads
                .into_iter()
                .map(|t| t.join().ok().context("a simulation thread ended early")?)
                .collect::<Result<Vec<_>>>()
        })?;
        let mut runs: Vec<_> = shares.into_iter().flatten().collect();
        runs.sort_by_key(|(seed, _)| *seed);
        Ok(runs.into_iter().map(|(_, run)| run).collect())
    }

    fn run(&self, geometry: &Geometry, seed: u64) -> Result<Run> {
        let residuals = residuals(&self.truth, seed);
        let mut detector = self.kind.start(seed)?;
        let clean = self.observe(&mut detector, geometry, &residuals, 0.0, 0..ONSET)?;
        let judged = &clean[FIRST_JUDGED..];
        let statistics = judged[0].decisions.len();
        let largest = |s: usize| judged.iter().map(|o| o.decisions[s].0).fold(0.0, f64::max);
        let mean = |value: &dyn Fn(&Observation) -> f64| {
            judged.iter().map(value).sum::<f64>() / judged.len() as f64
        };
        let effective: f64 = clean.iter().map(|o| o.effective).sum();
        let steps = STEPS_M.iter().map(|step_m| {
            let mut detector = detector.clone();
            let epochs = ONSET..EPOCHS;
            let after = self.observe(&mut detector, geometry, &residuals, *step_m, epochs)?;
            Ok(StepRun::new(&after, effective, statistics))
        });
        Ok(Run {
            clean_largest: (0..statistics).map(largest).collect(),
            clean_square_m2: mean(&|o| error_m(o).powi(2)),
            spread_m: mean(&|o| o.spread_m),
            steps: steps.collect::<Result<_>>()?,
        })
    }

    /// Feeds the epochs to `detector`.
    ///
    /// # Errors
    /// Where the sights cannot be used.
    pub fn observe(
        &self,
        detector: &mut Detector,
        geometry: &Geometry,
        residuals: &Residuals,
        step_m: f64,
        epochs: Range<usize>,
    ) -> Result<Vec<Observation>> {
        epochs
            .map(|k| detector.epoch(k, &sights(k, geometry, residuals, self.sigma_m, step_m)))
            .collect()
    }
}

impl StepRun {
    fn new(after: &[Observation], effective_before: f64, statistics: usize) -> Self {
        let of = |s: usize| after.iter().map(|o| o.decisions[s]).collect();
        let effective: f64 = after.iter().map(|o| o.effective).sum();
        let settled = &after[SETTLED..];
        Self {
            decisions: (0..statistics).map(of).collect(),
            effective: (effective_before + effective) / EPOCHS as f64,
            error_m: settled.iter().map(error_m).sum::<f64>() / settled.len() as f64,
        }
    }
}

/// Three-dimensional error: the truth is the reference point.
fn error_m(observation: &Observation) -> f64 {
    let [east, north, up, _] = observation.estimate_m;
    (east * east + north * north + up * up).sqrt()
}
