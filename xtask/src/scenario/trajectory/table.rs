//! Through given places at given times, from the scenario file or a file of its own.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use nalgebra::Vector3;
use serde::Deserialize;

use super::{Motion, Node, Place, Trajectory};

/// Places at instants.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaypointsSpec {
    /// Time (s after the start), latitude, longitude (degrees), height (m).
    points: Vec<[f64; 4]>,
}

impl WaypointsSpec {
    pub(super) fn trajectory(&self) -> Result<Trajectory> {
        let place = |point: &[f64; 4]| {
            let place = Place {
                lat_deg: point[1],
                lon_deg: point[2],
                height_m: point[3],
            };
            Ok((point[0], place.geodetic()?.to_ecef()))
        };
        let points: Result<Vec<_>> = self.points.iter().map(place).collect();
        smooth(&points?)
    }
}

/// Positions from a file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CsvSpec {
    /// Columns `time_s,x_m,y_m,z_m` and, if known, `vx_mps,vy_mps,vz_mps` (ECEF), as truth.csv.
    file: PathBuf,
}

impl CsvSpec {
    pub(super) fn trajectory(&self, folder: &Path) -> Result<Trajectory> {
        let path = folder.join(&self.file);
        let text = std::fs::read_to_string(&path).with_context(|| format!("{}", path.display()))?;
        parse(&text).with_context(|| format!("{}", path.display()))
    }
}

fn parse(text: &str) -> Result<Trajectory> {
    let mut lines = text.lines().zip(1..);
    let header = lines.next().map_or("", |(line, _)| line);
    let columns: Vec<&str> = header.split(',').map(str::trim).collect();
    let find = |names: &[&str]| -> Option<Vec<usize>> {
        let place = |name: &&str| columns.iter().position(|column| column == name);
        names.iter().map(place).collect()
    };
    let Some(positions) = find(&["time_s", "x_m", "y_m", "z_m"]) else {
        bail!("line 1: expected columns time_s,x_m,y_m,z_m");
    };
    let velocities = find(&["vx_mps", "vy_mps", "vz_mps"]);
    let (mut points, mut speeds) = (Vec::new(), Vec::new());
    for (line, number) in lines.filter(|(line, _)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').collect();
        let value = |column: usize| -> Result<f64> {
            let field = fields.get(column).map(|field| field.trim());
            field.and_then(|field| field.parse().ok()).with_context(|| {
                format!("line {number}: expected a number in column {}", column + 1)
            })
        };
        let three = |columns: &[usize]| -> Result<Vector3<f64>> {
            Ok(Vector3::new(
                value(columns[0])?,
                value(columns[1])?,
                value(columns[2])?,
            ))
        };
        points.push((value(positions[0])?, three(&positions[1..])?));
        if let Some(columns) = &velocities {
            speeds.push(three(columns)?);
        }
    }
    if speeds.is_empty() {
        return smooth(&points);
    }
    let nodes = points
        .iter()
        .zip(speeds)
        .map(|(&(time_s, position_ecef_m), velocity)| Node {
            time_s,
            motion: Motion {
                position_ecef_m,
                velocity_ecef_mps: velocity,
            },
        });
    Trajectory::new(nodes.collect())
}

/// A curve through `points` (s, ECEF m) whose velocity at each is that between its neighbours.
fn smooth(points: &[(f64, Vector3<f64>)]) -> Result<Trajectory> {
    ensure!(
        points.is_sorted_by(|a, b| a.0 < b.0),
        "times do not increase"
    );
    let nodes = points
        .iter()
        .enumerate()
        .map(|(k, &(time_s, position_ecef_m))| {
            let (first, last) = (k.saturating_sub(1), (k + 1).min(points.len() - 1));
            let ((t0, p0), (t1, p1)) = (points[first], points[last]);
            let velocity_ecef_mps = if last > first {
                (p1 - p0) / (t1 - t0)
            } else {
                Vector3::zeros()
            };
            Node {
                time_s,
                motion: Motion {
                    position_ecef_m,
                    velocity_ecef_mps,
                },
            }
        });
    Trajectory::new(nodes.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_give_their_points() {
        let curve = parse("time_s,x_m,y_m,z_m\n0,1,0,0\n1,2,0,0\n2,5,0,0\n").unwrap();
        assert_eq!(curve.at(1.0).position_ecef_m.x, 2.0);
        assert_eq!(curve.at(1.0).velocity_ecef_mps.x, 2.0);
        let text = "vx_mps,vy_mps,vz_mps,time_s,x_m,y_m,z_m\n7,0,0, 0,1,0,0\n9,0,0,1,2,0,0\n";
        assert_eq!(parse(text).unwrap().at(1.0).velocity_ecef_mps.x, 9.0);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let message = |text| format!("{:#}", parse(text).unwrap_err());
        assert!(message("a,b\n").starts_with("line 1: expected columns"));
        assert_eq!(
            message("time_s,x_m,y_m,z_m\n0,1,0\n"),
            "line 2: expected a number in column 4"
        );
        assert!(message("time_s,x_m,y_m,z_m\n1,0,0,0\n0,0,0,0\n").contains("do not increase"));
        assert!(message("time_s,x_m,y_m,z_m\n").contains("no point"));
    }

    #[test]
    fn waypoints_are_passed_on_time() {
        let spec = WaypointsSpec {
            points: vec![[0.0, 50.0, 8.0, 100.0], [10.0, 50.001, 8.0, 110.0]],
        };
        let curve = spec.trajectory().unwrap();
        let there = gnss_nav::Geodetic::from_ecef(&curve.at(10.0).position_ecef_m);
        assert!((there.height_m - 110.0).abs() < 1e-6);
    }
}
