//! A flight along a great circle at constant speed.

use anyhow::{Result, ensure};
use gnss_nav::Geodetic;
use nalgebra::Vector3;
use serde::Deserialize;

use super::{Motion, Node, Place, Trajectory};

/// Between two nodes, s. The curve bends by the earth's radius: at 10 km/s the cubic between two
/// nodes is exact to a micrometre.
const STEP_S: f64 = 0.25;
/// Nodes before the start, s.
const LEAD_S: f64 = 2.0;
/// Fraction of the way over which its direction is differenced.
const DIFFERENCE: f64 = 1e-6;

/// Straight ahead from one place towards another, height changing evenly.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GreatCircleSpec {
    from: Place,
    /// The flight goes on beyond it where time is left.
    to: Place,
    /// Speed along the path, m/s.
    speed_mps: f64,
}

impl GreatCircleSpec {
    pub(super) fn trajectory(&self, duration_s: f64) -> Result<Trajectory> {
        let way = Way::new(&self.from.geodetic()?, &self.to.geodetic()?)?;
        ensure!(
            (1.0..=super::FASTEST_MPS).contains(&self.speed_mps),
            "speed_mps is {}: expected 1 to {}",
            self.speed_mps,
            super::FASTEST_MPS
        );
        let rate = |fraction: f64| self.speed_mps / way.slope(fraction).norm();
        let steps = ((duration_s + LEAD_S) / STEP_S).ceil() as i64;
        let lead = (LEAD_S / STEP_S).ceil() as i64;
        let mut fraction = -rate(0.0) * STEP_S * lead as f64;
        let mut nodes = Vec::new();
        for step in -lead..=steps {
            nodes.push(Node {
                time_s: step as f64 * STEP_S,
                motion: Motion {
                    position_ecef_m: way.at(fraction),
                    velocity_ecef_mps: way.slope(fraction) * rate(fraction),
                },
            });
            // The rate changes by parts in a thousand over the whole way: the midpoint is exact.
            let middle = fraction + rate(fraction) * STEP_S / 2.0;
            fraction = if step == -1 {
                0.0
            } else {
                fraction + rate(middle) * STEP_S
            };
        }
        Trajectory::new(nodes)
    }
}

/// A great circle of the sphere of ellipsoid normals.
struct Way {
    /// Normal at the start, and the unit vector at right angles to it along the way.
    start: Vector3<f64>,
    along: Vector3<f64>,
    angle_rad: f64,
    height_m: (f64, f64),
}

impl Way {
    fn new(from: &Geodetic, to: &Geodetic) -> Result<Self> {
        let normal = |place: &Geodetic| {
            let (sin, cos) = place.lat_rad.sin_cos();
            Vector3::new(cos * place.lon_rad.cos(), cos * place.lon_rad.sin(), sin)
        };
        let (start, end) = (normal(from), normal(to));
        let angle_rad = start.cross(&end).norm().atan2(start.dot(&end));
        ensure!(
            (1e-6..3.1).contains(&angle_rad),
            "from and to are {:.3} degrees apart: expected a little to 177",
            angle_rad.to_degrees()
        );
        Ok(Self {
            start,
            along: (end - start * start.dot(&end)).normalize(),
            angle_rad,
            height_m: (from.height_m, to.height_m),
        })
    }

    /// ECEF position after a fraction of the way, m.
    fn at(&self, fraction: f64) -> Vector3<f64> {
        let (sin, cos) = (fraction * self.angle_rad).sin_cos();
        let normal = self.start * cos + self.along * sin;
        let (from_m, to_m) = self.height_m;
        Geodetic {
            lat_rad: normal.z.clamp(-1.0, 1.0).asin(),
            lon_rad: normal.y.atan2(normal.x),
            height_m: from_m + (to_m - from_m) * fraction,
        }
        .to_ecef()
    }

    /// Derivative of the position by the fraction, m.
    fn slope(&self, fraction: f64) -> Vector3<f64> {
        (self.at(fraction + DIFFERENCE) - self.at(fraction - DIFFERENCE)) / (2.0 * DIFFERENCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The flight of `Jiang2017`.
    fn flight() -> GreatCircleSpec {
        GreatCircleSpec {
            from: Place {
                lat_deg: 33.1341,
                lon_deg: 118.974,
                height_m: 57_447.0,
            },
            to: Place {
                lat_deg: 35.4905,
                lon_deg: 118.974,
                height_m: 54_582.0,
            },
            speed_mps: 1000.0,
        }
    }

    #[test]
    fn the_flight_arrives_after_its_length_over_its_speed() {
        let curve = flight().trajectory(270.0).unwrap();
        // 263.7 km along the path.
        let end = flight().to.geodetic().unwrap().to_ecef();
        let miss = |time_s: f64| (curve.at(time_s).position_ecef_m - end).norm();
        assert!(miss(263.7) < 100.0, "{}", miss(263.7));
        let start = flight().from.geodetic().unwrap().to_ecef();
        assert!((curve.at(0.0).position_ecef_m - start).norm() < 1e-6);
    }

    #[test]
    fn speed_is_constant_and_the_derivative_of_position() {
        let curve = flight().trajectory(60.0).unwrap();
        for time_s in [-1.0, 0.0, 0.1, 17.33, 59.9] {
            let motion = curve.at(time_s);
            // Rounding of ECEF positions over the differenced metre.
            assert!((motion.velocity_ecef_mps.norm() - 1000.0).abs() < 1e-4);
            let (a, b) = (curve.at(time_s - 1e-3), curve.at(time_s + 1e-3));
            let slope = (b.position_ecef_m - a.position_ecef_m) / 2e-3;
            assert!((slope - motion.velocity_ecef_mps).norm() < 1e-4);
        }
    }
}
