//! How the receiver moves: positions and velocities through which a smooth curve runs.

mod circle;
mod great_circle;
mod local;
mod road;
mod table;

use anyhow::{Context, Result, ensure};
use gnss_nav::Geodetic;
use nalgebra::Vector3;
use serde::Deserialize;

use std::path::Path;

use circle::CircleSpec;
use great_circle::GreatCircleSpec;
use road::RoadSpec;
use table::{CsvSpec, WaypointsSpec};

/// Fastest trajectory, m/s.
const FASTEST_MPS: f64 = 20_000.0;

/// Trajectory of a scenario file.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum TrajectorySpec {
    /// At rest.
    Static(StaticSpec),
    /// A flight along a great circle.
    GreatCircle(GreatCircleSpec),
    /// A road vehicle.
    Road(RoadSpec),
    /// Round and round.
    Circle(CircleSpec),
    /// Through given places at given times.
    Waypoints(WaypointsSpec),
    /// From a file.
    Csv(CsvSpec),
}

/// A place.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Latitude, north positive, degrees.
    pub lat_deg: f64,
    /// Longitude, east positive, degrees.
    pub lon_deg: f64,
    /// Height over the ellipsoid, m.
    pub height_m: f64,
}

impl Place {
    /// The place, checked.
    ///
    /// # Errors
    /// Where it is not on or near the earth.
    pub fn geodetic(&self) -> Result<Geodetic> {
        let fits = self.lat_deg.abs() <= 90.0
            && self.lon_deg.abs() <= 360.0
            && (-1e3..=1e6).contains(&self.height_m);
        ensure!(
            fits,
            "place is {self:?}: expected degrees within 90 and 360, a height of -1 to 1000 km"
        );
        Ok(Geodetic::from_degrees(
            self.lat_deg,
            self.lon_deg,
            self.height_m,
        ))
    }
}

/// A receiver at rest.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaticSpec {
    at: Place,
}

impl TrajectorySpec {
    /// The trajectory over `duration_s`; files are looked for in `folder`.
    ///
    /// # Errors
    /// Names a value that is impossible, or a file that cannot be read.
    pub fn trajectory(&self, duration_s: f64, folder: &Path) -> Result<Trajectory> {
        let trajectory = match self {
            Self::Static(spec) => Trajectory::new(vec![Node {
                time_s: 0.0,
                motion: Motion {
                    position_ecef_m: spec.at.geodetic()?.to_ecef(),
                    velocity_ecef_mps: Vector3::zeros(),
                },
            }]),
            Self::GreatCircle(spec) => spec.trajectory(duration_s),
            Self::Road(spec) => spec.trajectory(duration_s),
            Self::Circle(spec) => spec.trajectory(duration_s),
            Self::Waypoints(spec) => spec.trajectory(),
            Self::Csv(spec) => spec.trajectory(folder),
        };
        trajectory.context("trajectory")
    }
}

/// Where the receiver is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
}

/// Motion at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Node {
    time_s: f64,
    motion: Motion,
}

/// A curve through nodes: between two of them the cubic that has their positions and
/// velocities, outside straight on.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    nodes: Vec<Node>,
}

impl Trajectory {
    fn new(nodes: Vec<Node>) -> Result<Self> {
        ensure!(!nodes.is_empty(), "there is no point");
        for node in &nodes {
            let (motion, speed) = (&node.motion, node.motion.velocity_ecef_mps.norm());
            ensure!(
                motion.position_ecef_m.iter().all(|x| x.is_finite()) && speed <= FASTEST_MPS,
                "moves at {speed} m/s at {} s: expected at most {FASTEST_MPS}",
                node.time_s
            );
        }
        ensure!(
            nodes.is_sorted_by(|a, b| a.time_s < b.time_s),
            "times do not increase"
        );
        Ok(Self { nodes })
    }

    /// Motion `time_s` after the start (GPS seconds; may be below zero).
    #[must_use]
    pub fn at(&self, time_s: f64) -> Motion {
        let after = self.nodes.partition_point(|node| node.time_s <= time_s);
        let before = after.checked_sub(1).and_then(|k| self.nodes.get(k));
        match (before, self.nodes.get(after)) {
            (Some(a), Some(b)) => between(a, b, time_s),
            (Some(node), None) | (None, Some(node)) => Motion {
                position_ecef_m: node.motion.position_ecef_m
                    + node.motion.velocity_ecef_mps * (time_s - node.time_s),
                ..node.motion
            },
            (None, None) => Motion {
                position_ecef_m: Vector3::zeros(),
                velocity_ecef_mps: Vector3::zeros(),
            },
        }
    }
}

fn between(a: &Node, b: &Node, time_s: f64) -> Motion {
    let step_s = b.time_s - a.time_s;
    let u = (time_s - a.time_s) / step_s;
    let chord = b.motion.position_ecef_m - a.motion.position_ecef_m;
    let (start, end) = (
        a.motion.velocity_ecef_mps * step_s,
        b.motion.velocity_ecef_mps * step_s,
    );
    // p = a + start u + (3 chord - 2 start - end) u^2 + (start + end - 2 chord) u^3
    let (square, cube) = (chord * 3.0 - start * 2.0 - end, start + end - chord * 2.0);
    Motion {
        position_ecef_m: a.motion.position_ecef_m + (start + (square + cube * u) * u) * u,
        velocity_ecef_mps: (start + (square * 2.0 + cube * (3.0 * u)) * u) / step_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(time_s: f64, x: f64, v: f64) -> Node {
        Node {
            time_s,
            motion: Motion {
                position_ecef_m: Vector3::new(x, 2.0 * x, 0.0),
                velocity_ecef_mps: Vector3::new(v, 2.0 * v, 0.0),
            },
        }
    }

    #[test]
    fn a_cubic_runs_through_the_nodes() {
        // x = t^3 - t at 1 and 3 s.
        let curve = Trajectory::new(vec![node(1.0, 0.0, 2.0), node(3.0, 24.0, 26.0)]).unwrap();
        for t in [1.0, 1.7, 2.2, 3.0] {
            let motion = curve.at(t);
            assert!((motion.position_ecef_m.y - 2.0 * (t * t * t - t)).abs() < 1e-12);
            assert!((motion.velocity_ecef_mps.x - (3.0 * t * t - 1.0)).abs() < 1e-12);
        }
        assert_eq!(curve.at(0.0).position_ecef_m.x, -2.0);
        assert_eq!(curve.at(4.0).position_ecef_m.x, 50.0);
    }

    #[test]
    fn impossible_curves_are_refused() {
        assert!(Trajectory::new(vec![]).is_err());
        assert!(Trajectory::new(vec![node(1.0, 0.0, 0.0), node(1.0, 0.0, 0.0)]).is_err());
        assert!(Trajectory::new(vec![node(0.0, 0.0, 1e6)]).is_err());
        assert!(Trajectory::new(vec![node(0.0, f64::NAN, 0.0)]).is_err());
    }
}
