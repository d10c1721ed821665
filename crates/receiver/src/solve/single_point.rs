//! One epoch by itself: least squares, with or without a test of its integrity.

use gnss_nav::integrity::{self, Misfit, Place, ProtectionLevels};
use gnss_nav::least_squares::Consistency;
use gnss_nav::{Measurement, MeasurementModel, NavError, SatelliteId, Solution, least_squares};
use nalgebra::Vector3;

use super::SolveSettings;

/// Satellites a position needs.
const NEEDED: usize = 4;

/// What one epoch gives.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fix {
    pub(super) solution: Solution,
    pub(super) misfits: Vec<Misfit>,
    pub(super) protection: Option<ProtectionLevels>,
    /// Whether the measurements agree, in a geometry that shows it.
    pub(super) is_trusted: bool,
}

impl Fix {
    /// Whether `satellite` was taken out.
    pub(super) fn excludes(&self, satellite: SatelliteId) -> Option<&Misfit> {
        self.misfits
            .iter()
            .find(|m| m.satellite == satellite && m.place == Place::InUse)
    }
}

/// Solves an epoch from `start_ecef_m`, any place.
///
/// Weak satellites stay out and are held against the solution afterwards. With too few strong ones
/// they come in, and the solution is relied on where all agree.
///
/// # Errors
/// As [`least_squares::solve`].
pub(super) fn solve(
    measurements: &[Measurement],
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
    settings: &SolveSettings,
) -> Result<Fix, NavError> {
    let is_strong = |m: &Measurement| m.cn0_dbhz >= settings.cn0_mask_dbhz;
    let with_weak = measurements.iter().filter(|m| is_strong(m)).count() < NEEDED;
    let (used, unused): (Vec<Measurement>, Vec<Measurement>) =
        measurements.iter().partition(|m| with_weak || is_strong(m));
    let Some(integrity) = &settings.integrity else {
        let solution = least_squares::solve(&used, model, start_ecef_m)?;
        return Ok(Fix {
            is_trusted: !with_weak && solution.dops.pdop <= settings.most_pdop,
            solution,
            misfits: Vec::new(),
            protection: None,
        });
    };
    let assured = integrity::solve(&used, model, start_ecef_m, integrity)?;
    let solution = assured.solution;
    let mut misfits = assured.misfits;
    let agrees = if with_weak {
        solution.consistency == Consistency::Passed && solution.excluded.is_empty()
    } else {
        solution.consistency != Consistency::Failed
    };
    misfits.extend(integrity::misfits_among(
        unused.iter(),
        model,
        &solution,
        integrity,
    )?);
    Ok(Fix {
        is_trusted: agrees && solution.dops.pdop <= settings.most_pdop,
        protection: assured.protection,
        solution,
        misfits,
    })
}
