//! Somebody who transmits a satellite's signal and leads the receiver away.

use std::sync::Arc;

use anyhow::Result;
use gnss_nav::{Geodetic, GpsTime};
use gnss_signal::SignalId;
use nalgebra::Vector3;

use super::antenna::{Emitter, Ray};
use super::broadcast::Broadcast;
use super::fault::Span;
use super::link::{Extra, Link};
use super::power::Power;

/// How a counterfeit signal leaves the true one.
#[derive(Debug, Clone, PartialEq)]
pub struct LiftOff {
    /// When it transmits.
    pub span: Span,
    /// Power over that of the satellite, dB.
    pub power_db: f64,
    /// Time after the onset during which it stays on the true signal, s.
    pub hold_s: f64,
    /// How fast its range grows then, m/s.
    pub lift_mps: f64,
    /// How fast the place it simulates moves then, east, north, up, m/s.
    pub drag_enu_mps: Vector3<f64>,
}

/// A counterfeit satellite: code, carrier and data of the true one, in phase with it at first.
pub struct Counterfeit {
    signal: SignalId,
    link: Arc<Link>,
    power: Power,
    lift_off: LiftOff,
    broadcast: Broadcast,
    edges_s: Vec<f64>,
}

impl Counterfeit {
    /// A counterfeit of the satellite of `signal`. Its rays also jump at `edges_s`.
    #[must_use]
    pub fn new(
        signal: SignalId,
        link: Arc<Link>,
        power: Power,
        lift_off: LiftOff,
        broadcast: Broadcast,
        mut edges_s: Vec<f64>,
    ) -> Self {
        edges_s.extend(lift_off.span.edges_s());
        edges_s.sort_by(f64::total_cmp);
        edges_s.dedup();
        Self {
            signal,
            link,
            power,
            lift_off,
            broadcast,
            edges_s,
        }
    }
}

impl Emitter for Counterfeit {
    fn signal(&self) -> SignalId {
        self.signal
    }

    fn edges_s(&self) -> &[f64] {
        &self.edges_s
    }

    fn rays(&mut self, elapsed_s: f64, within_s: f64, rays: &mut Vec<Ray>) -> Result<()> {
        let lift_off = &self.lift_off;
        if !lift_off.span.contains(within_s) {
            return Ok(());
        }
        let led_s = (elapsed_s - lift_off.span.begin_s - lift_off.hold_s).max(0.0);
        let truth = self.link.truth();
        let time_s = elapsed_s - truth.clock.at(elapsed_s, within_s).0;
        let place = Geodetic::from_ecef(&truth.trajectory.at(time_s).position_ecef_m);
        let extra = Extra {
            delay_m: lift_off.lift_mps * led_s,
            shift_ecef_m: place.enu_from_ecef().transpose() * lift_off.drag_enu_mps * led_s,
        };
        let gain = 10f64.powf(lift_off.power_db / 20.0) * lift_off.span.share(elapsed_s);
        let elevation_rad = self.link.elevation_rad(time_s);
        rays.push(Ray {
            amplitude: self.power.amplitude(elapsed_s, elevation_rad) * gain,
            arrival: self.link.arrival(elapsed_s, within_s, extra),
        });
        Ok(())
    }

    fn bit_sign(&mut self, second: GpsTime, index: usize) -> Result<f32> {
        self.broadcast.sign(second, index)
    }
}
