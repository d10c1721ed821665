//! A receiver at rest or in a vehicle, its clock, and the satellites over it.

use gnss_nav::dynamics::ClockNoise;
use gnss_nav::{Geodetic, GpsTime, MeasurementModel, NavState, SatelliteId, SatelliteState};
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_nav::measurement::ErrorModel;

/// Distance to the satellites, m.
const DISTANCE_M: f64 = 2.2e7;
/// Speed of the vehicle on its circle, m/s, and rate of its heading, rad/s: 1 m/s^2.
const SPEED_MPS: f64 = 10.0;
const TURN_RAD_S: f64 = 0.1;

/// How the receiver moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Not at all.
    Rest,
    /// On a level circle, 10 m/s and 1 m/s^2.
    Vehicle,
}

/// The truth at an instant of the receiver's clock.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Position, velocity, clock.
    pub state: NavState,
    motion: Motion,
    heading_rad: f64,
    ecef_from_enu: Matrix3<f64>,
}

/// No delays, and no errors but those of tracking.
#[must_use]
pub const fn model() -> MeasurementModel {
    MeasurementModel {
        ionosphere: None,
        troposphere: false,
        elevation_mask_rad: -1.0,
        errors: ErrorModel::TRACKING_NOISE_ONLY,
    }
}

impl Truth {
    /// At the start of a run.
    #[must_use]
    pub fn new(motion: Motion) -> Self {
        let place = Geodetic::from_degrees(40.0, 116.3, 50.0);
        let mut truth = Self {
            state: NavState {
                time: GpsTime::from_parts(2350, 392_400, 0.0),
                position_ecef_m: place.to_ecef(),
                velocity_ecef_mps: Vector3::zeros(),
                clock_bias_m: 0.0,
                clock_drift_mps: 30.0,
            },
            motion,
            heading_rad: 0.0,
            ecef_from_enu: place.enu_from_ecef().transpose(),
        };
        truth.state.velocity_ecef_mps = truth.velocity();
        truth
    }

    fn velocity(&self) -> Vector3<f64> {
        let speed_mps = match self.motion {
            Motion::Rest => 0.0,
            Motion::Vehicle => SPEED_MPS,
        };
        let (sin, cos) = self.heading_rad.sin_cos();
        self.ecef_from_enu * Vector3::new(sin, cos, 0.0) * speed_mps
    }

    /// Goes on until the receiver's clock reads `receive_time`.
    pub fn advance(&mut self, receive_time: GpsTime, clock: &ClockNoise, rng: &mut ChaCha8Rng) {
        let to = self.state.gps_time(receive_time);
        let interval_s = to - self.state.time;
        let before = self.state;
        self.heading_rad += TURN_RAD_S * interval_s;
        self.state = before.at(to);
        self.state.velocity_ecef_mps = self.velocity();
        let change = self.state.velocity_ecef_mps - before.velocity_ecef_mps;
        self.state.position_ecef_m += change * (interval_s / 2.0);
        let (white, walk): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
        self.state.clock_bias_m += (clock.white_m2_per_s * interval_s).sqrt() * white;
        self.state.clock_drift_mps += (clock.random_walk_m2_per_s3 * interval_s).sqrt() * walk;
    }

    /// Satellites over the receiver: one near the zenith, the others in rings.
    #[must_use]
    pub fn sky(&self, satellites: usize) -> Vec<(SatelliteId, SatelliteState)> {
        let rings: &[(f64, usize)] = match satellites {
            0..=5 => &[(80.0, 1), (30.0, 4)],
            _ => &[(85.0, 1), (50.0, 4), (20.0, 6)],
        };
        let angles = rings.iter().flat_map(|(elevation_deg, count)| {
            let step_deg = 360.0 / *count as f64;
            (0..*count).map(move |k| (*elevation_deg, step_deg * (k as f64 + 0.3)))
        });
        let satellite = |(k, (elevation_deg, azimuth_deg)): (usize, (f64, f64))| {
            let (sin_el, cos_el) = elevation_deg.to_radians().sin_cos();
            let (sin_az, cos_az) = azimuth_deg.to_radians().sin_cos();
            let toward = Vector3::new(cos_el * sin_az, cos_el * cos_az, sin_el);
            let state = SatelliteState {
                position_ecef_m: self.state.position_ecef_m
                    + self.ecef_from_enu * toward * DISTANCE_M,
                velocity_ecef_mps: Vector3::zeros(),
                clock_bias_s: 0.0,
                clock_drift: 0.0,
            };
            (SatelliteId::gps(k as u8 + 1), state)
        };
        angles.take(satellites).enumerate().map(satellite).collect()
    }
}

/// Pseudorange, m, and its rate, m/s, that a receiver in `state` expects when its clock reads
/// `receive_time`.
#[must_use]
pub fn expected(state: &NavState, satellite: &SatelliteState, receive_time: GpsTime) -> (f64, f64) {
    let expected = state.expect_from(satellite, receive_time, &model());
    let range_m = SPEED_OF_LIGHT_MPS * (receive_time - expected.transmit_time);
    (range_m, expected.range_rate_mps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnss_nav::dynamics::ClockNoise;
    use rand::SeedableRng;

    #[test]
    fn a_vehicle_keeps_to_its_circle() {
        let mut truth = Truth::new(Motion::Vehicle);
        let start = truth.state;
        let steady = ClockNoise {
            white_m2_per_s: 0.0,
            random_walk_m2_per_s3: 0.0,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut time, mut farthest_m) = (start.time, 0.0f64);
        for _ in 0..6283 {
            time = time + 0.01;
            truth.advance(time, &steady, &mut rng);
            let away = truth.state.position_ecef_m - start.position_ecef_m;
            farthest_m = farthest_m.max(away.norm());
        }
        // A circle of 100 m, once round in 62.83 s; trapezoids of 10 ms are off by far less than 1 cm.
        assert!((farthest_m - 200.0).abs() < 0.01, "{farthest_m}");
        let back = truth.state.position_ecef_m - start.position_ecef_m;
        assert!(back.norm() < 0.1, "{back}");
        assert!((truth.state.clock_bias_m - 30.0 * 62.83).abs() < 0.01);
    }

    #[test]
    fn eleven_or_five_satellites_stand_above_the_horizon() {
        let truth = Truth::new(Motion::Rest);
        for count in [5, 11] {
            let sky = truth.sky(count);
            assert_eq!(sky.len(), count);
            for (_, satellite) in &sky {
                let path = satellite.position_ecef_m - truth.state.position_ecef_m;
                let up = truth.state.position_ecef_m.normalize();
                assert!(path.normalize().dot(&up) > 0.3);
            }
        }
    }
}
