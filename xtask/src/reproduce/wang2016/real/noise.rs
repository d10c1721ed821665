//! The noise of pseudoranges in units of what is stated of them, from a day of another receiver.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use fault_ml::CorrelatedNoise;
use gnss_nav::least_squares;
use nalgebra::Vector3;

use super::record::{Observed, folder, is_above, sights};

/// Files of the recording below the folder of the data sets: 24 h at 30 s.
const OBSERVATIONS: &str = "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz";
const NAVIGATION: &str = "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_MN.rnx.gz";
/// Seconds between its epochs.
const INTERVAL_S: f64 = 30.0;
/// Epochs of a stretch, 50 minutes: a bias is what lasts longer.
const STRETCH: usize = 100;

/// Noise of a satellite whose stated deviation is 1 m.
///
/// The position is the mean of the day's solutions, the receiver's clock of an epoch the median of
/// its residuals; every residual is taken in units of the deviation that `receiver solve` states of its
/// satellite at that time. `None` where the recording is absent.
///
/// # Errors
/// Where it is damaged or cannot be solved.
pub fn of_another_day() -> Result<Option<CorrelatedNoise>> {
    let (obs, nav) = (folder().join(OBSERVATIONS), folder().join(NAVIGATION));
    if !(obs.exists() && nav.exists()) {
        return Ok(None);
    }
    let observed = Observed::read(&obs, &nav)?;
    let here = mean_position(&observed)?;
    let stretches = stretches(&observed, &here);
    let rows: Vec<&[f64]> = stretches.iter().map(Vec::as_slice).collect();
    Ok(Some(CorrelatedNoise::fit(&rows, INTERVAL_S)?))
}

fn mean_position(observed: &Observed) -> Result<Vector3<f64>> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    let mut start = Vector3::zeros();
    for epoch in &observed.formed {
        if let Ok(solution) = least_squares::solve(epoch, &observed.model, &start) {
            start = solution.position_ecef_m;
            sum += start;
            count += 1.0;
        }
    }
    (count > 0.0)
        .then(|| sum / count)
        .context("no epoch could be solved")
}

/// Normalised residuals of every satellite in stretches without a gap.
fn stretches(observed: &Observed, here: &Vector3<f64>) -> Vec<Vec<f64>> {
    let mut growing: BTreeMap<u32, (usize, Vec<f64>)> = BTreeMap::new();
    let mut whole = Vec::new();
    for (k, epoch) in observed.formed.iter().enumerate() {
        let above = epoch.iter().filter(|m| is_above(m, &observed.model, here));
        for sight in sights(above, &observed.model, here) {
            let (last, row) = growing.entry(sight.id).or_default();
            if *last + 1 != k {
                row.clear();
            }
            *last = k;
            row.push(sight.residual_m / sight.sigma_m);
            if row.len() == STRETCH {
                whole.push(std::mem::take(row));
            }
        }
    }
    whole
}
