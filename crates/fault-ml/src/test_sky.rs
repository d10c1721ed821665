//! A small sky over a fixed place, for tests of everything that takes pseudoranges.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{CorrelatedNoise, SatelliteMeasurement, Sight};

/// Where the receiver is, ECEF, m.
pub(crate) const PLACE_M: [f64; 3] = [-3_962_108.7, 3_381_309.6, 3_668_678.6];
/// c times its clock bias, m.
pub(crate) const CLOCK_M: f64 = 12_345.0;
/// Height of the satellites over the place, m.
const RANGE_M: f64 = 2.2e7;

/// The first `count` satellites, ids 1 to `count`, each with `error_m(id)` on its pseudorange and a
/// variance of 9 m^2.
pub(crate) fn measurements(count: u32, error_m: impl Fn(u32) -> f64) -> Vec<SatelliteMeasurement> {
    let norm = PLACE_M.iter().map(|p| p * p).sum::<f64>().sqrt();
    let up = PLACE_M.map(|p| p / norm);
    let level = (up[0] * up[0] + up[1] * up[1]).sqrt();
    let east = [-up[1] / level, up[0] / level, 0.0];
    let north = [-up[2] * east[1], up[2] * east[0], level];
    let satellite = |id: u32| {
        let azimuth = 2.4 * f64::from(id);
        let elevation = 0.2 + 1.2 * (0.37 * f64::from(id)).fract();
        let along = [
            azimuth.sin() * elevation.cos(),
            azimuth.cos() * elevation.cos(),
            elevation.sin(),
        ];
        let position_ecef_m = std::array::from_fn(|d| {
            PLACE_M[d] + RANGE_M * (along[0] * east[d] + along[1] * north[d] + along[2] * up[d])
        });
        SatelliteMeasurement {
            id,
            position_ecef_m,
            pseudorange_m: RANGE_M + CLOCK_M + error_m(id),
            variance_m2: 9.0,
        }
    };
    (1..=count).map(satellite).collect()
}

/// Design rows of nine satellites in east, north, up; leverages 0.26 to 0.76.
pub(crate) fn designs() -> Vec<[f64; 4]> {
    let row = |id: u32| {
        let azimuth = 2.4 * f64::from(id);
        let elevation = 0.2 + 1.2 * (0.37 * f64::from(id)).fract();
        [
            -azimuth.sin() * elevation.cos(),
            -azimuth.cos() * elevation.cos(),
            -elevation.sin(),
            1.0,
        ]
    };
    (1..=9).map(row).collect()
}

/// Sights of `designs` with ids from zero, a standard deviation of 3 m and these residuals.
pub(crate) fn sights(designs: &[[f64; 4]], residual_m: impl Fn(u32) -> f64) -> Vec<Sight> {
    let sight = |(id, design): (u32, &[f64; 4])| Sight {
        id,
        design: *design,
        residual_m: residual_m(id),
        sigma_m: 3.0,
    };
    (0..).zip(designs).map(sight).collect()
}

/// White heavy-tailed noise of a deviation of 1.8 m: the detectors overstate it by 3 m.
pub(crate) const TAILED: CorrelatedNoise = CorrelatedNoise {
    bias_sigma_m: 0.0,
    bias_tail_share: 0.0,
    markov_sigma_m: 0.0,
    markov_time_s: 1.0,
    white_sigma_m: 1.8,
    tail_share: 0.1,
};

/// Noise (m) of nine satellites over `epochs` epochs.
pub(crate) fn noise(noise: &CorrelatedNoise, epochs: usize, seed: u64) -> Vec<[f64; 9]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut generator = noise.generator(9, &mut random);
    let mut epoch = || {
        let mut values = [0.0; 9];
        generator.advance(1.0, &mut values, &mut random);
        values
    };
    (0..epochs).map(|_| epoch()).collect()
}
