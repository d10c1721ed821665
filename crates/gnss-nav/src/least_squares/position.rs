//! Gauss-Newton on pseudoranges.

use nalgebra::{Matrix4, Vector3, Vector4};

use super::sigma_m;
use crate::NavError;
use crate::linear::{self, Row};
use crate::measurement::{Measurement, MeasurementModel, Predicted};

/// From the centre of the earth five or six steps suffice.
const ITERATIONS: usize = 20;

/// The iteration stops below this step, m: the next one would be below its square over the range.
const STEP_M: f64 = 1e-4;

/// A converged position.
pub(super) struct Fix {
    pub(super) position_ecef_m: Vector3<f64>,
    pub(super) clock_bias_m: f64,
    pub(super) covariance_m2: Matrix4<f64>,
    /// Predictions at the position, in the order of the measurements.
    pub(super) predicted: Vec<Predicted>,
}

/// Position from geometry alone, from `start` or else from the centre of the earth.
pub(super) fn coarse(measurements: &[&Measurement], start: &Vector3<f64>) -> Result<Fix, NavError> {
    let geometry = MeasurementModel::geometry_only();
    match iterate(measurements, &geometry, start) {
        Err(NavError::NoConvergence { .. } | NavError::Singular) => {
            iterate(measurements, &geometry, &Vector3::zeros())
        }
        other => other,
    }
}

/// Iterates from `start` until the step vanishes.
pub(super) fn iterate(
    measurements: &[&Measurement],
    model: &MeasurementModel,
    start: &Vector3<f64>,
) -> Result<Fix, NavError> {
    let mut position = *start;
    let mut clock_m = 0.0;
    for _ in 0..ITERATIONS {
        let predicted: Vec<Predicted> = measurements
            .iter()
            .map(|m| model.predict(&m.state, &position, m.receive_time))
            .collect();
        let rows: Vec<Row<4>> = measurements
            .iter()
            .zip(&predicted)
            .map(|(m, p)| row(m, model, p, clock_m))
            .collect();
        let step = linear::solve(&rows)?;
        position += step.x.xyz();
        clock_m += step.x.w;
        if step.x.norm() < STEP_M {
            return Ok(Fix {
                position_ecef_m: position,
                clock_bias_m: clock_m,
                covariance_m2: step.covariance,
                predicted,
            });
        }
    }
    Err(NavError::NoConvergence {
        iterations: ITERATIONS,
    })
}

fn row(
    measurement: &Measurement,
    model: &MeasurementModel,
    predicted: &Predicted,
    clock_m: f64,
) -> Row<4> {
    let e = predicted.line_of_sight.unit_ecef;
    Row {
        gradient: Vector4::new(-e.x, -e.y, -e.z, 1.0),
        residual: measurement.pseudorange_m - predicted.pseudorange_m - clock_m,
        sigma: sigma_m(measurement, model, predicted),
    }
}
