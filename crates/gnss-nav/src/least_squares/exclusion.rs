//! Residual test, and the search for the satellite that spoils a fix.

use nalgebra::Vector3;

use super::{Consistency, Solution, solve_subset};
use crate::NavError;
use crate::chi_square::chi_square_threshold;
use crate::measurement::{Measurement, MeasurementModel};

/// With fewer satellites a fault shows but cannot be told apart.
const IDENTIFIABLE: usize = 6;
/// Redundant satellites that are left after more than one is taken out: with a single one, some set passes
/// by chance.
const LEFT_AFTER_SEVERAL: usize = 2;

/// Solves one epoch and takes out satellites until the residuals pass.
///
/// The chi-square of the pseudorange residuals is tested at `false_alarm_probability`. Where it
/// fails with six satellites or more, the one without which the chi-square is least is taken out,
/// repeatedly. If that never passes, or not with two redundant satellites left of several taken out, the solution of all satellites comes back, marked
/// [`Consistency::Failed`].
///
/// # Errors
/// As [`super::solve`]; [`NavError::Value`] for a probability outside (0, 1).
pub fn solve_with_exclusion(
    measurements: &[Measurement],
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
    false_alarm_probability: f64,
) -> Result<Solution, NavError> {
    let mut kept: Vec<&Measurement> = measurements.iter().collect();
    let mut all = solve_subset(&kept, model, start_ecef_m)?;
    all.consistency = test(&all, false_alarm_probability)?;
    let mut current = all.clone();
    let mut excluded = Vec::new();
    while current.consistency == Consistency::Failed && current.satellites.len() >= IDENTIFIABLE {
        let Some((index, best)) = best_without_one(&kept, &current, model) else {
            break;
        };
        excluded.push(kept.remove(index).satellite);
        current = best;
        current.consistency = test(&current, false_alarm_probability)?;
    }
    let few = excluded.len() > 1 && current.degrees_of_freedom() < LEFT_AFTER_SEVERAL;
    if few || current.consistency == Consistency::Failed {
        return Ok(all);
    }
    current.excluded = excluded;
    Ok(current)
}

fn best_without_one(
    kept: &[&Measurement],
    current: &Solution,
    model: &MeasurementModel,
) -> Option<(usize, Solution)> {
    let used = |m: &Measurement| {
        current
            .satellites
            .iter()
            .any(|s| s.satellite == m.satellite)
    };
    (0..kept.len())
        .filter(|&index| used(kept[index]))
        .filter_map(|index| {
            let mut rest = kept.to_vec();
            rest.remove(index);
            let solution = solve_subset(&rest, model, &current.position_ecef_m).ok()?;
            Some((index, solution))
        })
        .min_by(|(_, a), (_, b)| a.chi_square.total_cmp(&b.chi_square))
}

fn test(solution: &Solution, false_alarm_probability: f64) -> Result<Consistency, NavError> {
    // One degree of freedom at least, so that a bad probability is always an error.
    let freedom = solution.degrees_of_freedom();
    let threshold = chi_square_threshold(freedom.max(1), false_alarm_probability)?;
    Ok(match freedom {
        0 => Consistency::Untested,
        _ if solution.chi_square <= threshold => Consistency::Passed,
        _ => Consistency::Failed,
    })
}
