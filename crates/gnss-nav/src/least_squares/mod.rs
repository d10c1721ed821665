//! Position, velocity and time of one epoch by weighted least squares.

mod dops;
mod position;
mod velocity;

use nalgebra::{Matrix4, Vector3};

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::geodesy::Look;
use crate::measurement::{Measurement, MeasurementModel, Predicted};
use crate::{GpsTime, NavError, SatelliteId};

pub use dops::Dops;
pub(crate) use velocity::{RateEquation, solve_velocity};

/// Unknowns of the position: three coordinates and the clock.
const UNKNOWNS: usize = 4;

/// What one epoch of measurements gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The epoch by the receiver's clock.
    pub receive_time: GpsTime,
    /// Receiver in ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// Receiver's clock minus GPS time, m.
    pub clock_bias_m: f64,
    /// Covariance of x, y, z (ECEF) and the clock bias, m^2.
    pub covariance_m2: Matrix4<f64>,
    /// Velocity and drift; `None` with fewer than four range rates.
    pub velocity: Option<Velocity>,
    /// Dilution of precision of the satellites used.
    pub dops: Dops,
    /// The satellites used, in the order of the measurements.
    pub satellites: Vec<UsedSatellite>,
    /// Satellites below the elevation mask.
    pub masked: Vec<SatelliteId>,
    /// Satellites taken out by [`integrity::solve`](crate::integrity::solve).
    pub excluded: Vec<SatelliteId>,
    /// Sum of the squared pseudorange residuals over their variances.
    pub chi_square: f64,
    /// Whether the residuals agree with their variances.
    pub consistency: Consistency,
}

/// Velocity and clock drift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Velocity {
    /// In ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
    /// Drift of the receiver's clock, m/s.
    pub clock_drift_mps: f64,
    /// Covariance of the velocity (ECEF) and the drift, (m/s)^2.
    pub covariance_m2_s2: Matrix4<f64>,
}

/// A satellite of a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UsedSatellite {
    /// Which.
    pub satellite: SatelliteId,
    /// Azimuth, rad, from north over east.
    pub azimuth_rad: f64,
    /// Elevation, rad.
    pub elevation_rad: f64,
    /// Measured minus predicted pseudorange, m.
    pub pseudorange_residual_m: f64,
    /// Standard deviation given to the pseudorange, m.
    pub pseudorange_sigma_m: f64,
    /// Measured minus predicted range rate, m/s; `None` where it was not used.
    pub range_rate_residual_mps: Option<f64>,
}

impl UsedSatellite {
    /// Where it stands.
    #[must_use]
    pub const fn look(&self) -> Look {
        Look {
            azimuth_rad: self.azimuth_rad,
            elevation_rad: self.elevation_rad,
        }
    }
}

/// Outcome of the residual test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Consistency {
    /// No test was made: [`solve`], or no redundant satellite.
    Untested,
    /// The residuals agree with their variances.
    Passed,
    /// They do not, and no exclusion cured it.
    Failed,
}

impl Solution {
    /// GPS time of the epoch: the receiver's clock corrected by its bias.
    #[must_use]
    pub fn gps_time(&self) -> GpsTime {
        self.receive_time - self.clock_bias_m / SPEED_OF_LIGHT_MPS
    }

    /// Pseudoranges beyond the four unknowns.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.satellites.len().saturating_sub(UNKNOWNS)
    }

    /// Chi-square over degrees of freedom; `None` without redundancy.
    #[must_use]
    pub fn reduced_chi_square(&self) -> Option<f64> {
        let freedom = self.degrees_of_freedom();
        (freedom > 0).then(|| self.chi_square / freedom as f64)
    }
}

/// Solves one epoch from any start, the centre of the earth included.
///
/// Gauss-Newton on the pseudoranges, first with geometry alone, then with the delays, variances
/// and elevation mask of `model`; then the range rates, which are linear in velocity and drift.
/// A start from which the iteration fails is replaced by the centre of the earth.
///
/// # Errors
/// [`NavError::TooFew`] with fewer than four satellites above the mask, [`NavError::Singular`],
/// [`NavError::NoConvergence`].
pub fn solve(
    measurements: &[Measurement],
    model: &MeasurementModel,
    start_ecef_m: &Vector3<f64>,
) -> Result<Solution, NavError> {
    let coarse = position::coarse(&measurements.iter().collect::<Vec<_>>(), start_ecef_m)?;
    solve_near(measurements, model, &coarse.position_ecef_m)
}

/// As [`solve`], with the elevation mask laid at `place_ecef_m`, where [`by_geometry`] has found the receiver.
///
/// # Errors
/// As [`solve`].
pub(crate) fn solve_near(
    measurements: &[Measurement],
    model: &MeasurementModel,
    place_ecef_m: &Vector3<f64>,
) -> Result<Solution, NavError> {
    let (used, masked): (Vec<&Measurement>, Vec<&Measurement>) =
        measurements.iter().partition(|m| {
            let predicted = model.predict(&m.state, place_ecef_m, m.receive_time);
            predicted.look.elevation_rad >= model.elevation_mask_rad
        });
    let fix = position::iterate(&used, model, place_ecef_m)?;
    let rates: Vec<RateEquation> = used
        .iter()
        .zip(&fix.predicted)
        .map(|(m, p)| RateEquation::new(m, p))
        .collect();
    let velocity = solve_velocity(&rates).ok();
    let satellites = used_satellites(&used, model, &fix, &rates, velocity.as_ref());
    Ok(Solution {
        receive_time: used
            .first()
            .map_or(GpsTime::new(0, 0.0), |m| m.receive_time),
        position_ecef_m: fix.position_ecef_m,
        clock_bias_m: fix.clock_bias_m,
        covariance_m2: fix.covariance_m2,
        velocity,
        dops: Dops::new(&fix.position_ecef_m, &fix.predicted)?,
        chi_square: satellites
            .iter()
            .map(|s| (s.pseudorange_residual_m / s.pseudorange_sigma_m).powi(2))
            .sum(),
        satellites,
        masked: masked.iter().map(|m| m.satellite).collect(),
        excluded: Vec::new(),
        consistency: Consistency::Untested,
    })
}

/// Position (ECEF, m) from geometry alone, whatever the elevations, and the residual of every measurement, m.
///
/// # Errors
/// As [`solve`].
pub(crate) fn by_geometry(
    measurements: &[&Measurement],
    start_ecef_m: &Vector3<f64>,
) -> Result<(Vector3<f64>, Vec<f64>), NavError> {
    let fix = position::coarse(measurements, start_ecef_m)?;
    let pairs = measurements.iter().zip(&fix.predicted);
    let residuals_m = pairs.map(|(m, p)| m.pseudorange_m - p.pseudorange_m - fix.clock_bias_m);
    Ok((fix.position_ecef_m, residuals_m.collect()))
}

fn used_satellites(
    used: &[&Measurement],
    model: &MeasurementModel,
    fix: &position::Fix,
    rates: &[RateEquation],
    velocity: Option<&Velocity>,
) -> Vec<UsedSatellite> {
    used.iter()
        .zip(fix.predicted.iter().zip(rates))
        .map(|(m, (p, rate))| UsedSatellite {
            satellite: m.satellite,
            azimuth_rad: p.look.azimuth_rad,
            elevation_rad: p.look.elevation_rad,
            pseudorange_residual_m: m.pseudorange_m - p.pseudorange_m - fix.clock_bias_m,
            pseudorange_sigma_m: sigma_m(m, model, p),
            range_rate_residual_mps: velocity.and_then(|v| rate.residual_mps(v)),
        })
        .collect()
}

fn sigma_m(measurement: &Measurement, model: &MeasurementModel, predicted: &Predicted) -> f64 {
    model
        .variance_m2(
            measurement.pseudorange_variance_m2,
            measurement.user_range_accuracy_m,
            predicted,
        )
        .sqrt()
}

#[cfg(test)]
mod tests;
