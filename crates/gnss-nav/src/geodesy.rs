//! Geodetic and local coordinates on WGS-84.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, Vector3};

use crate::constants::{WGS84_ECCENTRICITY_SQUARED, WGS84_FLATTENING, WGS84_SEMI_MAJOR_M};

/// Closer to the centre than this (the evolute reaches 43 km) a point has several geodetic
/// latitudes; the geocentric one is taken.
const EVOLUTE_RADIUS_M: f64 = 50e3;

/// A point by geodetic latitude, longitude and height over WGS-84.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geodetic {
    /// Latitude, rad, north positive.
    pub lat_rad: f64,
    /// Longitude, rad, east positive, in (-pi, pi].
    pub lon_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

impl Geodetic {
    /// The point at `lat_deg`, `lon_deg` (degrees) and `height_m`.
    #[must_use]
    pub fn from_degrees(lat_deg: f64, lon_deg: f64, height_m: f64) -> Self {
        Self {
            lat_rad: lat_deg.to_radians(),
            lon_rad: lon_deg.to_radians(),
            height_m,
        }
    }

    /// The point at `ecef_m`, exact to the rounding of an `f64` outside the innermost 50 km.
    ///
    /// Bowring's iteration on the parametric latitude (Survey Review 23, 1976); the height is
    /// first-order insensitive to the latitude and well conditioned at the poles. At the centre
    /// latitude and longitude are zero and the height is minus the semi-major axis.
    #[must_use]
    pub fn from_ecef(ecef_m: &Vector3<f64>) -> Self {
        let (x, y, z) = (ecef_m.x, ecef_m.y, ecef_m.z);
        let equatorial_m = x.hypot(y);
        let lat_rad = if equatorial_m.hypot(z) < EVOLUTE_RADIUS_M {
            z.atan2(equatorial_m)
        } else {
            latitude_rad(equatorial_m, z)
        };
        let (sin, cos) = lat_rad.sin_cos();
        let surface_m = WGS84_SEMI_MAJOR_M * (1.0 - WGS84_ECCENTRICITY_SQUARED * sin * sin).sqrt();
        Self {
            lat_rad,
            lon_rad: y.atan2(x),
            height_m: equatorial_m * cos + z * sin - surface_m,
        }
    }

    /// Its ECEF position, m.
    #[must_use]
    pub fn to_ecef(&self) -> Vector3<f64> {
        let (sin_lat, cos_lat) = self.lat_rad.sin_cos();
        let (sin_lon, cos_lon) = self.lon_rad.sin_cos();
        let e2 = WGS84_ECCENTRICITY_SQUARED;
        let normal_m = WGS84_SEMI_MAJOR_M / (1.0 - e2 * sin_lat * sin_lat).sqrt();
        let equatorial_m = (normal_m + self.height_m) * cos_lat;
        Vector3::new(
            equatorial_m * cos_lon,
            equatorial_m * sin_lon,
            (normal_m * (1.0 - e2) + self.height_m) * sin_lat,
        )
    }

    /// Rotation that turns a difference of ECEF vectors into east, north, up of this point.
    #[must_use]
    pub fn enu_from_ecef(&self) -> Matrix3<f64> {
        let (sin_lat, cos_lat) = self.lat_rad.sin_cos();
        let (sin_lon, cos_lon) = self.lon_rad.sin_cos();
        Matrix3::new(
            -sin_lon,
            cos_lon,
            0.0,
            -sin_lat * cos_lon,
            -sin_lat * sin_lon,
            cos_lat,
            cos_lat * cos_lon,
            cos_lat * sin_lon,
            sin_lat,
        )
    }

    /// Where the direction `unit_ecef` (from this point) is in its sky.
    #[must_use]
    pub fn look(&self, unit_ecef: &Vector3<f64>) -> Look {
        Look::towards(&(self.enu_from_ecef() * unit_ecef))
    }

    /// Angle by which the horizon lies below the horizontal, rad; zero on and below the ground.
    ///
    /// A signal from above reaches this point when its elevation exceeds minus this angle
    /// (spherical earth, no refraction).
    #[must_use]
    pub fn horizon_dip_rad(&self) -> f64 {
        let height_m = self.height_m.max(0.0);
        (WGS84_SEMI_MAJOR_M / (WGS84_SEMI_MAJOR_M + height_m)).acos()
    }
}

/// A direction in the sky of a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Clockwise from north, rad, in [0, 2 pi).
    pub azimuth_rad: f64,
    /// Above the horizontal, rad.
    pub elevation_rad: f64,
}

impl Look {
    /// The direction of `enu` (east, north, up).
    pub(crate) fn towards(enu: &Vector3<f64>) -> Self {
        let azimuth = enu.x.atan2(enu.y);
        Self {
            azimuth_rad: if azimuth < 0.0 {
                azimuth + std::f64::consts::TAU
            } else {
                azimuth
            },
            elevation_rad: enu.z.atan2(enu.x.hypot(enu.y)),
        }
    }
}

fn latitude_rad(equatorial_m: f64, z_m: f64) -> f64 {
    let e2 = WGS84_ECCENTRICITY_SQUARED;
    let flat = 1.0 - WGS84_FLATTENING;
    let polar_m = WGS84_SEMI_MAJOR_M * flat;
    let mut parametric = z_m.atan2(flat * equatorial_m);
    let mut lat = FRAC_PI_2.copysign(z_m);
    // Each pass gains several digits above the ground; ten cover the deep interior as well.
    for _ in 0..10 {
        let (sin, cos) = parametric.sin_cos();
        let previous = lat;
        lat = (z_m + e2 / (1.0 - e2) * polar_m * sin.powi(3))
            .atan2(equatorial_m - e2 * WGS84_SEMI_MAJOR_M * cos.powi(3));
        parametric = (flat * lat.sin()).atan2(lat.cos());
        if lat == previous {
            break;
        }
    }
    lat
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Eight steps of an `f64` at 3e7 m (3.7 nm each): rounding is all that may be left, and the worst of 2e7 draws
    /// leaves 23 nm.
    const ROUNDING_M: f64 = 3e-8;

    #[test]
    fn known_points() {
        let poles_and_equator = [
            (
                Geodetic::from_degrees(0.0, 0.0, 0.0),
                [6_378_137.0, 0.0, 0.0],
            ),
            // Polar radius a (1 - f).
            (
                Geodetic::from_degrees(90.0, 0.0, 5.0),
                [0.0, 0.0, 6_356_757.314_245_179],
            ),
        ];
        for (geodetic, ecef) in poles_and_equator {
            let ecef = Vector3::from(ecef);
            assert!((geodetic.to_ecef() - ecef).norm() < 1e-9);
            let back = Geodetic::from_ecef(&ecef);
            assert!((back.height_m - geodetic.height_m).abs() < 2e-9);
            assert!((back.lat_rad - geodetic.lat_rad).abs() < 1e-15);
        }
    }

    #[test]
    fn centre_and_south_pole_are_finite() {
        let centre = Geodetic::from_ecef(&Vector3::zeros());
        assert_eq!(centre.height_m, -WGS84_SEMI_MAJOR_M);
        let south = Geodetic::from_ecef(&Vector3::new(0.0, 0.0, -6.4e6));
        assert!((south.lat_rad + FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn look_angles_of_the_axes() {
        let here = Geodetic::from_degrees(40.0, -75.0, 100.0);
        let ecef_from_enu = here.enu_from_ecef().transpose();
        let east = here.look(&(ecef_from_enu * Vector3::x()));
        assert!((east.azimuth_rad - FRAC_PI_2).abs() < 1e-12 && east.elevation_rad.abs() < 1e-12);
        let up = here.look(&(ecef_from_enu * Vector3::z()));
        assert!((up.elevation_rad - FRAC_PI_2).abs() < 1e-7);
    }

    #[test]
    fn dip_of_the_horizon() {
        // sqrt(2 h / R) for small heights: 10 km gives 3.2 degrees.
        let dip = Geodetic::from_degrees(0.0, 0.0, 10e3).horizon_dip_rad();
        assert!((dip - (2.0 * 10e3 / WGS84_SEMI_MAJOR_M).sqrt()).abs() < 1e-4);
        assert_eq!(
            Geodetic::from_degrees(0.0, 0.0, -50.0).horizon_dip_rad(),
            0.0
        );
    }

    proptest! {
        #[test]
        fn round_trip(lat in -90.0..90.0f64, lon in -180.0..180.0f64, h in -6.2e6..3e7f64) {
            let ecef = Geodetic::from_degrees(lat, lon, h).to_ecef();
            let again = Geodetic::from_ecef(&ecef).to_ecef();
            prop_assert!((again - ecef).norm() < ROUNDING_M);
        }
    }
}
