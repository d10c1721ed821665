//! Gauss-Newton on five unknowns for given millisecond ambiguities.

use nalgebra::{SMatrix, SVector, Vector3};

use super::{Anchor, Channel};
use crate::constants::{CA_PERIOD_M, SPEED_OF_LIGHT_MPS};
use crate::least_squares::RateEquation;
use crate::linear::{self, Row};
use crate::measurement::{MeasurementModel, Predicted};
use crate::prediction::received_state;
use crate::{GpsTime, NavError, SatelliteId, SatelliteState};

/// Position, bias, coarse time.
pub(super) const UNKNOWNS: usize = 5;

const ITERATIONS: usize = 12;

/// Steps at which the iteration stops: 1 mm, and 1 us of a range rate of 800 m/s.
const STEP_M: f64 = 1e-3;
const STEP_S: f64 = 1e-6;

/// A channel with the whole milliseconds of its pseudorange, up to a common number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranged<'a> {
    pub(super) channel: Channel<'a>,
    pub(super) milliseconds: i64,
}

/// A channel at the fitted position.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    pub(super) channel: Channel<'a>,
    milliseconds: i64,
    pub(super) predicted: Predicted,
    state: SatelliteState,
    pub(super) residual_m: f64,
    pub(super) sigma_m: f64,
}

impl Seen<'_> {
    pub(super) fn rate_equation(&self) -> RateEquation {
        RateEquation::from_parts(
            &self.predicted.line_of_sight,
            &self.predicted.delay_rate,
            self.state.clock_drift,
            self.channel.range_rate_mps,
            self.channel.range_rate_variance_m2_s2,
        )
    }

    pub(super) fn row(&self) -> Row<UNKNOWNS> {
        let los = &self.predicted.line_of_sight;
        let e = los.unit_ecef;
        let rate =
            los.range_rate_mps(&Vector3::zeros()) - SPEED_OF_LIGHT_MPS * self.state.clock_drift;
        Row {
            gradient: SVector::from([-e.x, -e.y, -e.z, 1.0, rate]),
            residual: self.residual_m,
            sigma: self.sigma_m,
        }
    }
}

/// A converged fit.
#[derive(Debug, Clone)]
pub(super) struct Fit<'a> {
    pub(super) position_ecef_m: Vector3<f64>,
    /// c times (receiver's clock - GPS time), modulo 1 ms.
    pub(super) bias_m: f64,
    pub(super) time: GpsTime,
    pub(super) covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    pub(super) seen: Vec<Seen<'a>>,
    pub(super) masked: Vec<SatelliteId>,
    /// Of the code residuals.
    pub(super) chi_square: f64,
}

impl Fit<'_> {
    pub(super) fn contains(&self, satellite: SatelliteId) -> bool {
        self.seen.iter().any(|s| s.channel.satellite == satellite)
    }

    /// Squared distance from the anchor in its own standard deviations.
    pub(super) fn strangeness(&self, anchor: &Anchor) -> f64 {
        let away_m = (self.position_ecef_m - anchor.position_ecef_m).norm();
        let late_s = self.time - anchor.time;
        (away_m / anchor.position_sigma_m).powi(2) + (late_s / anchor.time_sigma_s).powi(2)
    }
}

/// Fits position, bias and time to `ranged`, from `start` and tied loosely to `anchor`.
pub(super) fn fit<'a>(
    ranged: &[Ranged<'a>],
    anchor: &Anchor,
    model: &MeasurementModel,
    start: (Vector3<f64>, GpsTime),
) -> Result<Fit<'a>, NavError> {
    let (mut position, mut time) = start;
    let mut bias_m = 0.0;
    for _ in 0..ITERATIONS {
        let seen = ranged
            .iter()
            .map(|r| see(r, model, &position, time, bias_m))
            .collect::<Result<Vec<Seen>, NavError>>()?;
        let mut rows: Vec<Row<UNKNOWNS>> = seen.iter().map(Seen::row).collect();
        rows.extend(ties(anchor, &position, time));
        let step = linear::solve(&rows)?;
        position += step.x.fixed_rows::<3>(0);
        bias_m += step.x[3];
        time = time + step.x[4];
        if step.x.fixed_rows::<4>(0).norm() < STEP_M && step.x[4].abs() < STEP_S {
            return Ok(Fit {
                position_ecef_m: position,
                bias_m,
                time,
                covariance: step.covariance,
                chi_square: seen
                    .iter()
                    .map(|s| (s.residual_m / s.sigma_m).powi(2))
                    .sum(),
                seen,
                masked: Vec::new(),
            });
        }
    }
    Err(NavError::NoConvergence {
        iterations: ITERATIONS,
    })
}

/// The same fit without satellites below the elevation mask.
///
/// # Errors
/// [`NavError::TooFew`] with fewer than five above it, and as [`fit`].
pub(super) fn without_masked<'a>(
    best: Fit<'a>,
    anchor: &Anchor,
    model: &MeasurementModel,
) -> Result<Fit<'a>, NavError> {
    let (kept, low): (Vec<Seen>, Vec<Seen>) = best
        .seen
        .iter()
        .partition(|s| s.predicted.look.elevation_rad >= model.elevation_mask_rad);
    if low.is_empty() {
        return Ok(best);
    }
    if kept.len() < UNKNOWNS {
        return Err(NavError::TooFew {
            found: kept.len(),
            needed: UNKNOWNS,
        });
    }
    let ranged: Vec<Ranged> = kept
        .iter()
        .map(|s| Ranged {
            channel: s.channel,
            milliseconds: s.milliseconds,
        })
        .collect();
    let mut above = fit(&ranged, anchor, model, (best.position_ecef_m, best.time))?;
    above.masked = low.iter().map(|s| s.channel.satellite).collect();
    Ok(above)
}

/// `ranged` as it should be from `position` at `time`, the clock's bias being `bias_m`.
///
/// # Errors
/// As [`received_state`].
pub(super) fn see<'a>(
    ranged: &Ranged<'a>,
    model: &MeasurementModel,
    position: &Vector3<f64>,
    time: GpsTime,
    bias_m: f64,
) -> Result<Seen<'a>, NavError> {
    let channel = ranged.channel;
    let (state, _) = received_state(channel.ephemeris, position, time)?;
    let predicted = model.predict(&state, position, time);
    let measured_m = ranged.milliseconds as f64 * CA_PERIOD_M - channel.fraction_m;
    Ok(Seen {
        channel,
        milliseconds: ranged.milliseconds,
        predicted,
        state,
        residual_m: measured_m - predicted.pseudorange_m - bias_m,
        sigma_m: model
            .variance_m2(
                channel.code_variance_m2,
                channel.ephemeris.user_range_accuracy_m(),
                &predicted,
            )
            .sqrt(),
    })
}

/// The prior as four weak equations: they hold what the geometry leaves open.
pub(super) fn ties(anchor: &Anchor, position: &Vector3<f64>, time: GpsTime) -> Vec<Row<UNKNOWNS>> {
    let away = anchor.position_ecef_m - position;
    let tie = |index: usize, residual: f64, sigma: f64| Row {
        gradient: SVector::from_fn(|i, _| if i == index { 1.0 } else { 0.0 }),
        residual,
        sigma,
    };
    vec![
        tie(0, away.x, anchor.position_sigma_m),
        tie(1, away.y, anchor.position_sigma_m),
        tie(2, away.z, anchor.position_sigma_m),
        tie(4, anchor.time - time, anchor.time_sigma_s),
    ]
}
