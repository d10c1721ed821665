//! Errors so gross that the position from all pseudoranges is in another country: sought before the elevation mask,
//! which would be laid there.

use nalgebra::Vector3;

use super::exclusion::{for_each_set, redundancy_needed};
use super::{Misfit, Place, residual};
use crate::least_squares::{self, Solution};
use crate::measurement::{Measurement, MeasurementModel};

/// Deviation a pseudorange is given here, m: far above orbits, clocks and delays, so that no sound epoch fails, and
/// far below what displaces a position by degrees of elevation.
const DEVIATION_M: f64 = 10e3;

/// Sum of squared residuals, over that, up to which an epoch agrees: one residual of 45 km. No sound epoch comes near.
const LIMIT: f64 = 20.0;

/// Unknowns of a position.
const UNKNOWNS: usize = 4;

/// Gross errors sought at once at most.
const MOST_FAULTS: usize = 2;

/// What is grossly wrong in one epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct Gross {
    /// The others, in order.
    pub sound: Vec<Measurement>,
    /// What is wrong, in order; mostly nothing.
    pub wrong: Vec<Measurement>,
    /// Position of the sound ones from geometry alone, ECEF, m, where they give one.
    pub place_ecef_m: Option<Vector3<f64>>,
    /// Whether it could be no others.
    pub is_unique: bool,
    /// Chi-square of all, infinite where they give no position.
    score: f64,
}

impl Gross {
    /// What is said of `wrong`, held against a solution without them; a satellite that is set there has no residual.
    #[must_use]
    pub fn misfits(&self, model: &MeasurementModel, solution: &Solution) -> Vec<Misfit> {
        let misfit = |m: &Measurement| Misfit {
            satellite: m.satellite,
            residual_m: residual(m, model, solution).map_or(f64::NAN, |r| r.0),
            score: self.score,
            threshold: LIMIT,
            place: Place::InUse,
        };
        self.wrong.iter().map(misfit).collect()
    }
}

/// Seeks one, then two satellites without which geometry alone agrees, `most_faults` at most: errors of tens of
/// kilometres and more.
#[must_use]
pub fn search(
    measurements: &[Measurement],
    start_ecef_m: &Vector3<f64>,
    most_faults: usize,
) -> Gross {
    let all = Tested::without(measurements, &[], start_ecef_m);
    if all.chi_square <= LIMIT {
        return all.found(measurements, &[], all.chi_square);
    }
    for faults in 1..=most_faults.min(MOST_FAULTS) {
        let left = measurements.len().saturating_sub(UNKNOWNS + faults);
        if left < redundancy_needed(faults) {
            break;
        }
        let mut agreeing: Vec<(Tested, Vec<usize>)> = Vec::new();
        for_each_set(measurements.len(), faults, &mut |set| {
            let tested = Tested::without(measurements, set, start_ecef_m);
            if tested.chi_square <= LIMIT {
                agreeing.push((tested, set.to_vec()));
            }
        });
        let is_unique = agreeing.len() == 1;
        agreeing.sort_by(|a, b| a.0.chi_square.total_cmp(&b.0.chi_square));
        if let Some((tested, set)) = agreeing.first() {
            return Gross {
                is_unique,
                ..tested.found(measurements, set, all.chi_square)
            };
        }
    }
    all.found(measurements, &[], all.chi_square)
}

/// How well some measurements agree.
#[derive(Debug, Clone, Copy)]
struct Tested {
    /// Infinite where they give no position.
    chi_square: f64,
    /// Their position.
    place_ecef_m: Option<Vector3<f64>>,
}

impl Tested {
    /// The measurements without those of `set` (by their place).
    fn without(measurements: &[Measurement], set: &[usize], start_ecef_m: &Vector3<f64>) -> Self {
        let kept: Vec<&Measurement> = (0..)
            .zip(measurements)
            .filter(|(i, _)| !set.contains(i))
            .map(|(_, m)| m)
            .collect();
        match least_squares::by_geometry(&kept, start_ecef_m) {
            Ok((place_ecef_m, residuals_m)) => Self {
                chi_square: residuals_m.iter().map(|r| (r / DEVIATION_M).powi(2)).sum(),
                place_ecef_m: Some(place_ecef_m),
            },
            Err(_) => Self {
                chi_square: f64::INFINITY,
                place_ecef_m: None,
            },
        }
    }

    fn found(&self, measurements: &[Measurement], set: &[usize], score: f64) -> Gross {
        let (wrong, sound): (Vec<_>, Vec<_>) =
            (0..).zip(measurements).partition(|(i, _)| set.contains(i));
        let only = |some: Vec<(usize, &Measurement)>| some.into_iter().map(|(_, m)| *m).collect();
        Gross {
            sound: only(sound),
            wrong: only(wrong),
            place_ecef_m: self.place_ecef_m,
            is_unique: true,
            score,
        }
    }
}
