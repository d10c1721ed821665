//! The prior as the fit needs it: a position from the Dopplers where none is given.

use nalgebra::{Vector3, Vector4};

use super::{Anchor, Channel, Prior};
use crate::NavError;
use crate::chi_square::chi_square_threshold;
use crate::constants::{SPEED_OF_LIGHT_MPS, WGS84_SEMI_MAJOR_M};
use crate::geodesy::Geodetic;
use crate::linear::{self, Linear, Row};
use crate::prediction::received_state;

/// A receiver is within this of the ellipsoid for all that Dopplers can tell, m.
const HEIGHT_SIGMA_M: f64 = 10e3;

const ITERATIONS: usize = 40;

/// Longest step, m: farther the range rates are not linear in the position.
const LONGEST_STEP_M: f64 = 1.5e6;

/// The iteration stops at steps below this, m, far less than Doppler resolves.
const STEP_M: f64 = 10.0;

/// Residuals above this false-alarm probability make one satellite suspect.
const FALSE_ALARM: f64 = 1e-3;

/// Checks `prior` and, where it has no position, takes that of the Dopplers.
pub(super) fn from_prior(prior: &Prior, channels: &[Channel]) -> Result<Anchor, NavError> {
    positive("time uncertainty, s", prior.time_uncertainty_s)?;
    let (position_ecef_m, position_sigma_m) = match prior.position_ecef_m {
        Some(position) => {
            positive("position uncertainty, m", prior.position_uncertainty_m)?;
            (position, prior.position_uncertainty_m)
        }
        None => doppler_position(channels, prior)?,
    };
    if !position_ecef_m.iter().all(|x| x.is_finite()) {
        return Err(NavError::Value {
            name: "prior position",
            value: format!("{position_ecef_m:?}"),
            expected: "finite coordinates",
        });
    }
    Ok(Anchor {
        position_ecef_m,
        position_sigma_m,
        time: prior.time,
        time_sigma_s: prior.time_uncertainty_s,
    })
}

fn positive(name: &'static str, value: f64) -> Result<(), NavError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(NavError::Value {
        name,
        value: value.to_string(),
        expected: "more than 0",
    })
}

/// Position of a receiver at rest on the ellipsoid from range rates, and its uncertainty, m.
///
/// One satellite whose range rate does not fit the others is left out.
fn doppler_position(channels: &[Channel], prior: &Prior) -> Result<(Vector3<f64>, f64), NavError> {
    positive("speed uncertainty, m/s", prior.speed_uncertainty_mps)?;
    let all: Vec<&Channel> = channels
        .iter()
        .filter(|c| c.range_rate_mps.is_finite() && c.range_rate_variance_m2_s2.is_finite())
        .collect();
    let mut best = iterate(&all, prior)?;
    // Three coordinates and the drift, less the height.
    let freedom = all.len().saturating_sub(3);
    if freedom > 1 && best.chi_square > chi_square_threshold(freedom, FALSE_ALARM)? {
        for out in 0..all.len() {
            let mut rest = all.clone();
            rest.remove(out);
            if let Ok(other) = iterate(&rest, prior)
                && other.chi_square < best.chi_square
            {
                best = other;
            }
        }
    }
    Ok((best.position_ecef_m, 2.0 * best.sigma_m))
}

struct DopplerFix {
    position_ecef_m: Vector3<f64>,
    sigma_m: f64,
    chi_square: f64,
}

fn iterate(channels: &[&Channel], prior: &Prior) -> Result<DopplerFix, NavError> {
    let mut position = below_the_satellites(channels, prior)?;
    for _ in 0..ITERATIONS {
        let mut rows = channels
            .iter()
            .map(|channel| row(channel, prior, &position))
            .collect::<Result<Vec<Row<4>>, NavError>>()?;
        rows.push(height_row(&position));
        let linear = linear::solve(&rows)?;
        let step = linear.x.xyz();
        if step.norm() < STEP_M {
            return Ok(DopplerFix {
                position_ecef_m: position,
                sigma_m: linear.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt(),
                chi_square: chi_square(&rows, &linear),
            });
        }
        position += step * (LONGEST_STEP_M / step.norm()).min(1.0);
    }
    Err(NavError::NoConvergence {
        iterations: ITERATIONS,
    })
}

fn chi_square(rows: &[Row<4>], linear: &Linear<4>) -> f64 {
    rows.iter()
        .map(|r| ((r.residual - r.gradient.dot(&linear.x)) / r.sigma).powi(2))
        .sum()
}

/// The point on the surface under the mean direction of the satellites: they are all above the
/// receiver's horizon, so it is within some thousand kilometres.
fn below_the_satellites(channels: &[&Channel], prior: &Prior) -> Result<Vector3<f64>, NavError> {
    let mut sum = Vector3::zeros();
    for channel in channels {
        sum += channel
            .ephemeris
            .state_at(prior.time)?
            .position_ecef_m
            .normalize();
    }
    if sum.norm() > 0.0 {
        Ok(sum.normalize() * WGS84_SEMI_MAJOR_M)
    } else {
        Err(NavError::Singular)
    }
}

/// One range rate: its gradient by the position is minus the transverse velocity over the range.
fn row(channel: &Channel, prior: &Prior, position: &Vector3<f64>) -> Result<Row<4>, NavError> {
    let (state, path) = received_state(channel.ephemeris, position, prior.time)?;
    let e = path.unit_ecef;
    let v = path.satellite_velocity_ecef_mps;
    let transverse = (v - e * e.dot(&v)) / path.range_m;
    let at_rest_mps =
        path.range_rate_mps(&Vector3::zeros()) - SPEED_OF_LIGHT_MPS * state.clock_drift;
    Ok(Row {
        gradient: Vector4::new(-transverse.x, -transverse.y, -transverse.z, 1.0),
        residual: channel.range_rate_mps - at_rest_mps,
        sigma: channel
            .range_rate_variance_m2_s2
            .sqrt()
            .hypot(prior.speed_uncertainty_mps),
    })
}

fn height_row(position: &Vector3<f64>) -> Row<4> {
    let geodetic = Geodetic::from_ecef(position);
    let up = geodetic.enu_from_ecef().row(2).transpose();
    Row {
        gradient: Vector4::new(up.x, up.y, up.z, 0.0),
        residual: -geodetic.height_m,
        sigma: HEIGHT_SIGMA_M,
    }
}
