//! The simulated experiment: geometry, truth and noise of one run.

use anyhow::{Context, Result};
use fault_ml::Sight;
use gnss_nav::{Geodetic, GpsTime, LineOfSight};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scenario::constellation;

/// Epoch of the step.
pub const ONSET: usize = 500;
/// Epochs simulated, one a second.
pub const EPOCHS: usize = 560;
/// First epoch in which an alarm counts as false: the filters have come to rest.
pub const FIRST_JUDGED: usize = 20;
/// Steps of the paper, m.
pub const STEPS_M: [f64; 3] = [15.0, 20.0, 30.0];
/// Place of the satellite that steps.
pub const STEPPED: usize = 0;
/// Satellites.
pub const SATELLITES: usize = 9;

/// The paper's satellites, that which steps first: in the embedded constellation they are the nine
/// in view of the place below on the date below, GDOP 1.73. The paper states no geometry.
const PRNS: [u8; SATELLITES] = [1, 12, 17, 14, 15, 22, 26, 28, 24];
/// Of the first epoch: week and s.
const START: (i32, f64) = (2260, 593_137.7);
/// Shenyang, where the paper comes from: degrees, degrees, m.
const PLACE: (f64, f64, f64) = (41.93, 123.41, 60.0);
/// The true clock walks by this much, m per square root of a second. The paper states none.
const CLOCK_WALK_M: f64 = 0.1;

/// Shape of the true noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TrueNoise {
    /// Every tenth value from a normal distribution three times as wide.
    Mixture,
    /// 70 % of the variance Gauss-Markov of 60 s, 30 % white mixture.
    Correlated,
    /// 90 % of the variance stays with the satellite for the whole run, 9 % is Gauss-Markov of
    /// 60 s, 1 % white mixture: what a good receiver in the open sees of orbits and atmosphere.
    Biased,
}

/// What is true of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Shape of the noise.
    pub noise: TrueNoise,
    /// Its standard deviation, m.
    pub sigma_m: f64,
}

/// Design rows of every epoch.
pub type Geometry = Vec<[[f64; 4]; SATELLITES]>;

/// Lines of sight from the place, in east, north, up.
///
/// # Errors
/// Where the embedded constellation lacks a satellite.
pub fn geometry() -> Result<Geometry> {
    let start = GpsTime::new(START.0, START.1);
    let ephemerides = constellation::nominal(start)?;
    let place = Geodetic::from_degrees(PLACE.0, PLACE.1, PLACE.2);
    let (receiver, enu) = (place.to_ecef(), place.enu_from_ecef());
    let row = |prn: u8, time: GpsTime| -> Result<[f64; 4]> {
        let ephemeris = ephemerides.iter().find(|e| e.satellite.prn == prn);
        let state = ephemeris.context("no such satellite")?.state_at(time)?;
        let unit = enu * LineOfSight::new(&state, &receiver).unit_ecef;
        Ok([-unit.x, -unit.y, -unit.z, 1.0])
    };
    let epoch = |k: usize| {
        let time = start + k as f64;
        let mut rows = [[0.0; 4]; SATELLITES];
        for (slot, prn) in rows.iter_mut().zip(PRNS) {
            *slot = row(prn, time)?;
        }
        Ok(rows)
    };
    (0..EPOCHS).map(epoch).collect()
}

/// Residuals (m) of all epochs about the true place and a clock of zero, without the step.
pub type Residuals = Vec<[f64; SATELLITES]>;

/// One run of `truth`: the clock's walk and the noise of every satellite.
#[must_use]
pub fn residuals(truth: &Truth, seed: u64) -> Residuals {
    let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
    let mut mixture = {
        let mut random = ChaCha8Rng::seed_from_u64(1_000_000 + seed);
        move |normal: f64| {
            // 0.9 + 0.1 x 9 = 1.8: the mixture has the stated deviation.
            let wide = random.random::<f64>() < 0.1;
            normal * if wide { 3.0 } else { 1.0 } / 1.8f64.sqrt()
        }
    };
    let decay = (-1.0 / 60.0f64).exp();
    let mut slow = [0.0; SATELLITES].map(|_: f64| normal());
    let biases = biases(seed);
    let mut clock_m = 0.0;
    let mut epoch = || {
        clock_m += CLOCK_WALK_M * normal();
        let mut residuals = [0.0; SATELLITES];
        for ((residual, slow), bias) in residuals.iter_mut().zip(&mut slow).zip(biases) {
            let white = mixture(normal());
            *slow = decay * *slow + (1.0 - decay * decay).sqrt() * normal();
            let unit = match truth.noise {
                TrueNoise::Mixture => white,
                TrueNoise::Correlated => 0.7f64.sqrt() * *slow + 0.3f64.sqrt() * white,
                TrueNoise::Biased => 0.9f64.sqrt() * bias + 0.3 * *slow + 0.1 * white,
            };
            *residual = clock_m + truth.sigma_m * unit;
        }
        residuals
    };
    (0..EPOCHS).map(|_| epoch()).collect()
}

/// What stays with each satellite over a run, of unit variance.
fn biases(seed: u64) -> [f64; SATELLITES] {
    let mut random = ChaCha8Rng::seed_from_u64(2_000_000 + seed);
    std::array::from_fn(|_| StandardNormal.sample(&mut random))
}

/// The sights of epoch `k`, of the standard deviation the detectors assume; a step of `step_m`
/// sits on one satellite from the onset on.
#[must_use]
pub fn sights(
    k: usize,
    geometry: &Geometry,
    residuals: &Residuals,
    sigma_m: f64,
    step_m: f64,
) -> Vec<Sight> {
    let rows = geometry[k].iter().zip(residuals[k]).enumerate();
    rows.map(|(s, (design, residual_m))| {
        let stepped = k >= ONSET && s == STEPPED;
        Sight {
            id: s as u32,
            design: *design,
            residual_m: residual_m + if stepped { step_m } else { 0.0 },
            sigma_m,
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_geometry_is_that_of_the_reference_experiment() {
        // Leverages at the first epoch, stated with the reference figures of this experiment to
        // two digits.
        let rows = geometry().unwrap()[0];
        let normal: nalgebra::Matrix4<f64> = rows
            .iter()
            .map(|row| nalgebra::Vector4::from(*row))
            .map(|row| row * row.transpose())
            .sum();
        let inverse = normal.try_inverse().unwrap();
        assert!(
            (inverse.trace().sqrt() - 1.73).abs() < 0.02,
            "{}",
            inverse.trace()
        );
        let expected = [0.39, 0.36, 0.49, 0.31, 0.28, 0.71, 0.63, 0.48, 0.34];
        for (row, leverage) in rows.iter().zip(expected) {
            let row = nalgebra::Vector4::from(*row);
            let found = row.dot(&(inverse * row));
            assert!((found - leverage).abs() < 0.011, "{found} for {leverage}");
        }
    }

    #[test]
    fn both_noises_have_the_stated_deviation() {
        for noise in [TrueNoise::Mixture, TrueNoise::Correlated] {
            let truth = Truth {
                noise,
                sigma_m: 1.8,
            };
            let mut square = 0.0;
            for seed in 0..20 {
                for residuals in residuals(&truth, seed) {
                    // Differences between satellites are free of the clock.
                    square += (residuals[0] - residuals[1]).powi(2);
                }
            }
            let variance = 0.5 * square / (20.0 * EPOCHS as f64);
            // Correlated over 60 s: 20 x 560 / 120 = 93 independent values, 15 % of the variance;
            // three of those.
            assert!(
                (variance / 3.24 - 1.0).abs() < 0.45,
                "{noise:?}: {variance}"
            );
        }
    }
}
