//! Innovations: what a filter did not expect of the measurements of an epoch.

use nalgebra::Vector4;

use super::covariance::Blocks;
use super::row::{Observable, Row};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::geodesy::Look;
use crate::measurement::{Measurement, MeasurementModel, Predicted};
use crate::{NavError, NavState, SatelliteId};

/// How far an epoch may lie from the filter's time, s: a millisecond of clock jump passes (and
/// shows as an innovation), an epoch that was not predicted to does not.
const EPOCH_TOLERANCE_S: f64 = 2e-3;

/// An innovation with its variances, in m and m^2 (pseudorange) or m/s and (m/s)^2 (range rate).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    row: Row,
    state_variance: f64,
}

impl Innovation {
    fn new(row: Row, covariance: &Blocks) -> Self {
        Self {
            row,
            state_variance: row.state_variance(covariance),
        }
    }

    /// Measured minus predicted.
    #[must_use]
    pub const fn value(&self) -> f64 {
        self.row.residual
    }

    /// Its variance s = h' P h + r, by the filter's covariance and the measurement's noise.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.state_variance + self.row.variance
    }

    /// Variance r of the measurement itself.
    #[must_use]
    pub const fn noise_variance(&self) -> f64 {
        self.row.variance
    }

    /// Value squared over variance: chi-square with one degree of freedom where all is well.
    #[must_use]
    pub fn normalised_squared(&self) -> f64 {
        self.row.residual * self.row.residual / self.variance()
    }

    /// The same measurement with its own variance times `factor`.
    pub(super) fn deweighted(mut self, factor: f64) -> Self {
        self.row.variance *= factor;
        self
    }

    pub(super) const fn row(&self) -> &Row {
        &self.row
    }
}

/// Innovations of one satellite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SatelliteInnovation {
    /// Which.
    pub satellite: SatelliteId,
    /// Of its pseudorange, m.
    pub code: Innovation,
    /// Of its range rate, m/s; `None` where none was measured (infinite variance).
    pub rate: Option<Innovation>,
    /// Where it stands in the sky of the predicted position.
    pub look: Look,
    /// The part of its pseudorange's variance that lasts from epoch to epoch: ephemeris and delays,
    /// m^2.
    pub lasting_variance_m2: f64,
}

/// Innovations of one epoch against the prediction of a filter; only that filter, in that state,
/// takes them.
#[derive(Debug, Clone, PartialEq)]
pub struct Innovations {
    pub(super) predicted: NavState,
    pub(super) satellites: Vec<SatelliteInnovation>,
}

impl Innovations {
    /// Those of `measurements` at `predicted` with its `covariance`.
    pub(super) fn new(
        measurements: &[Measurement],
        predicted: &NavState,
        covariance: &Blocks,
        model: &MeasurementModel,
    ) -> Result<Self, NavError> {
        let here = model.at(&predicted.position_ecef_m, predicted.time);
        let satellites = measurements
            .iter()
            .map(|m| innovation(m, predicted, &here.predict(&m.state), covariance, model))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            predicted: *predicted,
            satellites,
        })
    }

    /// Satellite by satellite, in the order of the measurements.
    #[must_use]
    pub fn satellites(&self) -> &[SatelliteInnovation] {
        &self.satellites
    }
}

fn innovation(
    measurement: &Measurement,
    predicted: &NavState,
    expected: &Predicted,
    covariance: &Blocks,
    model: &MeasurementModel,
) -> Result<SatelliteInnovation, NavError> {
    let late_s = measurement.receive_time - predicted.receiver_clock();
    if late_s.is_nan() || late_s.abs() > EPOCH_TOLERANCE_S {
        return Err(NavError::Value {
            name: "epoch of a measurement minus that of the filter, s",
            value: late_s.to_string(),
            expected: "no more than 2 ms either way: predict to the epoch first",
        });
    }
    let code = checked(
        code_row(measurement, predicted, expected, model),
        measurement,
    )?;
    let rate = if measurement.range_rate_variance_m2_s2.is_infinite() {
        None
    } else {
        Some(checked(
            rate_row(measurement, predicted, expected),
            measurement,
        )?)
    };
    Ok(SatelliteInnovation {
        satellite: measurement.satellite,
        code: Innovation::new(code, covariance),
        rate: rate.map(|row| Innovation::new(row, covariance)),
        look: expected.look,
        lasting_variance_m2: code.variance - measurement.pseudorange_variance_m2,
    })
}

/// Pseudorange minus prediction; derivative -e by position, 1 by clock bias.
///
/// Left out: the frame turns on while a longer range is travelled, 6e-6; the delays depend on the
/// position, 3e-4 over the sine of the elevation (the air thins with height): 2 cm at 10 degrees
/// for a height wrong by 10 m.
fn code_row(
    measurement: &Measurement,
    state: &NavState,
    expected: &Predicted,
    model: &MeasurementModel,
) -> Row {
    let e = expected.line_of_sight.unit_ecef;
    Row {
        observable: Observable::Pseudorange,
        gradient: Vector4::new(-e.x, -e.y, -e.z, 1.0),
        residual: measurement.pseudorange_m - expected.pseudorange_m - state.clock_bias_m,
        variance: model.variance_m2(
            measurement.pseudorange_variance_m2,
            measurement.user_range_accuracy_m,
            expected,
        ),
    }
}

/// Range rate minus prediction; derivative -e (scaled by the change of travel time, 3e-6) by
/// velocity, 1 by drift.
///
/// Left out: its derivative by position is the relative velocity across the line of sight over
/// the range, at most 4 km/s over 2e7 m = 2e-4 1/s: 2 mm/s for a position wrong by 10 m, a
/// thirtieth of the noise of 20 ms at 45 dB-Hz.
fn rate_row(measurement: &Measurement, state: &NavState, expected: &Predicted) -> Row {
    let path = expected.line_of_sight;
    let g = path.range_rate_gradient() + expected.delay_rate.by_velocity;
    let predicted_mps = path.range_rate_mps(&state.velocity_ecef_mps)
        + expected.delay_rate.mps(&state.velocity_ecef_mps)
        + state.clock_drift_mps
        - SPEED_OF_LIGHT_MPS * measurement.state.clock_drift;
    Row {
        observable: Observable::RangeRate,
        gradient: Vector4::new(g.x, g.y, g.z, 1.0),
        residual: measurement.range_rate_mps - predicted_mps,
        variance: measurement.range_rate_variance_m2_s2 + expected.delay_rate_variance_m2_s2,
    }
}

fn checked(row: Row, measurement: &Measurement) -> Result<Row, NavError> {
    let is_sound = row.residual.is_finite()
        && row.variance.is_finite()
        && row.variance > 0.0
        && row.gradient.iter().all(|g| g.is_finite());
    if is_sound {
        return Ok(row);
    }
    Err(NavError::Measurement {
        satellite: measurement.satellite,
        residual: row.residual,
        variance: row.variance,
    })
}
