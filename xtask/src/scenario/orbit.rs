//! A satellite's orbit and clock, quick to evaluate.

use anyhow::Result;
use gnss_nav::constants::{EARTH_RATE_RAD_S, SPEED_OF_LIGHT_MPS};
use gnss_nav::{Ephemeris, GpsTime, SatelliteState};
use nalgebra::Vector3;

/// Between two exact states, s. The cubic between them is exact to 3 nm and 1e-19 s: the fourth
/// derivative of a GPS orbit in ECEF is 6e-8 m/s^4.
const NODE_S: f64 = 2.0;
/// States before the start, s: a signal travels for less.
const LEAD_S: f64 = 4.0;

/// Exact states of a satellite at even steps, and the cubics between them.
#[derive(Debug, Clone)]
pub struct Orbit {
    states: Vec<SatelliteState>,
}

/// A signal on its straight way, as it arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Travel time, s.
    pub travel_s: f64,
    /// Reading of the satellite's clock at transmission minus the GPS time of reception, s.
    pub behind_s: f64,
    /// From the receiver to the satellite, in the ECEF frame of reception.
    pub unit_ecef: Vector3<f64>,
}

impl Orbit {
    /// The orbit of `ephemeris` from `start` over `duration_s`.
    ///
    /// # Errors
    /// Where the ephemeris gives no state.
    pub fn new(ephemeris: &Ephemeris, start: GpsTime, duration_s: f64) -> Result<Self> {
        let nodes = ((duration_s + 2.0 * LEAD_S) / NODE_S).ceil() as usize + 2;
        let states = (0..nodes)
            .map(|k| Ok(ephemeris.state_at(start + (k as f64 * NODE_S - LEAD_S))?))
            .collect::<Result<_>>()?;
        Ok(Self { states })
    }

    /// Position (ECEF of that instant, m) and clock bias (s) at `time_s` after the start.
    fn at(&self, time_s: f64) -> (Vector3<f64>, f64) {
        let at = ((time_s + LEAD_S) / NODE_S).max(0.0);
        let first = (at as usize).min(self.states.len().saturating_sub(2));
        let Some([a, b]) = self.states.get(first..first + 2) else {
            return (Vector3::zeros(), 0.0);
        };
        let u = at - first as f64;
        let (v, w) = (1.0 - u, u * u * (3.0 - 2.0 * u));
        // Weights of the slopes of a Hermite cubic.
        let (left, right) = (NODE_S * u * v * v, -NODE_S * u * u * v);
        let position = a.position_ecef_m * (1.0 - w)
            + b.position_ecef_m * w
            + a.velocity_ecef_mps * left
            + b.velocity_ecef_mps * right;
        let bias_s = a.clock_bias_s * (1.0 - w)
            + b.clock_bias_s * w
            + a.clock_drift * left
            + b.clock_drift * right;
        (position, bias_s)
    }

    /// The signal that a receiver at `receiver_ecef_m` receives at `time_s` after the start.
    ///
    /// The satellite is turned into the frame of reception by the angle of the travel time.
    #[must_use]
    pub fn path(&self, time_s: f64, receiver_ecef_m: &Vector3<f64>) -> Path {
        // A typical travel time, 10 ms off at most; each pass shrinks its error by 1e-5.
        let mut travel_s = 0.075;
        let mut to_satellite = Vector3::zeros();
        let mut bias_s = 0.0;
        for _ in 0..3 {
            let (position, bias) = self.at(time_s - travel_s);
            // Of 5e-6 rad: the next terms of both series are below 1e-22.
            let angle_rad = EARTH_RATE_RAD_S * travel_s;
            let square = angle_rad * angle_rad;
            let (sin, cos) = (angle_rad * (1.0 - square / 6.0), 1.0 - 0.5 * square);
            to_satellite = Vector3::new(
                cos * position.x + sin * position.y - receiver_ecef_m.x,
                cos * position.y - sin * position.x - receiver_ecef_m.y,
                position.z - receiver_ecef_m.z,
            );
            travel_s = to_satellite.norm() / SPEED_OF_LIGHT_MPS;
            bias_s = bias;
        }
        Path {
            travel_s,
            behind_s: bias_s - travel_s,
            unit_ecef: to_satellite / (SPEED_OF_LIGHT_MPS * travel_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::Geodetic;
    use gnss_nav::prediction::{ReceiverState, predict};

    use super::*;
    use crate::scenario::constellation::nominal;

    #[test]
    fn it_is_what_the_ephemeris_says() {
        let start = GpsTime::new(2350, 392_401.3);
        let receiver = Geodetic::from_degrees(47.0, 8.0, 400.0).to_ecef();
        let mut ephemeris = nominal(start).unwrap()[3];
        (ephemeris.eccentricity, ephemeris.af1, ephemeris.crs_m) = (0.02, 3e-11, 90.0);
        let orbit = Orbit::new(&ephemeris, start, 100.0).unwrap();
        for time_s in [-0.9, 0.0, 0.7, 33.33, 99.99] {
            let path = orbit.path(time_s, &receiver);
            let state = ReceiverState {
                time: start + time_s,
                position_ecef_m: receiver,
                velocity_ecef_mps: Vector3::zeros(),
                clock_drift_mps: 0.0,
            };
            let expected = predict(&ephemeris, &state).unwrap();
            let behind_s = expected.transmit_time - (start + time_s);
            // 10 um of range: rounding of week seconds in the ephemeris' polynomials.
            assert!((path.behind_s - behind_s).abs() < 3e-14);
        }
    }
}
