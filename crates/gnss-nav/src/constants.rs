//! Constants of WGS-84 and of the GPS interface (IS-GPS-200 20.3.3.3.3 and 20.3.3.4.3).

/// Speed of light, m/s (IS-GPS-200 20.3.4.3).
pub const SPEED_OF_LIGHT_MPS: f64 = 299_792_458.0;

/// Semi-major axis of the WGS-84 ellipsoid, m.
pub const WGS84_SEMI_MAJOR_M: f64 = 6_378_137.0;

/// Flattening of the WGS-84 ellipsoid.
pub const WGS84_FLATTENING: f64 = 1.0 / 298.257_223_563;

/// First eccentricity of the WGS-84 ellipsoid, squared.
pub const WGS84_ECCENTRICITY_SQUARED: f64 = WGS84_FLATTENING * (2.0 - WGS84_FLATTENING);

/// Gravitational parameter of the earth as GPS uses it, m^3/s^2 (table 20-IV).
pub const MU_M3_PER_S2: f64 = 3.986_005e14;

/// Rotation rate of the earth, rad/s (table 20-IV).
pub const EARTH_RATE_RAD_S: f64 = 7.292_115_146_7e-5;

/// Relativistic clock constant F = -2 sqrt(mu) / c^2, s/m^0.5 (20.3.3.3.3.1).
pub const RELATIVITY_F: f64 = -4.442_807_633e-10;

/// Carrier frequency of L1, Hz.
pub const L1_HZ: f64 = 1_575.42e6;

/// Wavelength of L1, m.
pub const L1_WAVELENGTH_M: f64 = SPEED_OF_LIGHT_MPS / L1_HZ;

/// Chip rate of the C/A code, Hz.
pub const CA_CODE_RATE_HZ: f64 = 1.023e6;

/// Range the signal travels in one period of the C/A code (1 ms), m.
pub const CA_PERIOD_M: f64 = SPEED_OF_LIGHT_MPS * 1e-3;
