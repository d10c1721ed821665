//! One epoch: least squares, with or without a test of its integrity.

use gnss_nav::integrity::{self, Assured, Misfit, Place, ProtectionLevels};
use gnss_nav::least_squares::Consistency;
use gnss_nav::{Measurement, MeasurementModel, NavError, SatelliteId, Solution};
use nalgebra::Vector3;

use crate::raim::{Raim, RaimWatch};

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

/// Solves the epoch `time_s` from `start_ecef_m`, any place, and takes out what `watch` finds not to fit. Unused
/// satellites are held against the solution.
///
/// # Errors
/// As [`gnss_nav::least_squares::solve`].
pub(super) fn solve(
    (time_s, chosen): (f64, &Chosen),
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
    most_pdop: f64,
    (raim, watch): (Raim, &mut RaimWatch),
) -> Result<Fix, NavError> {
    let Assured {
        solution,
        mut misfits,
        protection,
    } = watch.epoch(time_s, &chosen.used, model, start_ecef_m)?;
    let agrees = if chosen.with_weak {
        solution.consistency == Consistency::Passed && solution.excluded.is_empty()
    } else {
        solution.consistency != Consistency::Failed
    };
    if let Some(settings) = raim.settings() {
        let unused = chosen.unused.iter();
        misfits.extend(integrity::misfits_among(
            unused, model, &solution, &settings,
        )?);
    }
    Ok(Fix {
        is_trusted: agrees && solution.dops.pdop <= most_pdop,
        protection,
        solution,
        misfits,
    })
}
