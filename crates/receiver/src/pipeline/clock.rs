//! The receiver's clock: GPS time of a tick.

use gnss_nav::GpsTime;
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;

/// The receiver's clock: runs with the samples from a set reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ReceiverClock {
    pub(super) tick: u64,
    pub(super) time: GpsTime,
    pub(super) trust: ClockTrust,
    sample_rate_hz: f64,
}

/// How well the clock is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ClockTrust {
    /// To less than the time between two bits, by a message, but before any fix.
    Message,
    /// To a small part of a code period: pseudoranges are unambiguous.
    Fix,
    /// Only roughly, by aiding or a coarse-time solution.
    Coarse,
}

impl ReceiverClock {
    pub(super) const fn new(
        tick: u64,
        time: GpsTime,
        trust: ClockTrust,
        sample_rate_hz: f64,
    ) -> Self {
        Self {
            tick,
            time,
            trust,
            sample_rate_hz,
        }
    }

    /// Reading at `tick`.
    pub(super) fn at(&self, tick: u64) -> GpsTime {
        let ahead = tick as f64 - self.tick as f64;
        self.time + ahead / self.sample_rate_hz
    }

    /// Sets the clock so that a bias found at it becomes zero.
    pub(super) fn correct(&mut self, bias_m: f64) {
        self.time = self.time - bias_m / SPEED_OF_LIGHT_MPS;
        self.trust = ClockTrust::Fix;
    }
}
