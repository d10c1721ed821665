//! The plainest transmitter: one ray, constant power.

use anyhow::Result;
use gnss_nav::GpsTime;
use gnss_signal::SignalId;

use super::antenna::{Emitter, Ray};
use super::message::{BitStream, Message};
use super::path::SignalPath;

/// One signal on one path at constant power.
pub struct PlainEmitter {
    signal: SignalId,
    amplitude: f64,
    path: Box<dyn SignalPath>,
    bits: BitStream,
}

impl PlainEmitter {
    /// A signal of `cn0_dbhz` (carrier power over noise density before the front end).
    #[must_use]
    pub fn new(
        signal: SignalId,
        cn0_dbhz: f64,
        path: Box<dyn SignalPath>,
        message: Message,
    ) -> Self {
        Self {
            signal,
            amplitude: 10f64.powf(cn0_dbhz / 20.0),
            path,
            bits: BitStream::new(message),
        }
    }
}

impl Emitter for PlainEmitter {
    fn signal(&self) -> SignalId {
        self.signal
    }

    fn edges_s(&self) -> &[f64] {
        &[]
    }

    fn rays(&mut self, elapsed_s: f64, _within_s: f64, rays: &mut Vec<Ray>) -> Result<()> {
        rays.push(Ray {
            amplitude: self.amplitude,
            arrival: self.path.arrival(elapsed_s)?,
        });
        Ok(())
    }

    fn bit_sign(&mut self, second: GpsTime, index: usize) -> Result<f32> {
        self.bits.sign(second, index)
    }
}
