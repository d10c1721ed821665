//! One epoch by itself: least squares, with or without a test of its integrity.

use gnss_nav::integrity::{self, IntegritySettings, Misfit, Place, ProtectionLevels};
use gnss_nav::least_squares::Consistency;
use gnss_nav::{Measurement, MeasurementModel, NavError, SatelliteId, Solution, least_squares};
use nalgebra::Vector3;

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

/// The measurements fit for use, and the others.
///
/// Weak satellites stay out. With too few strong ones they come in, and a solution is then relied on only where all
/// agree.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chosen {
    pub(super) used: Vec<Measurement>,
    unused: Vec<Measurement>,
    with_weak: bool,
}

impl Chosen {
    pub(super) fn of(measurements: &[Measurement], cn0_mask_dbhz: f64) -> Self {
        let is_strong = |m: &Measurement| m.cn0_dbhz >= cn0_mask_dbhz;
        let with_weak = measurements.iter().filter(|m| is_strong(m)).count() < NEEDED;
        let (used, unused) = measurements.iter().partition(|m| with_weak || is_strong(m));
        Self {
            used,
            unused,
            with_weak,
        }
    }
}

/// Solves an epoch from `start_ecef_m`, any place, without a test.
///
/// # Errors
/// As [`least_squares::solve`].
pub(super) fn untested(
    chosen: &Chosen,
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
    most_pdop: f64,
) -> Result<Fix, NavError> {
    let solution = least_squares::solve(&chosen.used, model, start_ecef_m)?;
    Ok(Fix {
        is_trusted: !chosen.with_weak && solution.dops.pdop <= most_pdop,
        solution,
        misfits: Vec::new(),
        protection: None,
    })
}

/// The same, tested by its residuals; what does not fit is taken out. Unused satellites are held
/// against the solution.
///
/// # Errors
/// As [`least_squares::solve`].
pub(super) fn tested(
    chosen: &Chosen,
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
    most_pdop: f64,
    settings: &IntegritySettings,
) -> Result<Fix, NavError> {
    let assured = integrity::solve(&chosen.used, model, start_ecef_m, settings)?;
    let solution = assured.solution;
    let mut misfits = assured.misfits;
    let agrees = if chosen.with_weak {
        solution.consistency == Consistency::Passed && solution.excluded.is_empty()
    } else {
        solution.consistency != Consistency::Failed
    };
    misfits.extend(integrity::misfits_among(
        chosen.unused.iter(),
        model,
        &solution,
        settings,
    )?);
    Ok(Fix {
        is_trusted: agrees && solution.dops.pdop <= most_pdop,
        protection: assured.protection,
        solution,
        misfits,
    })
}
