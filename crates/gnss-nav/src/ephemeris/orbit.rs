//! Keplerian elements to ECEF position and velocity (IS-GPS-200 table 20-IV).

use nalgebra::Vector3;

use super::Ephemeris;
use crate::NavError;
use crate::constants::{EARTH_RATE_RAD_S, MU_M3_PER_S2};

/// Iterations allowed to Kepler's equation; Newton needs four or five at any GPS eccentricity.
const KEPLER_ITERATIONS: usize = 30;

/// Newton stops here, rad: 3e-8 m along the orbit.
const KEPLER_TOLERANCE_RAD: f64 = 1e-15;

/// Orbital radii believed, m: above the atmosphere, below the moon.
const SEMI_MAJOR_M: std::ops::RangeInclusive<f64> = 6.4e6..=3.8e8;

/// What propagation gives, with what the clock needs for relativity.
pub(super) struct Propagated {
    pub(super) position_ecef_m: Vector3<f64>,
    pub(super) velocity_ecef_mps: Vector3<f64>,
    /// Sine of the eccentric anomaly.
    pub(super) sin_eccentric: f64,
    /// d/dt of that sine, 1/s.
    pub(super) sin_eccentric_rate: f64,
}

/// A quantity with its time derivative.
#[derive(Clone, Copy)]
struct Rated {
    value: f64,
    rate: f64,
}

/// The satellite `age_s` after `toe`.
pub(super) fn propagate(eph: &Ephemeris, age_s: f64) -> Result<Propagated, NavError> {
    let a_m = eph.sqrt_a * eph.sqrt_a;
    if !(0.0..1.0).contains(&eph.eccentricity) || !SEMI_MAJOR_M.contains(&a_m) {
        return Err(eph.not_an_orbit("not an ellipse around the earth"));
    }
    let e = eph.eccentricity;
    let motion_rad_s = (MU_M3_PER_S2 / (a_m * a_m * a_m)).sqrt() + eph.delta_n_rad_s;
    let eccentric = eccentric_anomaly(eph, eph.m0_rad + motion_rad_s * age_s)?;
    let (sin_e, cos_e) = eccentric.sin_cos();
    let eccentric_rate = motion_rad_s / (1.0 - e * cos_e);
    let shape = (1.0 - e * e).sqrt();
    // True anomaly plus argument of perigee: argument of latitude.
    let latitude = Rated {
        value: (shape * sin_e).atan2(cos_e - e) + eph.omega_rad,
        rate: eccentric_rate * shape / (1.0 - e * cos_e),
    };
    let radius = Rated {
        value: a_m * (1.0 - e * cos_e),
        rate: a_m * e * sin_e * eccentric_rate,
    };
    let (position_ecef_m, velocity_ecef_mps) = rotate(eph, age_s, latitude, radius);
    Ok(Propagated {
        position_ecef_m,
        velocity_ecef_mps,
        sin_eccentric: sin_e,
        sin_eccentric_rate: cos_e * eccentric_rate,
    })
}

/// Solves M = E - e sin E for E by Newton's method.
fn eccentric_anomaly(eph: &Ephemeris, mean_rad: f64) -> Result<f64, NavError> {
    let e = eph.eccentricity;
    let mean = mean_rad.rem_euclid(std::f64::consts::TAU);
    // Starting at pi Newton converges for every ellipse; near-circular orbits start closer.
    let mut eccentric = if e < 0.5 { mean } else { std::f64::consts::PI };
    for _ in 0..KEPLER_ITERATIONS {
        let step = (mean - eccentric + e * eccentric.sin()) / (1.0 - e * eccentric.cos());
        eccentric += step;
        if step.abs() <= KEPLER_TOLERANCE_RAD * (1.0 + eccentric.abs()) {
            return Ok(eccentric);
        }
    }
    Err(eph.not_an_orbit("Kepler's equation does not converge"))
}

/// Harmonic corrections, then the orbital plane into ECEF.
fn rotate(eph: &Ephemeris, age_s: f64, lat: Rated, radius: Rated) -> (Vector3<f64>, Vector3<f64>) {
    let (sin2, cos2) = (2.0 * lat.value).sin_cos();
    let harmonic = |base: Rated, cosine: f64, sine: f64| Rated {
        value: base.value + cosine * cos2 + sine * sin2,
        rate: base.rate + 2.0 * lat.rate * (sine * cos2 - cosine * sin2),
    };
    let inclination = Rated {
        value: eph.i0_rad + eph.idot_rad_s * age_s,
        rate: eph.idot_rad_s,
    };
    let u = harmonic(lat, eph.cuc_rad, eph.cus_rad);
    let r = harmonic(radius, eph.crc_m, eph.crs_m);
    let i = harmonic(inclination, eph.cic_rad, eph.cis_rad);
    let node = Rated {
        value: eph.omega0_rad + (eph.omega_dot_rad_s - EARTH_RATE_RAD_S) * age_s
            - EARTH_RATE_RAD_S * eph.toe.tow_s(),
        rate: eph.omega_dot_rad_s - EARTH_RATE_RAD_S,
    };
    let (sin_u, cos_u) = u.value.sin_cos();
    let (sin_i, cos_i) = i.value.sin_cos();
    let (sin_n, cos_n) = node.value.sin_cos();
    let (x, y) = (r.value * cos_u, r.value * sin_u);
    let (x_rate, y_rate) = (r.rate * cos_u - y * u.rate, r.rate * sin_u + x * u.rate);
    let (y_flat, y_high) = (y * cos_i, y * sin_i);
    let y_flat_rate = y_rate * cos_i - y_high * i.rate;
    let position = Vector3::new(
        x * cos_n - y_flat * sin_n,
        x * sin_n + y_flat * cos_n,
        y_high,
    );
    let velocity = Vector3::new(
        x_rate * cos_n - y_flat_rate * sin_n - position.y * node.rate,
        x_rate * sin_n + y_flat_rate * cos_n + position.x * node.rate,
        y_rate * sin_i + y_flat * i.rate,
    );
    (position, velocity)
}
