//! The update of Jiang2017, all measurements at once, in Joseph's form.

use nalgebra::{DVector, Dyn, OMatrix, U8};

use super::correction::{Correct, Corrected};
use super::covariance::{Covariance, ErrorState};
use super::row::Row;
use crate::NavError;

/// Measurements by states.
type Design = OMatrix<f64, Dyn, U8>;

/// All measurements of an epoch at once.
///
/// S = H P H' + R, K = P H' S^-1 by Cholesky's factors of S (equation (15) without its inverse),
/// x = K y, P = (I - K H) P (I - K H)' + K R K', which stays positive for any gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Batch;

impl Correct for Batch {
    fn correct(
        covariance: &Covariance,
        rows: impl Iterator<Item = Row>,
    ) -> Result<Corrected, NavError> {
        let rows: Vec<Row> = rows.collect();
        if rows.is_empty() {
            return Ok(Corrected::prior(covariance));
        }
        let h = Design::from_rows(
            &rows
                .iter()
                .map(|r| r.dense().transpose())
                .collect::<Vec<_>>(),
        );
        let y = DVector::from_iterator(rows.len(), rows.iter().map(|r| r.residual));
        let hp = &h * covariance;
        let mut s = &hp * h.transpose();
        for (i, row) in rows.iter().enumerate() {
            s[(i, i)] += row.variance;
        }
        if !s.iter().all(|x| x.is_finite()) {
            return Err(NavError::Singular);
        }
        let s = s.cholesky().ok_or(NavError::Singular)?;
        // S K' = H P: S and P are symmetric.
        let gain: Design = s.solve(&hp);
        let error: ErrorState = gain.tr_mul(&y);
        Ok(Corrected {
            error,
            covariance: joseph(covariance, &h, &gain, &rows),
            normalised_squared: y.dot(&s.solve(&y)),
            count: rows.len(),
        })
    }
}

/// (I - K H) P (I - K H)' + K R K', `gain` being K'.
fn joseph(covariance: &Covariance, h: &Design, gain: &Design, rows: &[Row]) -> Covariance {
    let keep = Covariance::identity() - gain.tr_mul(h);
    let mut scaled = gain.clone();
    for (mut k, row) in scaled.row_iter_mut().zip(rows) {
        k *= row.variance;
    }
    let noise: Covariance = scaled.tr_mul(gain);
    let p = keep * covariance * keep.transpose() + noise;
    (p + p.transpose()) * 0.5
}
