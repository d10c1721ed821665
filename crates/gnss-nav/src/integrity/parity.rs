//! Parity space: the combinations of pseudoranges in which position and clock do not show.

use faer::Mat;
use nalgebra::{DMatrix, DVector};

use crate::geodesy::Look;
use crate::least_squares::Solution;

/// Unknowns of a position.
const UNKNOWNS: usize = 4;

/// Part of a variance below which a residual says nothing of its own satellite.
const UNCHECKED: f64 = 1e-6;

/// The parity of one epoch, whitened: without a fault a vector of independent unit normal values.
///
/// With the geometry A and standard deviations s, P spans the null space of (A / s)' (from the QR
/// factors), p = P' (y / s). A fault of size b in satellite i adds b / s_i times row i of P. Its
/// square |p|^2 is the chi-square of the residuals.
#[derive(Debug, Clone, PartialEq)]
pub struct Parity {
    /// One row a satellite, one column a degree of freedom.
    basis: DMatrix<f64>,
    vector: DVector<f64>,
}

impl Parity {
    /// The parity of a solution: residuals and the satellites' directions are all it takes. `None` without a redundant satellite.
    #[must_use]
    pub fn of(solution: &Solution) -> Option<Self> {
        let satellites = &solution.satellites;
        let freedom = satellites.len().checked_sub(UNKNOWNS).filter(|f| *f > 0)?;
        let geometry = Mat::from_fn(satellites.len(), UNKNOWNS, |i, j| {
            let satellite = &satellites[i];
            row(&satellite.look())[j] / satellite.pseudorange_sigma_m
        });
        let q = geometry.qr().compute_Q();
        let basis = DMatrix::from_fn(satellites.len(), freedom, |i, j| q[(i, UNKNOWNS + j)]);
        let whitened = satellites
            .iter()
            .map(|s| s.pseudorange_residual_m / s.pseudorange_sigma_m);
        let residuals = DVector::from_iterator(satellites.len(), whitened);
        Some(Self {
            vector: basis.transpose() * residuals,
            basis,
        })
    }

    /// Degrees of freedom.
    #[must_use]
    pub fn freedom(&self) -> usize {
        self.basis.ncols()
    }

    /// Satellites.
    #[must_use]
    pub fn satellites(&self) -> usize {
        self.basis.nrows()
    }

    /// |p|^2: chi-square where there is no fault.
    #[must_use]
    pub fn chi_square(&self) -> f64 {
        self.vector.norm_squared()
    }

    /// Share of the variance of a satellite, by its place, that is left in the residuals: 0 where
    /// no other checks it, 1 where the others fix the position alone.
    #[must_use]
    pub fn redundancy(&self, satellite: usize) -> Option<f64> {
        (satellite < self.satellites()).then(|| self.basis.row(satellite).norm_squared())
    }

    /// What is left of the chi-square without the satellites of `suspects` (by their place); `None`
    /// where the others leave their faults undetermined.
    ///
    /// |p|^2 - f' (F F')^-1 f with F the rows of the suspects and f = F p.
    #[must_use]
    pub fn without(&self, suspects: &[usize]) -> Option<f64> {
        if suspects.iter().any(|s| *s >= self.satellites()) {
            return None;
        }
        let rows = self.basis.select_rows(suspects);
        let products = &rows * &self.vector;
        let factors = (&rows * rows.transpose()).cholesky()?;
        let pivots = factors.l_dirty().diagonal();
        if pivots.iter().any(|pivot| pivot * pivot < UNCHECKED) {
            return None;
        }
        let explained = products.dot(&factors.solve(&products));
        Some((self.chi_square() - explained).max(0.0))
    }
}

/// Derivatives of a pseudorange by east, north, up and clock.
pub(super) fn row(look: &Look) -> [f64; UNKNOWNS] {
    let (sin_azimuth, cos_azimuth) = look.azimuth_rad.sin_cos();
    let (sin_elevation, cos_elevation) = look.elevation_rad.sin_cos();
    [
        -sin_azimuth * cos_elevation,
        -cos_azimuth * cos_elevation,
        -sin_elevation,
        1.0,
    ]
}
