//! The Gaussian fitness of a whole epoch as one quadratic form of the state.

use std::f64::consts::PI;

use nalgebra::{Matrix4, Vector4};

use crate::{STATES, Sight};

/// f(x) = constant + linear . x - x' matrix x / 2.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quadratic {
    pub(super) matrix: Matrix4<f64>,
    pub(super) linear: Vector4<f64>,
    pub(super) constant: f64,
}

impl Quadratic {
    /// -sum (y - h x)^2 / (2 sigma^2) over `sights`, Wang2016 (5) in logarithms.
    pub(super) fn fitness<'a>(sights: impl Iterator<Item = &'a Sight>) -> Self {
        let mut sum = Self {
            matrix: Matrix4::zeros(),
            linear: Vector4::zeros(),
            constant: 0.0,
        };
        for sight in sights {
            let design = Vector4::from(sight.design);
            let information = 1.0 / (sight.sigma_m * sight.sigma_m);
            sum.matrix += design * design.transpose() * information;
            sum.linear += design * (sight.residual_m * information);
            sum.constant -= 0.5 * information * sight.residual_m * sight.residual_m;
        }
        sum
    }

    /// ln prod N(y; h x, sigma^2) over `sights`: the fitness with the constants of the densities.
    pub(super) fn log_likelihood<'a>(sights: impl Iterator<Item = &'a Sight> + Clone) -> Self {
        let mut form = Self::fitness(sights.clone());
        let log_peak = |sight: &Sight| (sight.sigma_m * (2.0 * PI).sqrt()).ln();
        form.constant -= sights.map(log_peak).sum::<f64>();
        form
    }

    /// Adds another form.
    pub(super) fn add(&mut self, other: &Self) {
        self.matrix += other.matrix;
        self.linear += other.linear;
        self.constant += other.constant;
    }

    /// Writes the value at every particle of `state` into `values`: ten products a particle,
    /// however many satellites there are.
    pub(super) fn evaluate(&self, state: &[Vec<f64>; STATES], values: &mut [f64]) {
        let m = &self.matrix;
        let [l0, l1, l2, l3] = [0, 1, 2, 3].map(|d| self.linear[d]);
        let [h00, h11, h22, h33] = [0, 1, 2, 3].map(|d| 0.5 * m[(d, d)]);
        let (m01, m02, m03) = (m[(0, 1)], m[(0, 2)], m[(0, 3)]);
        let (m12, m13, m23) = (m[(1, 2)], m[(1, 3)], m[(2, 3)]);
        let [x, y, z, b] = state;
        let coordinates = x.iter().zip(y).zip(z).zip(b);
        for (value, (((x, y), z), b)) in values.iter_mut().zip(coordinates) {
            let in_x = x * (l0 - h00 * x - m01 * y - m02 * z - m03 * b);
            let in_y = y * (l1 - h11 * y - m12 * z - m13 * b);
            let in_z = z * (l2 - h22 * z - m23 * b);
            *value = self.constant + in_x + in_y + in_z + b * (l3 - h33 * b);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_form_is_the_sum_over_satellites(
            rows in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, -30.0..30.0f64), 1..12),
            at in prop::array::uniform4(-20.0..20.0f64),
        ) {
            let sights: Vec<Sight> = rows.iter().map(|(a, b, c, y)| Sight {
                id: 0, design: [*a, *b, *c, 1.0], residual_m: *y, sigma_m: 3.0,
            }).collect();
            let plain: f64 = sights.iter().map(|s| -s.residual_about(&at).powi(2) / 18.0).sum();
            let mut value = [0.0];
            Quadratic::fitness(sights.iter()).evaluate(&at.map(|x| vec![x]), &mut value);
            // Terms of up to 12 * 80^2 / 18 = 4e3 in double precision: 1e-12 of that at most.
            prop_assert!((value[0] - plain).abs() < 1e-8, "{} {}", value[0], plain);
        }
    }
}
