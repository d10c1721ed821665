//! The update of Li2019: one scalar measurement after the other, without an inverse.

use nalgebra::Vector4;

use super::correction::{Correct, Corrected};
use super::covariance::Blocks;
use super::row::{Observable, Row};
use crate::NavError;

/// Scalar updates in the order of the measurements.
///
/// s = h' P h + r, k = P h / s, x += k (y - h' x), P -= k h' P. Noises of different measurements
/// are independent, so that the result does not depend on the order. Nothing is allocated, the
/// four zeros of every row are skipped, and of the symmetric P three blocks of four are kept.
///
/// P - k h' P loses the digits by which the prior variance exceeds that of the noise: 13 of the 16
/// of a float, as from 1e10 m^2 against 1e-3 m^2, still leave P positive definite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sequential;

impl Correct for Sequential {
    #[inline]
    fn correct(
        covariance: &Blocks,
        rows: impl Iterator<Item = Row>,
    ) -> Result<Corrected, NavError> {
        let mut corrected = Corrected::prior(covariance);
        for row in rows {
            absorb(&mut corrected, &row)?;
        }
        Ok(corrected)
    }
}

#[inline]
fn absorb(corrected: &mut Corrected, row: &Row) -> Result<(), NavError> {
    let (p, h) = (&corrected.covariance, &row.gradient);
    match row.observable {
        Observable::Pseudorange => {
            let (offset, rate) = (p.offset * h, p.cross * h);
            let known = h.dot(&corrected.error.offset);
            reduce(corrected, row, &offset, &rate, h.dot(&offset), known)
        }
        Observable::RangeRate => {
            let (offset, rate) = (p.cross.tr_mul(h), p.rate * h);
            let known = h.dot(&corrected.error.rate);
            reduce(corrected, row, &offset, &rate, h.dot(&rate), known)
        }
    }
}

/// Takes in a row with P h = (`offset`, `rate`), h' P h = `state_variance` and h' x = `known`.
#[inline]
fn reduce(
    corrected: &mut Corrected,
    row: &Row,
    offset: &Vector4<f64>,
    rate: &Vector4<f64>,
    state_variance: f64,
    known: f64,
) -> Result<(), NavError> {
    let s = state_variance + row.variance;
    // Negated so that a NaN fails as well.
    if !(s > 0.0 && s.is_finite()) {
        return Err(NavError::Singular);
    }
    let innovation = row.residual - known;
    let inverse = 1.0 / s;
    let gain = innovation * inverse;
    corrected.error.offset += offset * gain;
    corrected.error.rate += rate * gain;
    // The product of the two elements comes first: it commutes, so that P stays symmetric to the
    // last bit, and does not wait for the division.
    let p = &mut corrected.covariance;
    p.offset -= (offset * offset.transpose()) * inverse;
    p.cross -= (rate * offset.transpose()) * inverse;
    p.rate -= (rate * rate.transpose()) * inverse;
    corrected.normalised_squared += innovation * gain;
    corrected.count += 1;
    Ok(())
}
