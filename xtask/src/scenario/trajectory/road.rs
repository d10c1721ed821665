//! A road vehicle: legs of forward and sideways acceleration.

use anyhow::{Result, ensure};
use nalgebra::Vector3;
use serde::Deserialize;

use super::local::integrate;
use super::{Place, Trajectory};

/// Between two entries of the speed table, s: where the integration looks.
const ENTRY_S: f64 = 0.01;
/// Steps of integration of one entry.
const SUBSTEPS: usize = 10;
/// Slowest speed at which a vehicle can turn, m/s.
const SLOWEST_TURN_MPS: f64 = 0.5;

/// A vehicle that accelerates, brakes, stops and turns.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoadSpec {
    start: Place,
    /// Heading at the start, clockwise from north, degrees.
    heading_deg: f64,
    /// Speed at the start, m/s.
    #[serde(default)]
    speed_mps: f64,
    /// Time in which an acceleration builds up at the start of a leg, s.
    #[serde(default = "default_ease_s")]
    ease_s: f64,
    /// Whether the legs are driven over and over; otherwise straight on after the last.
    #[serde(default)]
    repeat: bool,
    /// What is driven.
    leg: Vec<Leg>,
}

const fn default_ease_s() -> f64 {
    0.5
}

/// A stretch of constant accelerations.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Leg {
    /// How long, s.
    duration_s: f64,
    /// Along the heading, m/s^2; braking ends at a stop.
    acceleration_mps2: f64,
    /// To the right, m/s^2.
    lateral_mps2: f64,
    /// Upwards, m/s.
    climb_mps: f64,
}

impl RoadSpec {
    pub(super) fn trajectory(&self, duration_s: f64) -> Result<Trajectory> {
        self.check()?;
        let table = self.drive(duration_s);
        integrate(&self.start.geodetic()?, duration_s, |time_s| {
            let entry = (time_s / ENTRY_S).round() as usize;
            let at = table.get(entry).or(table.last());
            at.map_or_else(Vector3::zeros, |drive| {
                let (sin, cos) = drive.heading_rad.sin_cos();
                Vector3::new(
                    sin * drive.speed_mps,
                    cos * drive.speed_mps,
                    drive.climb_mps,
                )
            })
        })
    }

    fn check(&self) -> Result<()> {
        ensure!(
            (0.0..=10.0).contains(&self.ease_s),
            "ease_s is {}: expected 0 to 10",
            self.ease_s
        );
        ensure!(
            (0.0..=500.0).contains(&self.speed_mps),
            "speed_mps is {}: expected 0 to 500",
            self.speed_mps
        );
        for leg in &self.leg {
            let possible = leg.duration_s > 0.0
                && leg.acceleration_mps2.abs() <= 100.0
                && leg.lateral_mps2.abs() <= 100.0
                && leg.climb_mps.abs() <= 100.0;
            ensure!(
                possible,
                "{leg:?}: expected a duration above 0, at most 100 m/s^2 and 100 m/s"
            );
        }
        Ok(())
    }

    /// Speed, heading and climb every [`ENTRY_S`].
    fn drive(&self, duration_s: f64) -> Vec<Drive> {
        let entries = (duration_s / ENTRY_S) as usize + 300;
        let mut drive = Drive {
            speed_mps: self.speed_mps,
            heading_rad: self.heading_deg.to_radians(),
            climb_mps: self.leg.first().map_or(0.0, |leg| leg.climb_mps),
        };
        let mut table = Vec::with_capacity(entries);
        for entry in 0..entries {
            table.push(drive);
            for substep in 0..SUBSTEPS {
                let step_s = ENTRY_S / SUBSTEPS as f64;
                let time_s = (entry * SUBSTEPS + substep) as f64 * step_s;
                drive.step(self.demand(time_s), step_s);
            }
        }
        table
    }

    /// The accelerations at `time_s`: those of its leg, growing out of those of the one before.
    fn demand(&self, time_s: f64) -> Leg {
        let round_s: f64 = self.leg.iter().map(|leg| leg.duration_s).sum();
        let mut left_s = match (self.repeat, round_s > 0.0) {
            (true, true) => time_s.rem_euclid(round_s),
            _ => time_s,
        };
        let wraps = self.repeat && time_s >= round_s;
        let mut before = if wraps { self.leg.last() } else { None };
        let rest = Leg {
            duration_s: f64::INFINITY,
            ..Leg::default()
        };
        for leg in self.leg.iter().chain([&rest]) {
            if left_s < leg.duration_s {
                let share = (left_s / self.ease_s.max(1e-9)).min(1.0);
                return before.map_or(*leg, |before| blend(before, leg, share));
            }
            left_s -= leg.duration_s;
            before = Some(leg);
        }
        rest
    }
}

fn blend(from: &Leg, to: &Leg, share: f64) -> Leg {
    let mix = |a: f64, b: f64| a + (b - a) * share;
    Leg {
        duration_s: to.duration_s,
        acceleration_mps2: mix(from.acceleration_mps2, to.acceleration_mps2),
        lateral_mps2: mix(from.lateral_mps2, to.lateral_mps2),
        climb_mps: mix(from.climb_mps, to.climb_mps),
    }
}

/// How a vehicle drives at an instant.
#[derive(Debug, Clone, Copy)]
struct Drive {
    speed_mps: f64,
    heading_rad: f64,
    climb_mps: f64,
}

impl Drive {
    fn step(&mut self, demand: Leg, step_s: f64) {
        if self.speed_mps > SLOWEST_TURN_MPS {
            self.heading_rad += demand.lateral_mps2 / self.speed_mps * step_s;
        }
        self.speed_mps = (self.speed_mps + demand.acceleration_mps2 * step_s).max(0.0);
        self.climb_mps = demand.climb_mps;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn road(leg: Vec<Leg>) -> RoadSpec {
        RoadSpec {
            start: Place {
                lat_deg: 40.0,
                lon_deg: 116.0,
                height_m: 40.0,
            },
            heading_deg: 90.0,
            speed_mps: 10.0,
            ease_s: 0.0,
            repeat: false,
            leg,
        }
    }

    fn leg(duration_s: f64, acceleration_mps2: f64, lateral_mps2: f64) -> Leg {
        Leg {
            duration_s,
            acceleration_mps2,
            lateral_mps2,
            climb_mps: 0.0,
        }
    }

    #[test]
    fn it_brakes_to_a_stop_and_stays() {
        let curve = road(vec![leg(10.0, -2.0, 0.0)]).trajectory(20.0).unwrap();
        let way = (curve.at(20.0).position_ecef_m - curve.at(0.0).position_ecef_m).norm();
        // v^2 / 2a; the last step of integration before the stop is 1 ms of 2 mm/s.
        assert!((way - 25.0).abs() < 1e-2, "{way}");
        assert!(curve.at(15.0).velocity_ecef_mps.norm() < 1e-9);
    }

    #[test]
    fn a_quarter_turn_takes_what_its_acceleration_says() {
        // 10 m/s and 5 m/s^2: 0.5 rad/s, radius 20 m.
        let turn_s = std::f64::consts::PI;
        let curve = road(vec![leg(turn_s, 0.0, 5.0)])
            .trajectory(turn_s)
            .unwrap();
        let chord = (curve.at(turn_s).position_ecef_m - curve.at(0.0).position_ecef_m).norm();
        // Headings are taken every 10 ms at the start of 1 ms steps: 0.5 mrad of 28 m.
        assert!((chord - 20.0 * 2f64.sqrt()).abs() < 0.02, "{chord}");
    }

    #[test]
    fn legs_repeat_and_ease() {
        let mut road = road(vec![leg(2.0, 1.0, 0.0), leg(2.0, -1.0, 0.0)]);
        road.repeat = true;
        road.ease_s = 1.0;
        assert_eq!(road.demand(0.5).acceleration_mps2, 1.0);
        assert_eq!(road.demand(2.5).acceleration_mps2, 0.0);
        assert_eq!(road.demand(3.5).acceleration_mps2, -1.0);
        assert_eq!(road.demand(4.5).acceleration_mps2, 0.0);
        road.repeat = false;
        assert_eq!(road.demand(5.5).acceleration_mps2, 0.0);
    }
}
