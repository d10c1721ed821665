//! Weighted linear least squares by QR.

use faer::Mat;
use faer::linalg::solvers::SolveLstsqCore;
use nalgebra::{SMatrix, SVector};

use crate::NavError;

/// A pivot of R this much smaller than the largest makes the geometry singular.
const SINGULAR: f64 = 1e-9;

/// One equation `gradient . x = residual` with its standard deviation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<const N: usize> {
    pub(crate) gradient: SVector<f64, N>,
    pub(crate) residual: f64,
    pub(crate) sigma: f64,
}

/// Solution of a linear system.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linear<const N: usize> {
    pub(crate) x: SVector<f64, N>,
    pub(crate) covariance: SMatrix<f64, N, N>,
}

/// Minimises the sum of ((gradient . x - residual) / sigma)^2.
///
/// QR of the whitened equations, not the normal equations, so that the condition is not squared.
pub(crate) fn solve<const N: usize>(rows: &[Row<N>]) -> Result<Linear<N>, NavError> {
    if rows.len() < N {
        return Err(NavError::TooFew {
            found: rows.len(),
            needed: N,
        });
    }
    let a = Mat::from_fn(rows.len(), N, |i, j| rows[i].gradient[j] / rows[i].sigma);
    let mut b = Mat::from_fn(rows.len(), 1, |i, _| rows[i].residual / rows[i].sigma);
    if !(0..rows.len()).all(|i| b[(i, 0)].is_finite() && (0..N).all(|j| a[(i, j)].is_finite())) {
        return Err(NavError::Singular);
    }
    // Columns to unit length: states in metres and seconds then share one measure of singularity.
    let scale = SVector::<f64, N>::from_fn(|j, _| column_norm(&a, j));
    if scale.iter().any(|&s| s <= 0.0 || !s.is_finite()) {
        return Err(NavError::Singular);
    }
    let qr = Mat::from_fn(rows.len(), N, |i, j| a[(i, j)] / scale[j]).qr();
    let r = SMatrix::<f64, N, N>::from_fn(|i, j| if i <= j { qr.R()[(i, j)] } else { 0.0 });
    let inverse = invert_upper(&r).ok_or(NavError::Singular)?;
    qr.solve_lstsq_in_place_with_conj(faer::Conj::No, b.as_mut());
    let inverse = SMatrix::<f64, N, N>::from_fn(|i, j| inverse[(i, j)] / scale[i]);
    Ok(Linear {
        x: SVector::from_fn(|j, _| b[(j, 0)] / scale[j]),
        covariance: inverse * inverse.transpose(),
    })
}

fn column_norm(a: &Mat<f64>, j: usize) -> f64 {
    (0..a.nrows())
        .map(|i| a[(i, j)].powi(2))
        .sum::<f64>()
        .sqrt()
}

fn invert_upper<const N: usize>(r: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    let pivot = |i: usize| r[(i, i)].abs();
    let largest = (0..N).map(pivot).fold(0.0, f64::max);
    if (0..N).any(|i| pivot(i) <= SINGULAR * largest) {
        return None;
    }
    let mut inverse = SMatrix::<f64, N, N>::identity();
    r.solve_upper_triangular_mut(&mut inverse)
        .then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    fn row(x: f64, y: f64, sigma: f64) -> Row<2> {
        Row {
            gradient: Vector2::new(1.0, x),
            residual: y,
            sigma,
        }
    }

    #[test]
    fn weighted_line_agrees_with_the_normal_equations() {
        let rows = [row(0.0, 1.0, 1.0), row(1.0, 3.5, 0.5), row(2.0, 4.0, 2.0)];
        let normal = rows.iter().fold(Matrix2::zeros(), |n, r| {
            n + r.gradient * r.gradient.transpose() / r.sigma.powi(2)
        });
        let right = rows.iter().fold(Vector2::zeros(), |n, r| {
            n + r.gradient * r.residual / r.sigma.powi(2)
        });
        let covariance = normal.try_inverse().unwrap();
        let linear = solve(&rows).unwrap();
        // Both are exact to rounding for a 2 by 2 system of condition below 10.
        assert!((linear.x - covariance * right).norm() < 1e-13);
        assert!((linear.covariance - covariance).norm() < 1e-13);
    }

    #[test]
    fn degenerate_systems_are_errors() {
        let same = [row(1.0, 1.0, 1.0); 3];
        assert_eq!(solve(&same).unwrap_err(), NavError::Singular);
        let few = [row(1.0, 1.0, 1.0)];
        assert!(matches!(solve(&few), Err(NavError::TooFew { .. })));
        let nan = [row(f64::NAN, 1.0, 1.0), row(0.0, 1.0, 1.0)];
        assert_eq!(solve(&nan).unwrap_err(), NavError::Singular);
    }
}
