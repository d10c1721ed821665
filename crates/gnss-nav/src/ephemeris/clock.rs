//! Satellite clock: broadcast polynomial, relativity, group delay (IS-GPS-200 20.3.3.3.3).

use super::Ephemeris;
use super::orbit::Propagated;
use crate::constants::RELATIVITY_F;

/// Offset of the L1 C/A clock from GPS time.
pub(super) struct Clock {
    pub(super) bias_s: f64,
    pub(super) drift: f64,
}

/// The clock `age_s` after `toc`: af0 + af1 t + af2 t^2 + F e sqrt(A) sin E - TGD.
pub(super) fn evaluate(eph: &Ephemeris, age_s: f64, orbit: &Propagated) -> Clock {
    let relativity_s = RELATIVITY_F * eph.eccentricity * eph.sqrt_a;
    Clock {
        bias_s: eph.af0_s
            + (eph.af1 + eph.af2_per_s * age_s) * age_s
            + relativity_s * orbit.sin_eccentric
            - eph.tgd_s,
        drift: eph.af1 + 2.0 * eph.af2_per_s * age_s + relativity_s * orbit.sin_eccentric_rate,
    }
}
