//! Round and round on a level circle.

use anyhow::{Result, ensure};
use nalgebra::Vector3;
use serde::Deserialize;

use super::local::integrate;
use super::{Place, Trajectory};

/// A vehicle on a circle, turning left.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CircleSpec {
    /// Where it starts, on the circle.
    start: Place,
    /// Heading at the start, clockwise from north, degrees.
    #[serde(default)]
    heading_deg: f64,
    /// Speed, m/s.
    speed_mps: f64,
    /// Radius, m: the acceleration is speed^2 / radius.
    radius_m: f64,
}

impl CircleSpec {
    pub(super) fn trajectory(&self, duration_s: f64) -> Result<Trajectory> {
        ensure!(
            (1.0..=1e6).contains(&self.radius_m),
            "radius_m is {}: expected 1 to 1e6",
            self.radius_m
        );
        let turn_rad_s = -self.speed_mps / self.radius_m;
        integrate(&self.start.geodetic()?, duration_s, |time_s| {
            let (sin, cos) = (self.heading_deg.to_radians() + turn_rad_s * time_s).sin_cos();
            Vector3::new(sin, cos, 0.0) * self.speed_mps
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_ends_where_it_began() {
        let spec = CircleSpec {
            start: Place {
                lat_deg: 48.0,
                lon_deg: 11.0,
                height_m: 500.0,
            },
            heading_deg: 30.0,
            speed_mps: 10.0,
            radius_m: 100.0,
        };
        let round_s = std::f64::consts::TAU * 10.0;
        let curve = spec.trajectory(round_s).unwrap();
        let (begin, end) = (curve.at(0.0), curve.at(round_s));
        // Headings count from the local north, which turns with the longitude: the circle misses
        // its start by its area times tan(latitude) over the earth's radius, 5.5 mm.
        assert!((begin.position_ecef_m - end.position_ecef_m).norm() < 6e-3);
        let across = (curve.at(round_s / 2.0).position_ecef_m - begin.position_ecef_m).norm();
        assert!((across - 200.0).abs() < 0.01, "{across}");
    }
}
