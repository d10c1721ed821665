//! The textbook in dense matrices: slow, and obviously what is meant.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::super::row::Row;
use super::{Covariance, States};
use crate::Geodetic;
use crate::dynamics::ProcessNoise;

/// F of Jiang2017 (10).
fn transition(interval_s: f64) -> Covariance {
    let mut f = Covariance::identity();
    for i in 0..4 {
        f[(2 * i, 2 * i + 1)] = interval_s;
    }
    f
}

/// Q of acceleration in the local frame of `position_ecef_m` and a two-state clock.
pub(super) fn noise(
    interval_s: f64,
    noise: &ProcessNoise,
    position_ecef_m: &Vector3<f64>,
) -> Covariance {
    let t = interval_s;
    let (horizontal, vertical) = (
        noise.acceleration.horizontal_m2_per_s3,
        noise.acceleration.vertical_m2_per_s3,
    );
    let enu = Geodetic::from_ecef(position_ecef_m).enu_from_ecef();
    let local = Vector3::new(horizontal, horizontal, vertical);
    let acceleration = enu.transpose() * Matrix3::from_diagonal(&local) * enu;
    let mut density = acceleration.to_homogeneous();
    density[(3, 3)] = noise.clock.random_walk_m2_per_s3;
    let mut q = Covariance::from_fn(|i, j| {
        let integral = match (i % 2, j % 2) {
            (0, 0) => t.powi(3) / 3.0,
            (1, 1) => t,
            _ => t.powi(2) / 2.0,
        };
        density[(i / 2, j / 2)] * integral
    });
    q[(6, 6)] += noise.clock.white_m2_per_s * t;
    q
}

/// F P F' + Q.
pub(super) fn predict(
    p: &Covariance,
    interval_s: f64,
    process: &ProcessNoise,
    position_ecef_m: &Vector3<f64>,
) -> Covariance {
    let f = transition(interval_s);
    f * p * f.transpose() + noise(interval_s, process, position_ecef_m)
}

/// F x.
pub(super) fn carry(x: &States, interval_s: f64) -> States {
    transition(interval_s) * x
}

/// Equations (14), (15), (17) of Jiang2017, with a general inverse and Joseph's form.
pub(super) fn update(
    p: &Covariance,
    h: &DMatrix<f64>,
    y: &DVector<f64>,
    r: &DVector<f64>,
) -> (States, Covariance) {
    let p = DMatrix::from_column_slice(8, 8, p.as_slice());
    let r = DMatrix::from_diagonal(r);
    let s = h * &p * h.transpose() + &r;
    let k = &p * h.transpose() * s.try_inverse().unwrap();
    let keep = DMatrix::identity(8, 8) - &k * h;
    let after = &keep * &p * keep.transpose() + &k * &r * k.transpose();
    (
        States::from_column_slice((&k * y).as_slice()),
        Covariance::from_column_slice(after.as_slice()),
    )
}

/// The same from rows.
pub(super) fn update_rows(p: &Covariance, rows: &[Row]) -> (States, Covariance) {
    let h = DMatrix::from_fn(rows.len(), 8, |i, j| rows[i].element(j));
    let y = DVector::from_fn(rows.len(), |i, _| rows[i].residual);
    let r = DVector::from_fn(rows.len(), |i, _| rows[i].variance);
    update(p, &h, &y, &r)
}
