//! Covariance of the eight states, and how it grows from epoch to epoch.

use nalgebra::{Matrix4, SMatrix, SVector, Vector3, Vector4};

use crate::dynamics::ProcessNoise;

/// Error states, in the order of Jiang2017 (10):
/// x, vx, y, vy, z, vz (ECEF), clock bias, clock drift; m and m/s.
pub const STATES: usize = 8;

/// Covariance of the error states, m^2, m^2/s and m^2/s^2.
pub type Covariance = SMatrix<f64, STATES, STATES>;

/// The error states, sorted into those that are offsets and their rates: every measurement depends
/// on one half alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ErrorState {
    /// Position (ECEF) and clock bias, m.
    pub(super) offset: Vector4<f64>,
    /// Velocity (ECEF) and clock drift, m/s.
    pub(super) rate: Vector4<f64>,
}

impl ErrorState {
    pub(super) fn zeros() -> Self {
        Self {
            offset: Vector4::zeros(),
            rate: Vector4::zeros(),
        }
    }

    /// From states in the order of the papers.
    pub(super) fn from_interleaved(states: &SVector<f64, STATES>) -> Self {
        Self {
            offset: Vector4::from_fn(|i, _| states[2 * i]),
            rate: Vector4::from_fn(|i, _| states[2 * i + 1]),
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.offset.iter().chain(&self.rate).all(|x| x.is_finite())
    }
}

/// A covariance sorted like [`ErrorState`]: a quarter of it, being the mirror image of another, is
/// not kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blocks {
    /// Of the offsets.
    pub(super) offset: Matrix4<f64>,
    /// Of rates (rows) with offsets (columns).
    pub(super) cross: Matrix4<f64>,
    /// Of the rates.
    pub(super) rate: Matrix4<f64>,
}

impl Blocks {
    /// From a symmetric matrix in the order of the papers.
    pub(super) fn from_interleaved(p: &Covariance) -> Self {
        Self {
            offset: Matrix4::from_fn(|i, j| p[(2 * i, 2 * j)]),
            cross: Matrix4::from_fn(|i, j| p[(2 * i + 1, 2 * j)]),
            rate: Matrix4::from_fn(|i, j| p[(2 * i + 1, 2 * j + 1)]),
        }
    }

    /// In the order of the papers.
    pub(super) fn interleaved(&self) -> Covariance {
        Covariance::from_fn(|i, j| match (i % 2, j % 2) {
            (0, 0) => self.offset[(i / 2, j / 2)],
            (0, _) => self.cross[(j / 2, i / 2)],
            (_, 0) => self.cross[(i / 2, j / 2)],
            _ => self.rate[(i / 2, j / 2)],
        })
    }

    /// P of `interval_s` later: F P F' + Q, F = four blocks [[1 T], [0 1]] (Jiang2017 (10), (16)),
    /// without the products with the ones and zeros of F.
    pub(super) fn propagated(
        &self,
        interval_s: f64,
        noise: &ProcessNoise,
        position_ecef_m: &Vector3<f64>,
    ) -> Self {
        let t = interval_s;
        let mixed = self.cross + self.cross.transpose();
        let density = density(noise, position_ecef_m);
        let mut offset =
            self.offset + mixed * t + self.rate * (t * t) + density * (t * t * t / 3.0);
        offset[(3, 3)] += noise.clock.white_m2_per_s * t;
        Self {
            offset,
            cross: self.cross + self.rate * t + density * (t * t / 2.0),
            rate: self.rate + density * t,
        }
    }

    /// Whether every variance is finite and not negative.
    pub(super) fn has_variances(&self) -> bool {
        let is_sound = |v: f64| v.is_finite() && v >= 0.0;
        (0..4).all(|i| is_sound(self.offset[(i, i)]) && is_sound(self.rate[(i, i)]))
    }
}

/// Density of the noise that drives velocity and drift.
fn density(noise: &ProcessNoise, position_ecef_m: &Vector3<f64>) -> Matrix4<f64> {
    let acceleration = noise.acceleration.density_ecef(position_ecef_m);
    let mut density = Matrix4::zeros();
    density
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&acceleration);
    density[(3, 3)] = noise.clock.random_walk_m2_per_s3;
    density
}
