//! Broadcast ephemerides and the satellite states they give.

mod clock;
mod orbit;
mod store;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

use crate::{GpsTime, NavError, SatelliteId};

pub use store::EphemerisStore;

/// Broadcast clock and orbit of one GPS satellite (IS-GPS-200, tables 20-I to 20-III).
///
/// Angles in radians (LNAV broadcasts semicircles), rates in rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ephemeris {
    /// Whose.
    pub satellite: SatelliteId,
    /// Issue of data, clock (10 bits).
    pub iodc: u16,
    /// Issue of data, ephemeris (8 bits).
    pub iode: u8,
    /// Health (6 bits; 0 = all well).
    pub health: u8,
    /// User range accuracy index (0 to 15).
    pub ura_index: u8,
    /// Codes on L2 (2 bits).
    pub codes_on_l2: u8,
    /// Whether the L2 P code carries no data.
    pub l2_p_data_off: bool,
    /// Whether the curve fit interval exceeds four hours.
    pub fit_interval_extended: bool,
    /// Clock reference time.
    pub toc: GpsTime,
    /// Clock bias, s.
    pub af0_s: f64,
    /// Clock drift, s/s.
    pub af1: f64,
    /// Clock drift rate, 1/s.
    pub af2_per_s: f64,
    /// Group delay L1 - L2, s.
    pub tgd_s: f64,
    /// Orbit reference time.
    pub toe: GpsTime,
    /// Square root of the semi-major axis, m^0.5.
    pub sqrt_a: f64,
    /// Eccentricity.
    pub eccentricity: f64,
    /// Mean anomaly at `toe`, rad.
    pub m0_rad: f64,
    /// Mean motion difference, rad/s.
    pub delta_n_rad_s: f64,
    /// Longitude of the ascending node at the start of the week, rad.
    pub omega0_rad: f64,
    /// Rate of right ascension, rad/s.
    pub omega_dot_rad_s: f64,
    /// Inclination at `toe`, rad.
    pub i0_rad: f64,
    /// Rate of inclination, rad/s.
    pub idot_rad_s: f64,
    /// Argument of perigee, rad.
    pub omega_rad: f64,
    /// Amplitude of the cosine correction to the argument of latitude, rad.
    pub cuc_rad: f64,
    /// Amplitude of the sine correction to the argument of latitude, rad.
    pub cus_rad: f64,
    /// Amplitude of the cosine correction to the radius, m.
    pub crc_m: f64,
    /// Amplitude of the sine correction to the radius, m.
    pub crs_m: f64,
    /// Amplitude of the cosine correction to the inclination, rad.
    pub cic_rad: f64,
    /// Amplitude of the sine correction to the inclination, rad.
    pub cis_rad: f64,
}

impl Ephemeris {
    /// The satellite at GPS time `time` (of transmission).
    ///
    /// Position and velocity are in the ECEF frame of `time` itself (IS-GPS-200 20.3.3.4.3), the
    /// clock includes relativity and the group delay of L1 C/A. The age of the ephemeris is not
    /// judged here, see [`Ephemeris::is_valid_at`].
    ///
    /// # Errors
    /// [`NavError::Orbit`] when the elements are not those of an ellipse outside the earth or any
    /// value is not finite.
    pub fn state_at(&self, time: GpsTime) -> Result<SatelliteState, NavError> {
        let orbit = orbit::propagate(self, time - self.toe)?;
        let clock = clock::evaluate(self, time - self.toc, &orbit);
        let state = SatelliteState {
            position_ecef_m: orbit.position_ecef_m,
            velocity_ecef_mps: orbit.velocity_ecef_mps,
            clock_bias_s: clock.bias_s,
            clock_drift: clock.drift,
        };
        if state.is_finite() {
            Ok(state)
        } else {
            Err(self.not_an_orbit("a value is not finite"))
        }
    }

    /// The satellite when its own clock (the code and data of L1 C/A) read `satellite_time`, with
    /// the GPS time of that instant.
    ///
    /// # Errors
    /// As [`Ephemeris::state_at`].
    pub fn state_at_transmission(
        &self,
        satellite_time: GpsTime,
    ) -> Result<(GpsTime, SatelliteState), NavError> {
        // The clock drifts by less than 1e-10 s during its own offset of at most 1 ms.
        let bias_s = self.state_at(satellite_time)?.clock_bias_s;
        let time = satellite_time - bias_s;
        Ok((time, self.state_at(time)?))
    }

    /// Refuses what no GPS satellite flies. A message could hold it, and undetected bit errors or a damaged file make
    /// it; the bounds are wider than any orbit that was ever kept (nominal: 5153.6 m^0.5, e < 0.03, 55 degrees).
    ///
    /// # Errors
    /// [`NavError::Value`] that names the element.
    pub fn check_orbit(&self) -> Result<(), NavError> {
        let bounds = [
            ("sqrt_a", self.sqrt_a, 5000.0..5300.0, "5000 to 5300 m^0.5"),
            ("eccentricity", self.eccentricity, 0.0..0.1, "0 to 0.1"),
            ("i0_rad", self.i0_rad, 0.7..1.3, "0.7 to 1.3 rad"),
        ];
        for (name, value, bound, expected) in bounds {
            if !bound.contains(&value) {
                return Err(NavError::Value {
                    name,
                    value: value.to_string(),
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Length of the curve fit interval around `toe`, h (IS-GPS-200 20.3.3.4.3.1, table 20-XII).
    #[must_use]
    pub const fn fit_interval_h(&self) -> f64 {
        if !self.fit_interval_extended {
            return 4.0;
        }
        match self.iodc {
            240..=247 => 8.0,
            248..=255 | 496 => 14.0,
            497..=503 | 1021..=1023 => 26.0,
            _ => 6.0,
        }
    }

    /// Nominal user range accuracy, m (IS-GPS-200 20.3.3.3.1.3); 8192 m where the control segment
    /// predicts none (index 15 and beyond).
    #[must_use]
    pub fn user_range_accuracy_m(&self) -> f64 {
        let index = f64::from(self.ura_index.min(15));
        if index <= 6.0 {
            (1.0 + index / 2.0).exp2()
        } else {
            (index - 2.0).exp2()
        }
    }

    /// Whether `time` lies within the curve fit interval.
    #[must_use]
    pub fn is_valid_at(&self, time: GpsTime) -> bool {
        (time - self.toe).abs() <= self.fit_interval_h() * 1800.0
    }

    pub(crate) fn not_an_orbit(&self, reason: &'static str) -> NavError {
        NavError::Orbit {
            satellite: self.satellite,
            reason,
        }
    }
}

/// A satellite at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SatelliteState {
    /// Position in ECEF (WGS-84) of that instant, m.
    pub position_ecef_m: Vector3<f64>,
    /// Velocity in ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
    /// Clock bias with relativity and, for L1, group delay, s.
    pub clock_bias_s: f64,
    /// Clock drift with relativity, s/s.
    pub clock_drift: f64,
}

impl SatelliteState {
    fn is_finite(&self) -> bool {
        self.position_ecef_m.iter().all(|v| v.is_finite())
            && self.velocity_ecef_mps.iter().all(|v| v.is_finite())
            && self.clock_bias_s.is_finite()
            && self.clock_drift.is_finite()
    }
}
