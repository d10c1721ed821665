//! The update of Li2019: one scalar measurement after the other, without an inverse.

use super::correction::{Correct, Corrected};
use super::covariance::{Covariance, STATES};
use super::row::{Observable, Row};
use crate::NavError;

/// Scalar updates in the order of the measurements.
///
/// s = h' P h + r, k = P h / s, x += k (y - h' x), P -= k h' P. Noises of different measurements
/// are independent, so that the result does not depend on the order. Nothing is allocated. The
/// four zeros of every row are skipped, P h reads columns (which are rows, P being symmetric), and
/// P - w w' with w = P h / sqrt(s) keeps P symmetric to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sequential;

impl Correct for Sequential {
    #[inline]
    fn correct(
        covariance: &Covariance,
        rows: impl Iterator<Item = Row>,
    ) -> Result<Corrected, NavError> {
        let mut corrected = Corrected::prior(covariance);
        for row in rows {
            match row.observable {
                Observable::Pseudorange => absorb::<0>(&mut corrected, &row)?,
                Observable::RangeRate => absorb::<1>(&mut corrected, &row)?,
            }
        }
        Ok(corrected)
    }
}

/// Takes in one row whose first state is `FIRST`.
#[inline]
fn absorb<const FIRST: usize>(corrected: &mut Corrected, row: &Row) -> Result<(), NavError> {
    let columns = &mut corrected.covariance.data.0;
    let error = &mut corrected.error.data.0[0];
    let [gx, gy, gz, gc] = row.gradient;
    let ph: [f64; STATES] = std::array::from_fn(|i| {
        (gx * columns[FIRST][i] + gy * columns[FIRST + 2][i])
            + (gz * columns[FIRST + 4][i] + gc * columns[FIRST + 6][i])
    });
    let along = |x: &[f64; STATES]| {
        (gx * x[FIRST] + gy * x[FIRST + 2]) + (gz * x[FIRST + 4] + gc * x[FIRST + 6])
    };
    let s = along(&ph) + row.variance;
    // Negated so that a NaN fails as well.
    if !(s > 0.0 && s.is_finite()) {
        return Err(NavError::Singular);
    }
    let innovation = row.residual - along(error);
    let inverse = 1.0 / s;
    let gain = innovation * inverse;
    let root = inverse.sqrt();
    let w: [f64; STATES] = std::array::from_fn(|i| ph[i] * root);
    for (column, wj) in columns.iter_mut().zip(w) {
        for (element, wi) in column.iter_mut().zip(w) {
            *element -= wi * wj;
        }
    }
    for (x, ph) in error.iter_mut().zip(ph) {
        *x += ph * gain;
    }
    corrected.normalised_squared += innovation * gain;
    corrected.count += 1;
    Ok(())
}
