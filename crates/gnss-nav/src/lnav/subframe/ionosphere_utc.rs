//! Page 18 of subframe 4: ionosphere and UTC (IS-GPS-200, 20.3.3.5.1.6 and 20.3.3.5.1.7).

use super::week::unroll_week;
use crate::lnav::field::{Field, Term};
use crate::lnav::word::{DataWords, Run};
use crate::{GpsTime, Klobuchar, NavError};

/// SV (page) ID that this page is sent under.
pub(in crate::lnav) const SV_ID: u32 = 56;

/// Klobuchar coefficients and the offset of UTC from GPS time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IonosphereUtc {
    /// Ionosphere.
    pub klobuchar: Klobuchar,
    /// UTC.
    pub utc: UtcParameters,
}

/// Offset of UTC (USNO) from GPS time, as broadcast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UtcParameters {
    /// Constant term A0, s.
    pub a0_s: f64,
    /// First-order term A1, s/s.
    pub a1: f64,
    /// Reference time of week, s (a multiple of 4096).
    pub tot_s: u32,
    /// Reference week, low eight bits.
    pub wnt: u8,
    /// Leap seconds now, s.
    pub delta_tls_s: i8,
    /// Week in which `delta_tlsf_s` comes into force, low eight bits.
    pub wn_lsf: u8,
    /// Day of that week at the end of which it does (1 to 7).
    pub dn: u8,
    /// Leap seconds then, s.
    pub delta_tlsf_s: i8,
}

impl UtcParameters {
    /// Reference time, its week taken nearest to that of `near`.
    #[must_use]
    pub fn reference_time(&self, near: GpsTime) -> GpsTime {
        let week = unroll_week(self.wnt.into(), 8, near.week());
        GpsTime::from_parts(week, self.tot_s.into(), 0.0)
    }
}

const TERMS: [Term<IonosphereUtc>; 10] = [
    Term::new(Field::signed("alpha0", (69, 8), -30), |p| {
        &mut p.klobuchar.alpha[0]
    }),
    Term::new(Field::signed("alpha1", (77, 8), -27), |p| {
        &mut p.klobuchar.alpha[1]
    }),
    Term::new(Field::signed("alpha2", (91, 8), -24), |p| {
        &mut p.klobuchar.alpha[2]
    }),
    Term::new(Field::signed("alpha3", (99, 8), -24), |p| {
        &mut p.klobuchar.alpha[3]
    }),
    Term::new(Field::signed("beta0", (107, 8), 11), |p| {
        &mut p.klobuchar.beta[0]
    }),
    Term::new(Field::signed("beta1", (121, 8), 14), |p| {
        &mut p.klobuchar.beta[1]
    }),
    Term::new(Field::signed("beta2", (129, 8), 16), |p| {
        &mut p.klobuchar.beta[2]
    }),
    Term::new(Field::signed("beta3", (137, 8), 16), |p| {
        &mut p.klobuchar.beta[3]
    }),
    Term::new(Field::signed("a1", (151, 24), -50), |p| &mut p.utc.a1),
    Term::new(
        Field::signed("a0_s", (211, 8), -30).with_high((181, 24)),
        |p| &mut p.utc.a0_s,
    ),
];

const TOT: Run = (219, 8);
const WNT: Run = (227, 8);
const DELTA_TLS: Run = (241, 8);
const WN_LSF: Run = (249, 8);
const DN: Run = (257, 8);
const DELTA_TLSF: Run = (271, 8);

/// Seconds in a step of `tot_s`.
const STEP_S: u32 = 4096;

impl IonosphereUtc {
    /// Reads words 3 to 10 of the page.
    pub(in crate::lnav) fn read(page: &DataWords) -> Self {
        let mut parameters = Self {
            klobuchar: Klobuchar {
                alpha: [0.0; 4],
                beta: [0.0; 4],
            },
            utc: UtcParameters {
                a0_s: 0.0,
                a1: 0.0,
                tot_s: page.bits(TOT) * STEP_S,
                wnt: page.bits(WNT) as u8,
                delta_tls_s: page.bits(DELTA_TLS) as i8,
                wn_lsf: page.bits(WN_LSF) as u8,
                dn: page.bits(DN) as u8,
                delta_tlsf_s: page.bits(DELTA_TLSF) as i8,
            },
        };
        TERMS
            .iter()
            .for_each(|term| term.read(page, &mut parameters));
        parameters
    }

    /// Writes words 3 to 10 of the page.
    ///
    /// # Errors
    /// [`NavError::Value`] names a number that its field cannot hold.
    pub(in crate::lnav) fn write(&self, page: &mut DataWords) -> Result<(), NavError> {
        if !self.utc.tot_s.is_multiple_of(STEP_S) || self.utc.tot_s / STEP_S > 0xFF {
            return Err(NavError::Value {
                name: "tot_s",
                value: self.utc.tot_s.to_string(),
                expected: "a multiple of 4096 s up to 1044480 s",
            });
        }
        page.set_bits(TOT, self.utc.tot_s / STEP_S);
        page.set_bits(WNT, self.utc.wnt.into());
        page.set_bits(DELTA_TLS, self.utc.delta_tls_s as u32);
        page.set_bits(WN_LSF, self.utc.wn_lsf.into());
        page.set_bits(DN, self.utc.dn.into());
        page.set_bits(DELTA_TLSF, self.utc.delta_tlsf_s as u32);
        TERMS.iter().try_for_each(|term| term.write(page, self))
    }
}
