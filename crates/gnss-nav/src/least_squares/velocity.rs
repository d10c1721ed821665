//! Velocity and clock drift from range rates.

use nalgebra::{Vector3, Vector4};

use super::Velocity;
use crate::NavError;
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::delay_rate::DelayRate;
use crate::line_of_sight::LineOfSight;
use crate::linear::{self, Row};
use crate::measurement::{Measurement, Predicted};

/// One range rate as an equation for velocity and drift.
///
/// The product of range rate and drift (1 mm/s for each ppm of the receiver's oscillator) is
/// neglected.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RateEquation {
    row: Row<4>,
}

impl RateEquation {
    pub(super) fn new(measurement: &Measurement, predicted: &Predicted) -> Self {
        Self::from_parts(
            &predicted.line_of_sight,
            &predicted.delay_rate,
            measurement.state.clock_drift,
            measurement.range_rate_mps,
            measurement.range_rate_variance_m2_s2 + predicted.delay_rate_variance_m2_s2,
        )
    }

    pub(crate) fn from_parts(
        line_of_sight: &LineOfSight,
        delay_rate: &DelayRate,
        satellite_clock_drift: f64,
        range_rate_mps: f64,
        variance_m2_s2: f64,
    ) -> Self {
        let gradient = line_of_sight.range_rate_gradient() + delay_rate.by_velocity;
        let at_rest_mps = line_of_sight.range_rate_mps(&Vector3::zeros()) + delay_rate.at_rest_mps
            - SPEED_OF_LIGHT_MPS * satellite_clock_drift;
        Self {
            row: Row {
                gradient: Vector4::new(gradient.x, gradient.y, gradient.z, 1.0),
                residual: range_rate_mps - at_rest_mps,
                sigma: variance_m2_s2.sqrt(),
            },
        }
    }

    fn is_usable(&self) -> bool {
        self.row.residual.is_finite() && self.row.sigma.is_finite() && self.row.sigma > 0.0
    }

    /// Measured minus predicted, m/s; `None` where there is no usable measurement.
    pub(crate) fn residual_mps(&self, velocity: &Velocity) -> Option<f64> {
        let v = velocity.velocity_ecef_mps;
        let x = Vector4::new(v.x, v.y, v.z, velocity.clock_drift_mps);
        self.is_usable()
            .then(|| self.row.residual - self.row.gradient.dot(&x))
    }
}

/// Velocity and drift from the usable ones of `equations`.
pub(crate) fn solve_velocity(equations: &[RateEquation]) -> Result<Velocity, NavError> {
    let rows: Vec<Row<4>> = equations
        .iter()
        .filter(|equation| equation.is_usable())
        .map(|equation| equation.row)
        .collect();
    let linear = linear::solve(&rows)?;
    Ok(Velocity {
        velocity_ecef_mps: linear.x.xyz(),
        clock_drift_mps: linear.x.w,
        covariance_m2_s2: linear.covariance,
    })
}
