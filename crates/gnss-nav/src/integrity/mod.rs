//! Integrity of one epoch: whether its pseudoranges agree, which of them do not, and how far off the
//! position may be unnoticed.
//!
//! Receiver autonomous integrity monitoring in its classical form: the chi-square of the residuals,
//! the search for one or several faults in parity space, and protection levels from the slopes of
//! `Walter1995`.

mod exclusion;
pub mod gross;
mod parity;
mod protection;
#[cfg(test)]
mod tests;

use nalgebra::{Vector3, Vector4};

use exclusion::Cleared;

use crate::chi_square::chi_square_threshold;
use crate::least_squares::{Consistency, Solution};
use crate::measurement::{Measurement, MeasurementModel};
use crate::{NavError, SatelliteId, least_squares};

pub use parity::Parity;
pub use protection::{ProtectionLevels, Ranged, levels_of};

/// What is tested, and how sharply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntegritySettings {
    /// Probability that the residuals of a fault-free epoch fail the test. Default 1e-5: once in a
    /// day at 1 Hz.
    pub false_alarm_probability: f64,
    /// Probability that an error above the protection level goes unnoticed, given the worst fault
    /// of one satellite. Default 1e-3.
    pub missed_detection_probability: f64,
    /// Most satellites taken out of one epoch, 0 to 4. Default 3.
    pub most_faults: usize,
}

impl Default for IntegritySettings {
    fn default() -> Self {
        Self {
            false_alarm_probability: 1e-5,
            missed_detection_probability: 1e-3,
            most_faults: 3,
        }
    }
}

/// A satellite that does not fit, and how it was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Measured minus predicted pseudorange, at the solution without it, m.
    pub residual_m: f64,
    /// What was tested: chi-square of the epoch it spoiled, or its own normalised residual.
    pub score: f64,
    /// The limit of `score`.
    pub threshold: f64,
    /// Whether it was in use.
    pub place: Place,
}

/// Where a satellite stood that does not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Among the satellites in use: it was taken out.
    InUse,
    /// Below a mask, where it does no harm.
    Unused,
}

/// A solution and what vouches for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Assured {
    /// The solution without what was taken out; [`Consistency::Failed`] where its residuals contradict one another
    /// and nothing could be singled out.
    pub solution: Solution,
    /// Satellites that do not fit, in order of the measurements, those below the mask last.
    pub misfits: Vec<Misfit>,
    /// How far off the position may be; `None` where the geometry forbids a statement: without a
    /// redundant satellite, with one that no other checks, or where other satellites than those taken out
    /// could be the faulty ones.
    pub protection: Option<ProtectionLevels>,
}

/// Solves one epoch, takes out what contradicts the rest, and says how far that can be relied on.
///
/// First geometry alone is tested, before the elevation mask: an error of thousands of kilometres would lay the mask at a
/// place where other satellites are up. Then the chi-square of the residuals. Where it fails, the sets of one satellite, then of two
/// and so on are sought in parity space without which it passes: the smallest, and of those the one
/// that explains most. One exclusion needs one redundant satellite left, several need two: three
/// of eight that agree by chance are common. Satellites below the mask are held against the
/// solution one by one, and named.
///
/// # Errors
/// As [`least_squares::solve`]; [`NavError::Value`] for a probability outside (0, 1).
pub fn solve(
    measurements: &[Measurement],
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
    settings: &IntegritySettings,
) -> Result<Assured, NavError> {
    let gross = gross::search(measurements, start_ecef_m, settings.most_faults);
    let fewer = IntegritySettings {
        most_faults: settings.most_faults.saturating_sub(gross.wrong.len()),
        ..*settings
    };
    let all = match &gross.place_ecef_m {
        Some(place_ecef_m) => least_squares::solve_near(&gross.sound, model, place_ecef_m),
        None => least_squares::solve(&gross.sound, model, start_ecef_m),
    };
    let mut assured = assure(&gross.sound, model, all?, &fewer)?;
    if gross.wrong.is_empty() {
        return Ok(assured);
    }
    assured.protection = assured.protection.filter(|_| gross.is_unique);
    let misfits = gross.misfits(model, &assured.solution);
    assured.misfits.extend(misfits);
    let place = |satellite| measurements.iter().position(|m| m.satellite == satellite);
    assured
        .misfits
        .sort_by_key(|m| (m.place == Place::Unused, place(m.satellite)));
    let wrong = gross.wrong.iter().map(|m| m.satellite);
    assured.solution.excluded.extend(wrong);
    assured.solution.excluded.sort_by_key(|s| place(*s));
    Ok(assured)
}

/// The same of measurements none of which is grossly wrong, and the solution of them all.
fn assure(
    measurements: &[Measurement],
    model: &MeasurementModel,
    all: Solution,
    settings: &IntegritySettings,
) -> Result<Assured, NavError> {
    let Cleared {
        mut solution,
        misfits,
        is_unique,
    } = exclusion::without_faults(measurements, model, all, settings)?;
    let protection = if is_unique && solution.consistency == Consistency::Passed {
        protection::levels(&solution, settings)?
    } else {
        None
    };
    solution.excluded = misfits.iter().map(|m| m.satellite).collect();
    let mut assured = Assured {
        solution,
        misfits,
        protection,
    };
    let masked = measurements
        .iter()
        .filter(|m| assured.solution.masked.contains(&m.satellite));
    let found = misfits_among(masked, model, &assured.solution, settings)?;
    assured.misfits.extend(found);
    Ok(assured)
}

/// Those of `unused`, measurements that had no part in `solution`, that do not fit it; none where the
/// solution has not passed its own test.
///
/// # Errors
/// [`NavError::Value`] for a probability outside (0, 1).
pub fn misfits_among<'a>(
    unused: impl Iterator<Item = &'a Measurement>,
    model: &MeasurementModel,
    solution: &Solution,
    settings: &IntegritySettings,
) -> Result<Vec<Misfit>, NavError> {
    let threshold = chi_square_threshold(1, settings.false_alarm_probability)?;
    if solution.consistency != Consistency::Passed {
        return Ok(Vec::new());
    }
    Ok(unused
        .filter_map(|m| {
            let (residual_m, variance_m2) = residual(m, model, solution)?;
            let score = residual_m * residual_m / variance_m2;
            (score > threshold).then_some(Misfit {
                satellite: m.satellite,
                residual_m,
                score,
                threshold,
                place: Place::Unused,
            })
        })
        .collect())
}

/// Residual of a measurement that had no part in `solution`, m, and its variance, m^2; none below
/// the horizontal, where the delays are not modelled.
pub fn residual(
    measurement: &Measurement,
    model: &MeasurementModel,
    solution: &Solution,
) -> Option<(f64, f64)> {
    let position = &solution.position_ecef_m;
    let predicted = model.predict(&measurement.state, position, measurement.receive_time);
    if predicted.look.elevation_rad <= 0.0 {
        return None;
    }
    let e = predicted.line_of_sight.unit_ecef;
    let gradient = Vector4::new(-e.x, -e.y, -e.z, 1.0);
    let residual_m = measurement.pseudorange_m - predicted.pseudorange_m - solution.clock_bias_m;
    let own_m2 = model.variance_m2(
        measurement.pseudorange_variance_m2,
        measurement.user_range_accuracy_m,
        &predicted,
    );
    let variance_m2 = own_m2 + gradient.dot(&(solution.covariance_m2 * gradient));
    Some((residual_m, variance_m2))
}
