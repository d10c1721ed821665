//! Almanac pages: pages 1 to 24 of subframe 5, 2 to 5 and 7 to 10 of subframe 4
//! (IS-GPS-200, 20.3.3.5.1.2).

use std::f64::consts::PI;

use crate::lnav::field::{Field, Term};
use crate::lnav::word::{DataWords, Run};
use crate::{NavError, SatelliteId};

/// Reduced-precision orbit and clock of one satellite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Almanac {
    /// Whose (not who sent it).
    pub satellite: SatelliteId,
    /// Health (8 bits; 0 = all well).
    pub health: u8,
    /// Reference time of week, s (a multiple of 4096); its week is that of [`HealthReference`],
    /// or the one nearest to the time sent.
    ///
    /// [`HealthReference`]: crate::lnav::HealthReference
    pub toa_s: u32,
    /// Eccentricity.
    pub eccentricity: f64,
    /// Inclination less the nominal 0.3 semicircles, rad.
    pub delta_i_rad: f64,
    /// Rate of right ascension, rad/s.
    pub omega_dot_rad_s: f64,
    /// Square root of the semi-major axis, m^0.5.
    pub sqrt_a: f64,
    /// Longitude of the ascending node at the start of the week, rad.
    pub omega0_rad: f64,
    /// Argument of perigee, rad.
    pub omega_rad: f64,
    /// Mean anomaly at the reference time, rad.
    pub m0_rad: f64,
    /// Clock bias, s.
    pub af0_s: f64,
    /// Clock drift, s/s.
    pub af1: f64,
}

const TOA: Run = (91, 8);
const HEALTH: Run = (137, 8);
const AF0_HIGH: Run = (271, 8);
const AF0_LOW: Run = (290, 3);

/// Seconds in a step of `toa_s`.
pub(super) const STEP_S: u32 = 4096;

const TERMS: [Term<Almanac>; 9] = [
    Term::new(Field::unsigned("eccentricity", (69, 16), -21), |a| {
        &mut a.eccentricity
    }),
    Term::new(
        Field::signed("delta_i_rad", (99, 16), -19).semicircles(),
        |a| &mut a.delta_i_rad,
    ),
    Term::new(
        Field::signed("omega_dot_rad_s", (121, 16), -38).semicircles(),
        |a| &mut a.omega_dot_rad_s,
    ),
    Term::new(Field::unsigned("sqrt_a", (151, 24), -11), |a| &mut a.sqrt_a),
    Term::new(Field::turn("omega0_rad", (181, 24), -23), |a| {
        &mut a.omega0_rad
    }),
    Term::new(Field::turn("omega_rad", (211, 24), -23), |a| {
        &mut a.omega_rad
    }),
    Term::new(Field::turn("m0_rad", (241, 24), -23), |a| &mut a.m0_rad),
    Term::new(
        Field::signed("af0_s", AF0_LOW, -20).with_high(AF0_HIGH),
        |a| &mut a.af0_s,
    ),
    Term::new(Field::signed("af1", (279, 11), -38), |a| &mut a.af1),
];

impl Almanac {
    /// Inclination, rad.
    #[must_use]
    pub fn inclination_rad(&self) -> f64 {
        0.3 * PI + self.delta_i_rad
    }

    /// The same with every number rounded to what the message holds.
    ///
    /// # Errors
    /// [`NavError::Value`] names a number that its field cannot hold.
    pub fn quantise(&self) -> Result<Self, NavError> {
        let mut page = DataWords::default();
        self.write(&mut page)?;
        Ok(Self::read(self.satellite.prn, &page))
    }

    /// Reads words 3 to 10 of the page of satellite `prn`.
    pub(in crate::lnav) fn read(prn: u8, page: &DataWords) -> Self {
        let mut almanac = Self {
            satellite: SatelliteId::gps(prn),
            health: page.bits(HEALTH) as u8,
            toa_s: page.bits(TOA) * STEP_S,
            eccentricity: 0.0,
            delta_i_rad: 0.0,
            omega_dot_rad_s: 0.0,
            sqrt_a: 0.0,
            omega0_rad: 0.0,
            omega_rad: 0.0,
            m0_rad: 0.0,
            af0_s: 0.0,
            af1: 0.0,
        };
        TERMS.iter().for_each(|term| term.read(page, &mut almanac));
        almanac
    }

    /// Whether a GPS satellite may fly it (wider than the orbits kept); undetected bit errors and
    /// pages of satellites that do not exist fail this.
    pub(in crate::lnav) fn is_orbit(&self) -> bool {
        (5000.0..5300.0).contains(&self.sqrt_a)
            && self.eccentricity < 0.1
            && (0.7..1.3).contains(&self.inclination_rad())
    }

    /// Writes words 3 to 10 of the page, the SV ID left out.
    ///
    /// # Errors
    /// [`NavError::Value`] names a number that its field cannot hold.
    pub(in crate::lnav) fn write(&self, page: &mut DataWords) -> Result<(), NavError> {
        page.set_bits(TOA, reference_steps(self.toa_s)?);
        page.set_bits(HEALTH, self.health.into());
        TERMS.iter().try_for_each(|term| term.write(page, self))
    }
}

/// An almanac reference time in steps of 4096 s.
///
/// # Errors
/// [`NavError::Value`] where it is no multiple of that or exceeds a week.
pub(super) fn reference_steps(toa_s: u32) -> Result<u32, NavError> {
    if toa_s.is_multiple_of(STEP_S) && toa_s < 604_800 {
        Ok(toa_s / STEP_S)
    } else {
        Err(NavError::Value {
            name: "toa_s",
            value: toa_s.to_string(),
            expected: "a multiple of 4096 s below 604800 s",
        })
    }
}
