//! The update of Jiang2017, all measurements at once, in Joseph's form.

use faer::linalg::solvers::SolveCore;
use faer::{Conj, Mat, Side};
use nalgebra::SVector;

use super::correction::{Correct, Corrected};
use super::covariance::{Blocks, Covariance, ErrorState, STATES};
use super::row::Row;
use crate::NavError;

/// All measurements of an epoch at once.
///
/// S = H P H' + R, K = P H' S^-1 by Cholesky's factors of S (equation (15) without its inverse),
/// x = K y, P = (I - K H) P (I - K H)' + K R K', which stays positive for any gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Batch;

impl Correct for Batch {
    fn correct(
        covariance: &Blocks,
        rows: impl Iterator<Item = Row>,
    ) -> Result<Corrected, NavError> {
        let rows: Vec<Row> = rows.collect();
        if rows.is_empty() {
            return Ok(Corrected::prior(covariance));
        }
        let p = covariance.interleaved();
        let h = Mat::from_fn(rows.len(), STATES, |i, j| rows[i].element(j));
        let hp = &h * Mat::from_fn(STATES, STATES, |i, j| p[(i, j)]);
        let solved = divide_by_innovation_covariance(&h, &hp, &rows)?;
        let gain = solved.subcols(0, STATES);
        let residual = |i: usize| rows[i].residual;
        let x = SVector::<f64, STATES>::from_fn(|j, _| {
            (0..rows.len()).map(|i| gain[(i, j)] * residual(i)).sum()
        });
        let kh = gain.transpose() * &h;
        let noisy = Mat::from_fn(rows.len(), STATES, |i, j| gain[(i, j)] * rows[i].variance);
        let krk = noisy.transpose() * gain;
        let keep = Covariance::identity() - Covariance::from_fn(|i, j| kh[(i, j)]);
        let after = keep * p * keep.transpose() + Covariance::from_fn(|i, j| krk[(i, j)]);
        Ok(Corrected {
            error: ErrorState::from_interleaved(&x),
            covariance: Blocks::from_interleaved(&((after + after.transpose()) * 0.5)),
            normalised_squared: (0..rows.len())
                .map(|i| residual(i) * solved[(i, STATES)])
                .sum(),
            count: rows.len(),
        })
    }
}

/// S^-1 [H P | y], S = H P H' + R: the gain, transposed, and the normalised innovations.
fn divide_by_innovation_covariance(
    h: &Mat<f64>,
    hp: &Mat<f64>,
    rows: &[Row],
) -> Result<Mat<f64>, NavError> {
    let mut s = hp * h.transpose();
    for (i, row) in rows.iter().enumerate() {
        s[(i, i)] += row.variance;
    }
    let s = s.llt(Side::Lower).map_err(|_| NavError::Singular)?;
    let mut solved = Mat::from_fn(rows.len(), STATES + 1, |i, j| {
        if j < STATES {
            hp[(i, j)]
        } else {
            rows[i].residual
        }
    });
    s.solve_in_place_with_conj(Conj::No, solved.as_mut());
    Ok(solved)
}
