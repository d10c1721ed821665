//! Delays of the ionosphere (Klobuchar) and the troposphere (Saastamoinen).

use std::f64::consts::PI;

use crate::GpsTime;
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::geodesy::{Geodetic, Look};

/// Heights over which the models speak, m; outside they give no delay.
const LOWEST_M: f64 = -1_000.0;
const TROPOSPHERE_TOP_M: f64 = 20_000.0;

/// Relative humidity of the standard atmosphere.
const HUMIDITY: f64 = 0.7;

/// Broadcast parameters of the Klobuchar model (IS-GPS-200 20.3.3.5.2.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Klobuchar {
    /// Amplitude polynomial: s, s/semicircle, s/semicircle^2, s/semicircle^3.
    pub alpha: [f64; 4],
    /// Period polynomial: s, s/semicircle, s/semicircle^2, s/semicircle^3.
    pub beta: [f64; 4],
}

impl Klobuchar {
    /// Delay of L1, m, of a signal arriving at `receiver` from `look` at `time`; zero below the
    /// horizontal and more than 1 km under the ellipsoid.
    ///
    /// IS-GPS-200 figure 20-4; removes about half of the true delay (rms). At dusk and dawn its series for a cosine ends
    /// 2 % of the amplitude above zero, where the delay steps by decimetres.
    #[must_use]
    pub fn delay_m(&self, receiver: &Geodetic, look: &Look, time: GpsTime) -> f64 {
        self.delay_by(receiver, look, time, |late_s, period_s| {
            let phase = 2.0 * PI * late_s / period_s;
            let square = phase * phase;
            let series = 1.0 - square / 2.0 + square * square / 24.0;
            if phase.abs() < 1.57 { series } else { 0.0 }
        })
    }

    /// Delay of L1, m, as [`Self::delay_m`], but without steps, as nature's: by the cosine itself, which ends at zero, and
    /// as far before 14 h as after it (IS-GPS-200 cuts periods of more than 40 h at midnight).
    #[must_use]
    pub fn steady_delay_m(&self, receiver: &Geodetic, look: &Look, time: GpsTime) -> f64 {
        self.delay_by(receiver, look, time, |late_s, period_s| {
            let apart_s = late_s.abs().min(86_400.0 - late_s.abs());
            (2.0 * PI * apart_s / period_s).min(PI / 2.0).cos()
        })
    }

    fn delay_by(
        &self,
        receiver: &Geodetic,
        look: &Look,
        time: GpsTime,
        cosine: impl Fn(f64, f64) -> f64,
    ) -> f64 {
        let elevation = look.elevation_rad / PI;
        if elevation <= 0.0 || receiver.height_m < LOWEST_M {
            return 0.0;
        }
        // All angles in semicircles: earth angle, pierce point, its geomagnetic latitude.
        let earth = 0.0137 / (elevation + 0.11) - 0.022;
        let lat = (receiver.lat_rad / PI + earth * look.azimuth_rad.cos()).clamp(-0.416, 0.416);
        let lon = receiver.lon_rad / PI + earth * look.azimuth_rad.sin() / (lat * PI).cos();
        let magnetic = lat + 0.064 * ((lon - 1.617) * PI).cos();
        let local_s = (43_200.0 * lon + time.tow_s()).rem_euclid(86_400.0);
        let slant = 1.0 + 16.0 * (0.53 - elevation).powi(3);
        let period_s = polynomial(&self.beta, magnetic).max(72_000.0);
        let cosine = cosine(local_s - 50_400.0, period_s);
        let by_day_s = polynomial(&self.alpha, magnetic).max(0.0) * cosine;
        SPEED_OF_LIGHT_MPS * slant * (5e-9 + by_day_s)
    }
}

fn polynomial(coefficients: &[f64; 4], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Delay of the troposphere, m, at elevation `elevation_rad`; zero below the horizontal, above
/// 20 km and more than 1 km under the ellipsoid.
///
/// Saastamoinen (1972) with a standard atmosphere, as RTKLIB's `tropmodel` with 70 % humidity:
/// p = 1013.25 (1 - 2.2557e-5 h)^5.2568 hPa, T = 288.16 - 6.5e-3 h K (constant above 11 km),
/// e = 6.108 * 0.7 exp((17.15 T - 4684) / (T - 38.45)) hPa, h the height, not less than 0;
/// dry 0.0022768 p / (1 - 0.00266 cos(2 lat) - 0.00028 h/km), wet 0.002277 (1255 / T + 0.05) e,
/// both divided by the sine of the elevation (optimistic below 5 degrees).
#[must_use]
pub fn saastamoinen_delay_m(receiver: &Geodetic, elevation_rad: f64) -> f64 {
    if elevation_rad <= 0.0 || !(LOWEST_M..=TROPOSPHERE_TOP_M).contains(&receiver.height_m) {
        return 0.0;
    }
    let height_m = receiver.height_m.max(0.0);
    let pressure_hpa = 1013.25 * (1.0 - 2.2557e-5 * height_m).powf(5.2568);
    let temperature_k = 288.16 - 6.5e-3 * height_m.min(11_000.0);
    let vapour_hpa =
        6.108 * HUMIDITY * ((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45)).exp();
    let gravity = 1.0 - 0.002_66 * (2.0 * receiver.lat_rad).cos() - 0.000_28 * height_m / 1e3;
    let dry_m = 0.002_276_8 * pressure_hpa / gravity;
    let wet_m = 0.002_277 * (1255.0 / temperature_k + 0.05) * vapour_hpa;
    (dry_m + wet_m) / elevation_rad.sin().max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BRAUNSCHWEIG: Klobuchar = Klobuchar {
        alpha: [1.77e-8, -7.451e-9, -5.96e-8, 1.192e-7],
        beta: [131_100.0, -131_100.0, 65_540.0, -262_100.0],
    };

    fn look(azimuth_rad: f64, elevation_rad: f64) -> Look {
        Look {
            azimuth_rad,
            elevation_rad,
        }
    }

    #[test]
    fn night_delay_at_the_zenith_is_five_nanoseconds() {
        // 2 h local time at longitude 0; the slant factor at the zenith is 1 + 16 * 0.03^3.
        let here = Geodetic::from_degrees(45.0, 0.0, 0.0);
        let delay_m = BRAUNSCHWEIG.delay_m(&here, &look(0.0, PI / 2.0), GpsTime::new(0, 7_200.0));
        let expected_m = SPEED_OF_LIGHT_MPS * 5e-9 * (1.0 + 16.0 * 0.03f64.powi(3));
        assert!((delay_m - expected_m).abs() < 1e-12);
    }

    #[test]
    fn zenith_troposphere_at_sea_level() {
        // Dry 0.0022768 * 1013.25 at 45 degrees; wet of 11.9 hPa vapour at 15 C: 0.12 m.
        let delay_m = saastamoinen_delay_m(&Geodetic::from_degrees(45.0, 0.0, 0.0), PI / 2.0);
        assert!((delay_m - 2.307 - 0.120).abs() < 2e-3, "{delay_m}");
    }

    #[test]
    fn outside_their_range_the_models_are_zero() {
        let deep = Geodetic::from_degrees(0.0, 0.0, -6_378_137.0);
        let high = Geodetic::from_degrees(0.0, 0.0, 57_447.0);
        assert_eq!(saastamoinen_delay_m(&deep, 1.0), 0.0);
        assert_eq!(saastamoinen_delay_m(&high, 1.0), 0.0);
        assert_eq!(
            saastamoinen_delay_m(&Geodetic::from_degrees(0.0, 0.0, 0.0), -0.1),
            0.0
        );
        let noon = GpsTime::new(0, 50_400.0);
        assert_eq!(BRAUNSCHWEIG.delay_m(&deep, &look(0.0, 1.0), noon), 0.0);
        assert!(BRAUNSCHWEIG.delay_m(&high, &look(0.0, 1.0), noon) > 1.0);
    }

    #[test]
    fn the_steady_delay_does_not_step() {
        let delays = |lat_deg, tow_s| {
            let here = Geodetic::from_degrees(lat_deg, 10.0, 0.0);
            let (look, time) = (look(1.0, 0.8), GpsTime::new(0, tow_s));
            let stepping = BRAUNSCHWEIG.delay_m(&here, &look, time);
            (stepping, BRAUNSCHWEIG.steady_delay_m(&here, &look, time))
        };
        // By magnetic latitude the period is from 20 h (the day ends at dusk) to more than 40 h (it never does).
        for lat_deg in [-50.0, -30.0, 0.0, 30.0, 52.0] {
            let (mut largest, mut steady) = (0.0_f64, 0.0_f64);
            for tow_s in 0..86_400 {
                let before = delays(lat_deg, f64::from(tow_s));
                let after = delays(lat_deg, f64::from(tow_s + 1));
                largest = largest.max((after.0 - before.0).abs());
                steady = steady.max((after.1 - before.1).abs());
            }
            // 2 % of an amplitude of metres and more; a cosine of 8 m over 20 h falls by 0.7 mm/s.
            assert!(largest > 0.05, "{lat_deg}: {largest}");
            assert!(steady < 2e-3, "{lat_deg}: {steady}");
            // Forty minutes from 14 h the series is exact to a millimetre.
            let noon = delays(lat_deg, 50_400.0 - 2_400.0);
            assert!((noon.0 - noon.1).abs() < 1e-3, "{lat_deg}: {noon:?}");
        }
    }

    proptest! {
        #[test]
        fn delays_are_finite_and_positive_above_the_horizontal(
            lat in -1.571..1.571f64, lon in -3.15..3.15f64, height in -999.0..19_999.0f64,
            azimuth in 0.0..6.3f64, elevation in 1e-9..1.57f64, tow in 0.0..604_800.0f64,
        ) {
            let here = Geodetic { lat_rad: lat, lon_rad: lon, height_m: height };
            let time = GpsTime::new(2200, tow);
            let ionosphere = BRAUNSCHWEIG.delay_m(&here, &look(azimuth, elevation), time);
            let troposphere = saastamoinen_delay_m(&here, elevation);
            // 5 ns is the least; 11 times (20 + 80) ns are more than any parameters here give.
            prop_assert!((1.4..400.0).contains(&ionosphere));
            prop_assert!(troposphere > 0.0 && troposphere.is_finite());
        }
    }
}
