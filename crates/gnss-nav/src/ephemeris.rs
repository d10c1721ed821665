//! Broadcast ephemerides and the satellite states they give.

use nalgebra::Vector3;

use crate::{GpsTime, SatelliteId};

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
