//! The shape of the noise of pseudoranges: how much of it is bias, how long the rest lasts, how heavy its tails are.
//!
//! From two receivers elsewhere, never from the recording that detectors are judged on. How large the noise is differs
//! between receivers by more than its shape, so that its size is taken from what the record judged states of itself.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use fault_ml::CorrelatedNoise;
use gnss_nav::integrity::{self, IntegritySettings};
use gnss_nav::least_squares::Consistency;
use nalgebra::Vector3;

use super::record::{Observed, folder, is_above, sights};

/// A recording whose noise is fitted.
struct Source {
    /// What people read.
    name: &'static str,
    /// Files below the folder of the data sets.
    observations: &'static str,
    navigation: &'static str,
    /// Seconds between epochs.
    interval_s: f64,
    /// Epochs of a stretch: a bias is what lasts longer.
    stretch: usize,
}

const SOURCES: [Source; 2] = [
    Source {
        name: "geodetic, a day at 30 s",
        observations: "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
        navigation: "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        interval_s: 30.0,
        stretch: 100,
    },
    Source {
        name: "u-blox on simulated signals, 15 min at 1 s",
        observations: "rinex/11_f9p_spirent_15min_1hz/f9p.obs.gz",
        navigation: "rinex/11_f9p_spirent_15min_1hz/f9p.nav",
        interval_s: 1.0,
        stretch: 300,
    },
];

/// Residuals beyond so many stated deviations are faults, not noise; they end a stretch.
const OUTLIER: f64 = 10.0;

/// The noise of one receiver.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Of which.
    pub name: &'static str,
    /// Of a satellite whose stated deviation is 1 m.
    pub found: CorrelatedNoise,
}

impl Shape {
    /// The same with all of the deviation that is stated.
    #[must_use]
    pub fn as_stated(&self) -> CorrelatedNoise {
        self.found.scaled(1.0 / self.found.sigma_m())
    }
}

/// The noise of two receivers; `None` where a recording is absent.
///
/// Each one's position is the mean of its solutions, its clock of an epoch the median of the
/// residuals; every residual is taken in units of the deviation that `receiver solve` states of its
/// satellite at that time.
///
/// # Errors
/// Where a recording is damaged or cannot be solved.
pub fn shapes() -> Result<Option<Vec<Shape>>> {
    let shapes: Result<Vec<Option<Shape>>> = SOURCES.iter().map(Source::shape).collect();
    Ok(shapes?.into_iter().collect())
}

impl Source {
    fn shape(&self) -> Result<Option<Shape>> {
        let [obs, nav] = [self.observations, self.navigation].map(|file| folder().join(file));
        if !(obs.exists() && nav.exists()) {
            return Ok(None);
        }
        let observed = Observed::read(&obs, &nav)?;
        let here = mean_position(&observed)?;
        let stretches = self.stretches(&observed, &here);
        let rows: Vec<&[f64]> = stretches.iter().map(Vec::as_slice).collect();
        Ok(Some(Shape {
            name: self.name,
            found: CorrelatedNoise::fit(&rows, self.interval_s)?,
        }))
    }

    /// Normalised residuals of every satellite in stretches without a gap.
    fn stretches(&self, observed: &Observed, here: &Vector3<f64>) -> Vec<Vec<f64>> {
        let mut growing: BTreeMap<u32, (usize, Vec<f64>)> = BTreeMap::new();
        let mut whole = Vec::new();
        for (k, epoch) in observed.formed.iter().enumerate() {
            let above = epoch.iter().filter(|m| is_above(m, &observed.model, here));
            for sight in sights(above, &observed.model, here) {
                let (last, row) = growing.entry(sight.id).or_default();
                let normalised = sight.residual_m / sight.sigma_m;
                if normalised.abs() > OUTLIER {
                    row.clear();
                    continue;
                }
                if *last + 1 != k {
                    row.clear();
                }
                *last = k;
                row.push(normalised);
                if row.len() == self.stretch {
                    whole.push(std::mem::take(row));
                }
            }
        }
        whole
    }
}

fn mean_position(observed: &Observed) -> Result<Vector3<f64>> {
    let settings = IntegritySettings::default();
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    let mut start = Vector3::zeros();
    for epoch in &observed.formed {
        let solved = integrity::solve(epoch, &observed.model, &start, &settings);
        let Ok(solution) = solved.map(|assured| assured.solution) else {
            continue;
        };
        if solution.consistency == Consistency::Passed {
            start = solution.position_ecef_m;
            sum += start;
            count += 1.0;
        }
    }
    (count > 0.0)
        .then(|| sum / count)
        .context("no epoch could be solved")
}
