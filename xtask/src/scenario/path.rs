//! From a satellite to the receiver's antenna: when what arrives was sent.

use anyhow::Result;
use gnss_nav::atmosphere::{Klobuchar, saastamoinen_delay_m};
use gnss_nav::constants::{L1_HZ, SPEED_OF_LIGHT_MPS};
use gnss_nav::prediction::{ReceiverState, predict};
use gnss_nav::{Ephemeris, Geodetic, GpsTime};
use nalgebra::Vector3;

use super::antenna::Arrival;

/// Where a signal's code and carrier stand when they arrive.
pub trait SignalPath: Send {
    /// What arrives when the receiver's clock has run for `elapsed_s` since the first sample
    /// (below zero: before it).
    ///
    /// # Errors
    /// Where the path has no answer.
    fn arrival(&self, elapsed_s: f64) -> Result<Arrival>;
}

/// A signal of constant Doppler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UniformPath {
    /// Reading of the satellite's clock in the code that arrives with the first sample.
    pub code_time: GpsTime,
    /// Doppler of carrier and code, Hz of L1.
    pub doppler_hz: f64,
}

impl SignalPath for UniformPath {
    fn arrival(&self, elapsed_s: f64) -> Result<Arrival> {
        Ok(Arrival {
            code_time: self.code_time + elapsed_s * (1.0 + self.doppler_hz / L1_HZ),
            carrier_cycles: self.doppler_hz * elapsed_s,
        })
    }
}

/// A receiver in uniform motion, with its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReceiverMotion {
    /// GPS time of the first sample.
    pub start: GpsTime,
    /// Position at the first sample, ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// Velocity, ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
    /// Rate at which the receiver's clock gains on GPS time, s/s.
    pub clock_drift: f64,
}

impl ReceiverMotion {
    /// GPS seconds passed since the first sample when the receiver's clock counts `elapsed_s`.
    #[must_use]
    pub fn true_elapsed_s(&self, elapsed_s: f64) -> f64 {
        elapsed_s / (1.0 + self.clock_drift)
    }

    /// Position when the receiver's clock counts `elapsed_s`, ECEF, m.
    #[must_use]
    pub fn position_at(&self, elapsed_s: f64) -> Vector3<f64> {
        self.position_ecef_m + self.velocity_ecef_mps * self.true_elapsed_s(elapsed_s)
    }
}

/// Delays on the way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Atmosphere {
    /// Ionosphere: delays the code, advances the carrier.
    pub ionosphere: Option<Klobuchar>,
    /// Whether the Saastamoinen troposphere delays both.
    pub troposphere: bool,
}

/// From a satellite that flies its ephemeris to a moving receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitPath {
    /// The satellite's orbit and clock.
    pub ephemeris: Ephemeris,
    /// The receiver.
    pub receiver: ReceiverMotion,
    /// What lies between.
    pub atmosphere: Atmosphere,
}

impl SignalPath for OrbitPath {
    /// The transmit time is solved iteratively in the frame of reception (earth rotation
    /// included); the atmosphere's delay is taken off it, which neglects the range rate over that
    /// delay: 0.1 mm for 30 m.
    fn arrival(&self, elapsed_s: f64) -> Result<Arrival> {
        let receiver = &self.receiver;
        let position_ecef_m = receiver.position_at(elapsed_s);
        let time = receiver.start + receiver.true_elapsed_s(elapsed_s);
        let expected = predict(
            &self.ephemeris,
            &ReceiverState {
                time,
                position_ecef_m,
                velocity_ecef_mps: receiver.velocity_ecef_mps,
                clock_drift_mps: receiver.clock_drift * SPEED_OF_LIGHT_MPS,
            },
        )?;
        let place = Geodetic::from_ecef(&position_ecef_m);
        let ionosphere_m = self
            .atmosphere
            .ionosphere
            .map_or(0.0, |model| model.delay_m(&place, &expected.look, time));
        let troposphere_m = if self.atmosphere.troposphere {
            saastamoinen_delay_m(&place, expected.look.elevation_rad)
        } else {
            0.0
        };
        let code_delay_s = (troposphere_m + ionosphere_m) / SPEED_OF_LIGHT_MPS;
        let carrier_delay_s = (troposphere_m - ionosphere_m) / SPEED_OF_LIGHT_MPS;
        let behind_s = expected.transmit_time - (receiver.start + elapsed_s);
        Ok(Arrival {
            code_time: expected.transmit_time - code_delay_s,
            carrier_cycles: L1_HZ * (behind_s - carrier_delay_s),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constellation::nominal;

    fn overhead() -> OrbitPath {
        let start = GpsTime::new(2350, 3_600.0);
        let ephemeris = nominal(start).unwrap()[4];
        let above = ephemeris.state_at(start).unwrap().position_ecef_m;
        let ground = Geodetic {
            height_m: 0.0,
            ..Geodetic::from_ecef(&above)
        };
        OrbitPath {
            ephemeris,
            receiver: ReceiverMotion {
                start,
                position_ecef_m: ground.to_ecef(),
                velocity_ecef_mps: Vector3::new(30.0, -20.0, 10.0),
                clock_drift: 4e-7,
            },
            atmosphere: Atmosphere::default(),
        }
    }

    #[test]
    fn range_clock_and_earth_rotation_agree_to_a_micrometre() {
        let path = overhead();
        for elapsed_s in [-0.01, 0.0, 0.5, 40.0] {
            let arrival = path.arrival(elapsed_s).unwrap();
            let received = path.receiver.start + path.receiver.true_elapsed_s(elapsed_s);
            let (sent, state) = path
                .ephemeris
                .state_at_transmission(arrival.code_time)
                .unwrap();
            let travel_s = received - sent;
            // An inertial frame that coincides with ECEF at reception.
            let turned = gnss_nav::constants::EARTH_RATE_RAD_S * travel_s;
            let (sin, cos) = turned.sin_cos();
            let p = state.position_ecef_m;
            let p = Vector3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
            let range_m = (p - path.receiver.position_at(elapsed_s)).norm();
            // Iteration and rounding each leave far less.
            assert!((range_m - SPEED_OF_LIGHT_MPS * travel_s).abs() < 1e-6);
        }
    }

    #[test]
    fn the_carrier_moves_with_the_code() {
        let path = overhead();
        let (a, b) = (path.arrival(1.0).unwrap(), path.arrival(3.0).unwrap());
        let code_cycles = L1_HZ * ((b.code_time - a.code_time) - 2.0);
        // Rounding of times near 1e5 s.
        assert!((code_cycles - (b.carrier_cycles - a.carrier_cycles)).abs() < 1e-5);
    }

    #[test]
    fn the_atmosphere_delays_the_code_and_parts_code_and_carrier() {
        let plain = overhead();
        let mut path = plain;
        path.atmosphere = Atmosphere {
            ionosphere: Some(Klobuchar {
                alpha: [1e-8, 0.0, 0.0, 0.0],
                beta: [1e5, 0.0, 0.0, 0.0],
            }),
            troposphere: true,
        };
        let (without, with) = (plain.arrival(0.0).unwrap(), path.arrival(0.0).unwrap());
        let code_m = SPEED_OF_LIGHT_MPS * (without.code_time - with.code_time);
        let carrier_m = SPEED_OF_LIGHT_MPS / L1_HZ * (without.carrier_cycles - with.carrier_cycles);
        // At the zenith: 2.3 to 2.5 m of troposphere,
        // 1.5 m of ionosphere at night to 4.5 m by day.
        let (troposphere_m, ionosphere_m) =
            ((code_m + carrier_m) / 2.0, (code_m - carrier_m) / 2.0);
        assert!((2.2..2.6).contains(&troposphere_m), "{troposphere_m}");
        assert!((1.4..4.6).contains(&ionosphere_m), "{ionosphere_m}");
    }

    #[test]
    fn a_uniform_path_advances_code_and_carrier_alike() {
        let path = UniformPath {
            code_time: GpsTime::new(2350, 5.0),
            doppler_hz: 1540.0,
        };
        let arrival = path.arrival(2.0).unwrap();
        // One chip in 1540 cycles.
        let chips = (arrival.code_time - path.code_time - 2.0) * 1.023e6;
        assert!((chips - 2.0).abs() < 1e-6);
        assert_eq!(arrival.carrier_cycles, 3080.0);
    }
}
