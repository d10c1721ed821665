//! The search for the satellites that contradict the rest.

use super::{IntegritySettings, Misfit, Parity, Place, residual};
use crate::chi_square::chi_square_threshold;
use crate::least_squares::{self, Consistency, Solution};
use crate::measurement::{Measurement, MeasurementModel};
use crate::{NavError, SatelliteId};

/// Faults sought at most: more make the sets too many to tell apart.
const MOST_FAULTS: usize = 4;

/// A solution without the satellites that spoiled it.
pub(super) struct Cleared {
    pub(super) solution: Solution,
    pub(super) misfits: Vec<Misfit>,
    /// Whether it could be no others.
    pub(super) is_unique: bool,
}

impl Cleared {
    fn of(solution: Solution) -> Self {
        Self {
            solution,
            misfits: Vec::new(),
            is_unique: true,
        }
    }
}

/// The solution without the satellites that spoil it, and these.
pub(super) fn without_faults(
    measurements: &[Measurement],
    model: &MeasurementModel,
    mut all: Solution,
    settings: &IntegritySettings,
) -> Result<Cleared, NavError> {
    let (consistency, threshold) = test(&all, settings)?;
    all.consistency = consistency;
    if consistency != Consistency::Failed {
        return Ok(Cleared::of(all));
    }
    for faults in 1..=settings.most_faults.min(MOST_FAULTS) {
        for suspects in most_suspect(&all, faults, settings)? {
            let rest: Vec<Measurement> = measurements
                .iter()
                .filter(|m| !suspects.satellites.contains(&m.satellite))
                .copied()
                .collect();
            let Ok(mut solution) = least_squares::solve(&rest, model, &all.position_ecef_m) else {
                continue;
            };
            // The position has moved: what stood above the mask may stand below it now, and the
            // residuals are tested as they are, not as the linear model foresaw.
            solution.consistency = test(&solution, settings)?.0;
            if solution.consistency != Consistency::Passed
                || solution.degrees_of_freedom() < redundancy_needed(faults)
            {
                continue;
            }
            let named = measurements
                .iter()
                .filter(|m| suspects.satellites.contains(&m.satellite));
            let misfits = named.map(|m| Misfit {
                satellite: m.satellite,
                residual_m: residual(m, model, &solution).map_or(f64::NAN, |r| r.0),
                score: all.chi_square,
                threshold,
                place: Place::InUse,
            });
            return Ok(Cleared {
                misfits: misfits.collect(),
                solution,
                is_unique: suspects.is_unique,
            });
        }
    }
    Ok(Cleared::of(all))
}

/// Redundant satellites that must be left after taking out so many.
pub(super) const fn redundancy_needed(faults: usize) -> usize {
    if faults == 1 { 1 } else { 2 }
}

/// Satellites under suspicion.
struct Suspects {
    satellites: Vec<SatelliteId>,
    /// Whether no other set of the same size would do.
    is_unique: bool,
}

/// Sets of `faults` satellites, the one first without which the chi-square is least.
///
/// The linear model errs by the square of the displacement over the range, 1 km for a fault of 150 km:
/// whether a set will do is for the test after a new solution to say. All single satellites are given,
/// as beyond that the order says little; of larger sets the first alone.
fn most_suspect(
    solution: &Solution,
    faults: usize,
    settings: &IntegritySettings,
) -> Result<Vec<Suspects>, NavError> {
    let Some(parity) = Parity::of(solution) else {
        return Ok(Vec::new());
    };
    let left = parity.freedom().saturating_sub(faults);
    if left < redundancy_needed(faults) {
        return Ok(Vec::new());
    }
    let threshold = chi_square_threshold(left, settings.false_alarm_probability)?;
    let mut sets: Vec<(f64, Vec<usize>)> = Vec::new();
    for_each_set(parity.satellites(), faults, &mut |set| {
        sets.extend(parity.without(set).map(|rest| (rest, set.to_vec())));
    });
    sets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_unique = sets.iter().filter(|(rest, _)| *rest <= threshold).count() <= 1;
    let tried = if faults == 1 { sets.len() } else { 1 };
    let name = |i: &usize| solution.satellites.get(*i).map(|s| s.satellite);
    let suspects = sets.iter().take(tried).map(|(_, set)| Suspects {
        satellites: set.iter().filter_map(name).collect(),
        is_unique,
    });
    Ok(suspects.collect())
}

/// Calls `visit` with every set of `size` of the numbers below `count`, in lexical order.
pub(super) fn for_each_set(count: usize, size: usize, visit: &mut impl FnMut(&[usize])) {
    let mut set: Vec<usize> = (0..size).collect();
    if size == 0 || size > count {
        return;
    }
    loop {
        visit(&set);
        // The last number that can still grow.
        let Some(at) = (0..size).rev().find(|k| set[*k] < count - size + k) else {
            return;
        };
        set[at] += 1;
        for k in at + 1..size {
            set[k] = set[k - 1] + 1;
        }
    }
}

/// Outcome of the residual test and its threshold.
fn test(solution: &Solution, settings: &IntegritySettings) -> Result<(Consistency, f64), NavError> {
    let freedom = solution.degrees_of_freedom();
    // One degree of freedom at least, so that a bad probability is always an error.
    let threshold = chi_square_threshold(freedom.max(1), settings.false_alarm_probability)?;
    let consistency = match freedom {
        0 => Consistency::Untested,
        _ if solution.chi_square <= threshold => Consistency::Passed,
        _ => Consistency::Failed,
    };
    Ok((consistency, threshold))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_is_visited_once() {
        let mut sets = Vec::new();
        for_each_set(5, 3, &mut |set| sets.push(set.to_vec()));
        // 5 over 3.
        assert_eq!(sets.len(), 10);
        assert_eq!(
            (&sets[0][..], &sets[9][..]),
            (&[0, 1, 2][..], &[2, 3, 4][..])
        );
        let mut none = 0;
        for_each_set(2, 3, &mut |_| none += 1);
        for_each_set(2, 0, &mut |_| none += 1);
        assert_eq!(none, 0);
    }
}
