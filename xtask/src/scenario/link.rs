//! From one satellite to the receiver's antenna: geometry, atmosphere, both clocks.

use std::sync::Arc;

use anyhow::Result;
use gnss_nav::atmosphere::{Klobuchar, saastamoinen_delay_m};
use gnss_nav::constants::{L1_HZ, SPEED_OF_LIGHT_MPS};
use gnss_nav::{Ephemeris, Geodetic, GpsTime, Look};
use nalgebra::Vector3;

use super::antenna::Arrival;
use super::clock::ReceiverClock;
use super::orbit::{Orbit, Path};
use super::trajectory::Trajectory;

/// Between two evaluations of the atmosphere, s: straight between them, at 5 degrees of elevation
/// wrong by 20 um.
const NODE_S: f64 = 1.0;
/// Evaluations before the start, s.
const LEAD_S: f64 = 2.0;

/// Models of the delays on the way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Atmosphere {
    /// Ionosphere: delays the code, advances the carrier. Without the steps that a receiver's model of it has at dusk and
    /// dawn.
    pub ionosphere: Option<Klobuchar>,
    /// Whether the Saastamoinen troposphere delays both (it ends at 20 km of height).
    pub troposphere: bool,
}

/// The receiver as it truly is: where, when, by which clock.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Reading of the receiver's clock at the first sample.
    pub start: GpsTime,
    /// How it moves, by GPS time passed since `start`.
    pub trajectory: Trajectory,
    /// Its clock, by elapsed time.
    pub clock: ReceiverClock,
    /// What is covered, s of elapsed time.
    pub duration_s: f64,
}

/// Seen from the receiver at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sky {
    ionosphere_m: f64,
    troposphere_m: f64,
    look: Look,
}

/// A satellite as the receiver hears it.
#[derive(Debug, Clone)]
pub struct Link {
    truth: Arc<Truth>,
    orbit: Orbit,
    sky: Vec<Sky>,
}

impl Link {
    /// From the satellite that flies `ephemeris` to the receiver of `truth`.
    ///
    /// # Errors
    /// Where the ephemeris gives no state.
    pub fn new(truth: &Arc<Truth>, ephemeris: &Ephemeris, atmosphere: Atmosphere) -> Result<Self> {
        let orbit = Orbit::new(ephemeris, truth.start, truth.duration_s)?;
        let nodes = ((truth.duration_s + 2.0 * LEAD_S) / NODE_S).ceil() as usize + 2;
        let sky = (0..nodes).map(|k| {
            let time_s = k as f64 * NODE_S - LEAD_S;
            let position = truth.trajectory.at(time_s).position_ecef_m;
            let path = orbit.path(time_s, &position);
            sky(&position, &path, truth.start + time_s, atmosphere)
        });
        Ok(Self {
            sky: sky.collect(),
            truth: Arc::clone(truth),
            orbit,
        })
    }

    /// What arrives at `elapsed_s`, with the jumps of the receiver's clock that have happened by
    /// `within_s`, when the way is longer by `extra_m` and the receiver stands `shift_ecef_m`
    /// beside its place.
    #[must_use]
    pub fn arrival(&self, elapsed_s: f64, within_s: f64, extra: Extra) -> Arrival {
        let (bias_s, _) = self.truth.clock.at(elapsed_s, within_s);
        let time_s = elapsed_s - bias_s;
        let position = self.truth.trajectory.at(time_s).position_ecef_m + extra.shift_ecef_m;
        let path = self.orbit.path(time_s, &position);
        let (ionosphere_m, troposphere_m) = self.delays_m(time_s);
        let common_m = troposphere_m + extra.delay_m;
        // Satellite time minus the receiver's.
        let behind_s = path.behind_s - bias_s - common_m / SPEED_OF_LIGHT_MPS;
        let ionosphere_s = ionosphere_m / SPEED_OF_LIGHT_MPS;
        Arrival {
            code_time: self.truth.start + (elapsed_s + (behind_s - ionosphere_s)),
            carrier_cycles: L1_HZ * (behind_s + ionosphere_s),
        }
    }

    /// Delays of ionosphere and troposphere, m.
    fn delays_m(&self, time_s: f64) -> (f64, f64) {
        self.between(time_s, |a, b, u| {
            let mix = |a: f64, b: f64| a + (b - a) * u;
            (
                mix(a.ionosphere_m, b.ionosphere_m),
                mix(a.troposphere_m, b.troposphere_m),
            )
        })
        .unwrap_or_default()
    }

    /// Elevation at `time_s` after the start, rad.
    #[must_use]
    pub fn elevation_rad(&self, time_s: f64) -> f64 {
        let mix = |a: &Sky, b: &Sky, u: f64| {
            let (a, b) = (a.look.elevation_rad, b.look.elevation_rad);
            a + (b - a) * u
        };
        self.between(time_s, mix).unwrap_or_default()
    }

    /// Direction at `time_s` after the start, to the second.
    #[must_use]
    pub fn look(&self, time_s: f64) -> Look {
        let nearest = |a: &Sky, b: &Sky, u: f64| if u < 0.5 { a.look } else { b.look };
        self.between(time_s, nearest).unwrap_or(Look {
            azimuth_rad: 0.0,
            elevation_rad: 0.0,
        })
    }

    fn between<T>(&self, time_s: f64, value: impl Fn(&Sky, &Sky, f64) -> T) -> Option<T> {
        let at = ((time_s + LEAD_S) / NODE_S).max(0.0);
        let first = (at as usize).min(self.sky.len().saturating_sub(2));
        match self.sky.get(first..first + 2) {
            Some([a, b]) => Some(value(a, b, at - first as f64)),
            _ => None,
        }
    }

    /// The receiver's truth.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        &self.truth
    }
}

/// What lengthens a way beyond nature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extra {
    /// Code and carrier come later by this, m.
    pub delay_m: f64,
    /// They come as they would here, beside the true place, ECEF, m.
    pub shift_ecef_m: Vector3<f64>,
}

impl Default for Extra {
    fn default() -> Self {
        Self {
            delay_m: 0.0,
            shift_ecef_m: Vector3::zeros(),
        }
    }
}

fn sky(position: &Vector3<f64>, path: &Path, time: GpsTime, atmosphere: Atmosphere) -> Sky {
    let place = Geodetic::from_ecef(position);
    let look = place.look(&path.unit_ecef);
    let ionosphere = atmosphere.ionosphere;
    Sky {
        ionosphere_m: ionosphere.map_or(0.0, |model| model.steady_delay_m(&place, &look, time)),
        troposphere_m: if atmosphere.troposphere {
            saastamoinen_delay_m(&place, look.elevation_rad)
        } else {
            0.0
        },
        look,
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::prediction::{ReceiverState, predict};

    use super::*;
    use crate::scenario::clock::{ClockSpec, Preset};
    use crate::scenario::constellation::nominal;
    use crate::scenario::trajectory::TrajectorySpec;

    const KLOBUCHAR: Klobuchar = Klobuchar {
        alpha: [1.2e-8, 7.5e-9, -6.0e-8, -6.0e-8],
        beta: [98_304.0, 32_768.0, -196_608.0, -65_536.0],
    };

    fn truth(start: GpsTime) -> Arc<Truth> {
        let driving: TrajectorySpec = toml::from_str(
            "kind = 'circle'\nspeed_mps = 30.0\nradius_m = 90.0\n\
             start = { lat_deg = 47.0, lon_deg = 8.0, height_m = 400.0 }",
        )
        .unwrap();
        let clock = ClockSpec {
            preset: Preset::Tcxo,
            bias_s: 2e-3,
            drift: 4e-7,
            ..ClockSpec::default()
        };
        Arc::new(Truth {
            start,
            trajectory: driving.trajectory(60.0, std::path::Path::new("")).unwrap(),
            clock: ReceiverClock::new(&clock, 60.0, 7, vec![(30.0, 1e-3)]).unwrap(),
            duration_s: 60.0,
        })
    }

    #[test]
    fn code_and_carrier_are_what_the_models_predict() {
        let start = GpsTime::new(2350, 392_401.3);
        let truth = truth(start);
        let ephemeris = nominal(start).unwrap()[3];
        let atmosphere = Atmosphere {
            ionosphere: Some(KLOBUCHAR),
            troposphere: true,
        };
        let link = Link::new(&truth, &ephemeris, atmosphere).unwrap();
        for elapsed_s in [-0.02, 0.0, 10.123, 29.99, 30.0, 59.9] {
            let (bias_s, drift) = truth.clock.at(elapsed_s, elapsed_s);
            let time_s = elapsed_s - bias_s;
            let motion = truth.trajectory.at(time_s);
            let receiver = ReceiverState {
                time: start + time_s,
                position_ecef_m: motion.position_ecef_m,
                velocity_ecef_mps: motion.velocity_ecef_mps,
                clock_drift_mps: drift * SPEED_OF_LIGHT_MPS,
            };
            let expected = predict(&ephemeris, &receiver).unwrap();
            let place = Geodetic::from_ecef(&motion.position_ecef_m);
            let ionosphere_m = KLOBUCHAR.steady_delay_m(&place, &expected.look, receiver.time);
            let troposphere_m = saastamoinen_delay_m(&place, expected.look.elevation_rad);
            let arrival = link.arrival(elapsed_s, elapsed_s, Extra::default());
            let delay_s = (ionosphere_m + troposphere_m) / SPEED_OF_LIGHT_MPS;
            let code_m =
                SPEED_OF_LIGHT_MPS * (arrival.code_time - (expected.transmit_time - delay_s));
            // The atmosphere, straight over a second.
            assert!(code_m.abs() < 1e-4, "{code_m} m at {elapsed_s}");
            let behind_s = expected.transmit_time - (start + elapsed_s);
            let cycles = L1_HZ * (behind_s + (ionosphere_m - troposphere_m) / SPEED_OF_LIGHT_MPS);
            assert!((arrival.carrier_cycles - cycles).abs() < 1e-3);
        }
    }

    #[test]
    fn a_jump_of_the_clock_moves_code_and_carrier_at_its_instant() {
        let start = GpsTime::new(2350, 392_401.3);
        let truth = truth(start);
        let ephemeris = nominal(start).unwrap()[3];
        let link = Link::new(&truth, &ephemeris, Atmosphere::default()).unwrap();
        let before = link.arrival(30.0, 29.9, Extra::default());
        let after = link.arrival(30.0, 30.1, Extra::default());
        // Receiver ahead by 1 ms: what arrives is 1 ms older, less the range rate over it.
        assert!((before.code_time - after.code_time - 1e-3).abs() < 1e-8);
    }
}
