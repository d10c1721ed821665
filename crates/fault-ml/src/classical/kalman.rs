//! A Kalman filter of four states that walk, fed one measurement at a time.

use std::f64::consts::PI;

use nalgebra::{Matrix4, Vector4};

use crate::error::within;
use crate::{MonitorError, STATES, Sight};

/// What a filter believes of the receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KalmanParameters {
    /// First standard deviation of every state, m. Default 3.
    pub initial_sigma_m: f64,
    /// Process noise of every state, m per square root of a second. Default 0.25.
    pub process_noise_m: f64,
}

impl Default for KalmanParameters {
    fn default() -> Self {
        Self {
            initial_sigma_m: 3.0,
            process_noise_m: 0.25,
        }
    }
}

impl KalmanParameters {
    /// These parameters, if possible.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where one is not.
    pub fn check(self) -> Result<Self, MonitorError> {
        let limits = (1e-3, 1e5);
        within(
            "initial deviation (m)",
            self.initial_sigma_m,
            limits,
            "0.001 to 1e5",
        )?;
        within(
            "process noise (m)",
            self.process_noise_m,
            limits,
            "0.001 to 1e5",
        )?;
        Ok(self)
    }
}

/// Innovation of one measurement, given those before it in the same epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ScalarInnovation {
    /// Measurement minus prediction, m.
    pub(super) value_m: f64,
    /// Its variance, m^2.
    pub(super) variance_m2: f64,
    /// What it moves the state by, per metre.
    pub(super) gain: Vector4<f64>,
}

impl ScalarInnovation {
    pub(super) fn log_density(&self) -> f64 {
        let square = self.value_m * self.value_m / self.variance_m2;
        -0.5 * (square + (2.0 * PI * self.variance_m2).ln())
    }
}

/// Estimate and covariance of the state about a reference point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KalmanFilter {
    state_m: Vector4<f64>,
    covariance_m2: Matrix4<f64>,
    process_m2: f64,
}

impl KalmanFilter {
    /// At the reference point.
    #[must_use]
    pub fn new(parameters: &KalmanParameters) -> Self {
        Self {
            state_m: Vector4::zeros(),
            covariance_m2: Matrix4::identity() * parameters.initial_sigma_m.powi(2),
            process_m2: parameters.process_noise_m.powi(2),
        }
    }

    /// State, m about the reference point.
    #[must_use]
    pub fn state_m(&self) -> [f64; STATES] {
        self.state_m.into()
    }

    pub(super) fn predict(&mut self, elapsed_s: f64) {
        self.covariance_m2 += Matrix4::identity() * (elapsed_s * self.process_m2);
    }

    pub(super) fn shift(&mut self, offset_m: &Vector4<f64>) {
        self.state_m += offset_m;
    }

    pub(super) fn loosen(&mut self, covariance_m2: &Matrix4<f64>) {
        self.covariance_m2 += covariance_m2;
    }

    /// Log density (1/m) of one more sight of this epoch, without taking it.
    pub(super) fn log_expectation(&self, sight: &Sight) -> f64 {
        let mut ahead = *self;
        ahead.update(sight).log_density()
    }

    /// Applies one measurement; by the chain rule its density times those of the measurements
    /// before it is the density of all of them together.
    pub(super) fn update(&mut self, sight: &Sight) -> ScalarInnovation {
        let design = Vector4::from(sight.design);
        let projected = self.covariance_m2 * design;
        let value_m = sight.residual_m - design.dot(&self.state_m);
        let variance_m2 = design.dot(&projected) + sight.sigma_m * sight.sigma_m;
        let gain = projected / variance_m2;
        self.state_m += gain * value_m;
        self.covariance_m2 -= gain * projected.transpose();
        ScalarInnovation {
            value_m,
            variance_m2,
            gain,
        }
    }

    /// Takes one epoch, a second after the last; returns ln p(measurements) and their normalised innovation squared.
    pub fn epoch<'a>(&mut self, sights: impl Iterator<Item = &'a Sight>) -> (f64, f64) {
        self.predict(1.0);
        sights.fold((0.0, 0.0), |(log, squares), sight| {
            let innovation = self.update(sight);
            let square = innovation.value_m * innovation.value_m / innovation.variance_m2;
            (log + innovation.log_density(), squares + square)
        })
    }

    /// ln p(measurements) of the next epoch, without taking it.
    pub fn expectation<'a>(&self, sights: impl Iterator<Item = &'a Sight>) -> f64 {
        let mut ahead = *self;
        ahead.epoch(sights).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_measurement_is_the_textbook_update() {
        let mut filter = KalmanFilter::new(&KalmanParameters {
            initial_sigma_m: 3.0,
            process_noise_m: 4.0,
        });
        let sight = Sight {
            id: 1,
            design: [1.0, 0.0, 0.0, 0.0],
            residual_m: 10.0,
            sigma_m: 5.0,
        };
        // Prior variance 9 + 16 = 25, innovation variance 50, gain one half.
        let (log, square) = filter.epoch([sight].iter());
        assert_eq!(filter.state_m(), [5.0, 0.0, 0.0, 0.0]);
        assert!((square - 2.0).abs() < 1e-12);
        assert!((log + 0.5 * (2.0 + (2.0 * PI * 50.0).ln())).abs() < 1e-12);
    }

    #[test]
    fn the_order_of_measurements_does_not_matter() {
        let sight = |a: f64, residual_m| Sight {
            id: 1,
            design: [a, 1.0 - a, 0.3 * a, 1.0],
            residual_m,
            sigma_m: 2.0,
        };
        let sights = [sight(0.2, 3.0), sight(-0.5, -4.0), sight(0.9, 1.0)];
        let start = KalmanFilter::new(&KalmanParameters::default());
        let (mut forward, mut backward) = (start, start);
        let (first, _) = forward.epoch(sights.iter());
        let (second, _) = backward.epoch(sights.iter().rev());
        // A density of all does not depend on their order; rounding of three updates.
        assert!((first - second).abs() < 1e-12);
        assert!((forward.state_m - backward.state_m).norm() < 1e-12);
    }
}
