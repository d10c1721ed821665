//! How a receiver and its oscillator may move between epochs: the process noise of the filters.

use nalgebra::{Matrix3, Vector3};

use crate::NavError;
use crate::constants::{SPEED_OF_LIGHT_MPS, WGS84_ECCENTRICITY_SQUARED};

/// White acceleration of the receiver: its power spectral density per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelerationNoise {
    /// Along east and along north, each, m^2/s^3.
    pub horizontal_m2_per_s3: f64,
    /// Along up, m^2/s^3.
    pub vertical_m2_per_s3: f64,
}

impl AccelerationNoise {
    /// The same density q_a, m^2/s^3, along every axis.
    #[must_use]
    pub const fn isotropic(q_a_m2_per_s3: f64) -> Self {
        Self {
            horizontal_m2_per_s3: q_a_m2_per_s3,
            vertical_m2_per_s3: q_a_m2_per_s3,
        }
    }

    /// Density at `position_ecef_m` as a matrix in ECEF, m^2/s^3: q_h I + (q_v - q_h) u u', u up.
    ///
    /// u is normal to the ellipsoid through the point that has the shape of WGS-84, which is off
    /// the geodetic vertical by 6e-5 rad at 60 km.
    pub(crate) fn density_ecef(&self, position_ecef_m: &Vector3<f64>) -> Matrix3<f64> {
        let horizontal = self.horizontal_m2_per_s3;
        let difference = self.vertical_m2_per_s3 - horizontal;
        let up = vertical(position_ecef_m);
        Matrix3::from_diagonal_element(horizontal) + (up * up.transpose()) * difference
    }
}

/// Up at a point; any direction at the centre of the earth, where there is none.
fn vertical(position_ecef_m: &Vector3<f64>) -> Vector3<f64> {
    let stretch = 1.0 / (1.0 - WGS84_ECCENTRICITY_SQUARED);
    let p = position_ecef_m;
    Vector3::new(p.x, p.y, p.z * stretch)
        .try_normalize(0.0)
        .unwrap_or_else(Vector3::z)
}

/// Noise of a two-state oscillator: white frequency noise and a random walk of the frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockNoise {
    /// S_f, density that drives the bias, m^2/s.
    pub white_m2_per_s: f64,
    /// S_g, density that drives the drift, m^2/s^3.
    pub random_walk_m2_per_s3: f64,
}

impl ClockNoise {
    /// A temperature-compensated crystal of low quality: h0 = 2e-19 s, h-2 = 2e-20 Hz (Brown2012,
    /// chapter 9.3). S_f = 0.009 m^2/s, S_g = 0.035 m^2/s^3.
    #[must_use]
    pub fn tcxo() -> Self {
        Self::from_allan(2e-19, 2e-20)
    }

    /// An oven-controlled crystal: h0 = 2e-25 s, h-2 = 6e-25 Hz (Brown2012, chapter 9.3).
    /// S_f = 9e-9 m^2/s, S_g = 1.1e-6 m^2/s^3.
    #[must_use]
    pub fn ocxo() -> Self {
        Self::from_allan(2e-25, 6e-25)
    }

    /// A chip-scale atomic clock: Allan deviation 2.4e-10 at 1 s falling with the root of time
    /// (Kitching2005) gives h0 = 1.2e-19 s; h-2 = 4e-27 Hz is what reaches the 1e-11 of its long
    /// term after an hour. S_f = 0.005 m^2/s, S_g = 7e-9 m^2/s^3.
    #[must_use]
    pub fn csac() -> Self {
        Self::from_allan(1.2e-19, 4e-27)
    }

    /// From the coefficients h0 (s) and h-2 (Hz) of the density of fractional frequency:
    /// S_f = c^2 h0 / 2, S_g = 2 pi^2 c^2 h-2 (Brown2012, chapter 9.3).
    ///
    /// Flicker noise (h-1) has no finite state; for a crystal it lies below the other two at the
    /// intervals of a navigation filter.
    #[must_use]
    pub fn from_allan(h0_s: f64, h_minus_2_hz: f64) -> Self {
        let c2 = SPEED_OF_LIGHT_MPS * SPEED_OF_LIGHT_MPS;
        Self {
            white_m2_per_s: c2 * h0_s / 2.0,
            random_walk_m2_per_s3: 2.0 * std::f64::consts::PI.powi(2) * c2 * h_minus_2_hz,
        }
    }
}

/// Process noise of the eight states.
///
/// The default is a car or an aircraft between manoeuvres (1 m^2/s^3: 1 m/s of velocity after a
/// second) with a TCXO.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessNoise {
    /// Of the receiver's motion.
    pub acceleration: AccelerationNoise,
    /// Of its oscillator.
    pub clock: ClockNoise,
}

impl Default for ProcessNoise {
    fn default() -> Self {
        Self {
            acceleration: AccelerationNoise::isotropic(1.0),
            clock: ClockNoise::tcxo(),
        }
    }
}

impl ProcessNoise {
    /// Whether every density is finite and not negative.
    ///
    /// # Errors
    /// [`NavError::Value`] naming the first that is not.
    pub fn check(&self) -> Result<(), NavError> {
        let densities = [
            (
                "horizontal acceleration density, m^2/s^3",
                self.acceleration.horizontal_m2_per_s3,
            ),
            (
                "vertical acceleration density, m^2/s^3",
                self.acceleration.vertical_m2_per_s3,
            ),
            ("clock density S_f, m^2/s", self.clock.white_m2_per_s),
            (
                "clock density S_g, m^2/s^3",
                self.clock.random_walk_m2_per_s3,
            ),
        ];
        for (name, value) in densities {
            if !(value.is_finite() && value >= 0.0) {
                return Err(NavError::Value {
                    name,
                    value: value.to_string(),
                    expected: "0 or more, and finite",
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Geodetic;

    #[test]
    fn allan_coefficients_give_the_densities_of_the_textbook() {
        let tcxo = ClockNoise::tcxo();
        // c^2 1e-19 and c^2 2 pi^2 2e-20 by hand.
        assert!((tcxo.white_m2_per_s - 0.008_988).abs() < 1e-6);
        assert!((tcxo.random_walk_m2_per_s3 - 0.035_48).abs() < 1e-5);
    }

    #[test]
    fn the_chip_scale_clock_has_its_allan_deviation() {
        // Allan variance h0 / (2 tau) + 2 pi^2 / 3 h-2 tau; the figures are rounded to 3 %.
        let c2 = SPEED_OF_LIGHT_MPS.powi(2);
        let clock = ClockNoise::csac();
        let allan = |tau: f64| {
            let white = clock.white_m2_per_s / c2 / tau;
            let walk = clock.random_walk_m2_per_s3 / c2 * tau / 3.0;
            (white, walk, (white + walk).sqrt())
        };
        assert!((allan(1.0).2 / 2.4e-10 - 1.0).abs() < 0.03);
        assert!((allan(3600.0).1.sqrt() / 1e-11 - 1.0).abs() < 0.03);
    }

    #[test]
    fn horizontal_and_vertical_are_those_of_the_place() {
        let noise = AccelerationNoise {
            horizontal_m2_per_s3: 4.0,
            vertical_m2_per_s3: 0.25,
        };
        let place = Geodetic::from_degrees(35.0, 118.9, 57_000.0);
        let density = noise.density_ecef(&place.to_ecef());
        let enu = place.enu_from_ecef();
        let local = enu * density * enu.transpose();
        let expected = Matrix3::from_diagonal(&Vector3::new(4.0, 4.0, 0.25));
        // The vertical is off by 6e-5 rad at that height, which mixes 3.75 times that.
        assert!((local - expected).norm() < 5e-4, "{local}");
    }

    #[test]
    fn what_is_no_density_is_refused_by_name() {
        let noise = ProcessNoise {
            acceleration: AccelerationNoise::isotropic(-1.0),
            ..ProcessNoise::default()
        };
        let text = noise.check().unwrap_err().to_string();
        assert!(text.starts_with("horizontal acceleration density"));
        assert_eq!(ProcessNoise::default().check(), Ok(()));
        let centre = AccelerationNoise {
            horizontal_m2_per_s3: 1.0,
            vertical_m2_per_s3: 2.0,
        };
        let density = centre.density_ecef(&Vector3::zeros());
        assert!(density.iter().all(|x| x.is_finite()));
    }
}
