//! What arrives at the antenna, and the front end behind it: the door between a scenario and the
//! two levels that make signals of it.
//!
//! A [`Scene`] is turned into samples by [`if_signal`](super::if_signal) and into correlator sums by
//! [`correlator_level`](super::correlator_level). Neither knows an orbit, a trajectory or a fault.

use anyhow::{Result, ensure};
use gnss_nav::GpsTime;
use gnss_signal::SignalId;
use gnss_signal::sample::SampleDescription;

use super::profile::Profile;

/// What arrives of a satellite at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// Reading of the satellite's clock in the code and data that arrive.
    pub code_time: GpsTime,
    /// Phase of the carrier against an oscillator of exactly the carrier frequency by the
    /// receiver's clock, cycles; grows with positive Doppler.
    pub carrier_cycles: f64,
}

/// One way on which a signal arrives: straight, or by reflection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Square root of carrier power over noise density, Hz^(1/2), before the front end.
    pub amplitude: f64,
    /// Where its code and carrier stand.
    pub arrival: Arrival,
}

/// One transmitter: a satellite, or somebody who poses as one.
///
/// Time is `elapsed_s`: what the receiver's clock counts since the first sample (below zero:
/// before it). Rays are smooth between two [edges](Self::edges_s).
pub trait Emitter: Send {
    /// Its ranging code.
    fn signal(&self) -> SignalId;

    /// Instants at which rays appear, vanish or jump, in increasing order, s.
    fn edges_s(&self) -> &[f64];

    /// Appends the rays that arrive at `elapsed_s`, as they are in the stretch between edges that
    /// `within_s` lies in: the end of a stretch can so be asked for. Their number and order are
    /// the same throughout a stretch.
    ///
    /// # Errors
    /// Where the signal has no value, for want of an orbit.
    fn rays(&mut self, elapsed_s: f64, within_s: f64, rays: &mut Vec<Ray>) -> Result<()>;

    /// Sign of bit `index` (0 to 49) of the second of satellite time that begins at `second`: a
    /// one is negative.
    ///
    /// # Errors
    /// Where the message cannot be encoded.
    fn bit_sign(&mut self, second: GpsTime, index: usize) -> Result<f32>;
}

/// Kind of an interfering signal; frequencies are offsets from the carrier of L1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Waveform {
    /// A carrier.
    Tone {
        /// Offset, Hz.
        offset_hz: f64,
    },
    /// A carrier that sweeps up (or down) over and over, phase-continuous.
    Chirp {
        /// Offset where a sweep begins, Hz.
        from_hz: f64,
        /// Offset where it ends, Hz.
        to_hz: f64,
        /// Duration of a sweep, s.
        period_s: f64,
    },
    /// White Gaussian noise over a band centred on the carrier.
    Broadband {
        /// Two-sided width, Hz; wider than the front end: flat over all of it.
        width_hz: f64,
    },
}

/// On and off in turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulses {
    /// From one pulse to the next, s.
    pub period_s: f64,
    /// Part of it that is on, in (0, 1].
    pub duty: f64,
}

/// An interfering signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Interference {
    /// What it is.
    pub waveform: Waveform,
    /// Its power over the density of the thermal noise while it is on, dB-Hz, in elapsed time;
    /// silent outside the profile's first and last instant.
    pub level_dbhz: Profile,
    /// Pulsed from the profile's first instant on; none: continuous.
    pub pulses: Option<Pulses>,
}

/// Samples that were lost between antenna and file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Elapsed time of the first one lost, s.
    pub begin_s: f64,
    /// How long, s.
    pub duration_s: f64,
}

/// What holds the level at the quantiser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gain {
    /// Set once, for noise and signals without interference.
    Fixed,
    /// Follows the power of the samples.
    Automatic {
        /// Time constant, s.
        time_s: f64,
    },
}

/// From the antenna to sampled numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reception {
    /// The samples to make.
    pub samples: SampleDescription,
    /// Bits of the quantiser (1 to 8) where the format has room for more: odd levels about zero;
    /// none: all that the format holds.
    pub bits: Option<u8>,
    /// Two-sided bandwidth of the front-end filter, Hz, centred on the carrier; none: no filter.
    ///
    /// Of real samples, a band that reaches below zero or above half the sample rate folds, with
    /// its noise, as it does behind a real mixer; without a filter C/N0 counts what is folded.
    pub bandwidth_hz: Option<f64>,
    /// Level control.
    pub gain: Gain,
}

/// Everything that is received.
pub struct Scene {
    /// The front end.
    pub reception: Reception,
    /// Length of what is delivered, s of samples.
    pub duration_s: f64,
    /// The transmitters.
    pub emitters: Vec<Box<dyn Emitter>>,
    /// Interference.
    pub interference: Vec<Interference>,
    /// Lost samples, in increasing order, not overlapping.
    pub gaps: Vec<Gap>,
    /// Seed of the noise.
    pub seed: u64,
}

impl Scene {
    /// Checks what no type holds.
    ///
    /// # Errors
    /// Names the value that is impossible and what was expected.
    pub fn check(&self) -> Result<()> {
        let samples = &self.reception.samples;
        let (rate_hz, if_hz) = (samples.sample_rate_hz, samples.intermediate_frequency_hz);
        ensure!(
            (1.1e6..=1e9).contains(&rate_hz),
            "sample rate is {rate_hz} Hz: expected 1.1e6 to 1e9"
        );
        let limit_hz = rate_hz / 2.0;
        ensure!(
            if_hz.abs() <= limit_hz,
            "intermediate frequency is {if_hz} Hz: expected at most half the sample rate, {limit_hz} Hz"
        );
        ensure!(
            (0.0..=1e6).contains(&self.duration_s),
            "duration is {} s: expected 0 to 1e6",
            self.duration_s
        );
        if let Some(bandwidth_hz) = self.reception.bandwidth_hz {
            ensure!(
                (0.05..=0.95).contains(&(bandwidth_hz / rate_hz)),
                "front-end bandwidth is {bandwidth_hz} Hz: expected 0.05 to 0.95 of the sample rate"
            );
        }
        Ok(())
    }

    /// Number of samples delivered.
    #[must_use]
    pub fn length_ticks(&self) -> u64 {
        (self.duration_s * self.reception.samples.sample_rate_hz).round() as u64
    }
}
