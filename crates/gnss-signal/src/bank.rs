//! The door between samples and tracking: replicas in, correlator sums out.
//!
//! A [`CorrelatorBank`] owns its source of samples. What is above it sees ticks and sums, never a
//! sample. A tick is a sample number since the first sample: the receiver's only clock.

use num_complex::Complex64;

use crate::{FrontEnd, SignalError, SignalId};

/// Most taps one replica can have.
pub const MAX_TAPS: usize = 16;

/// Offsets of the correlator taps from prompt, chips; above zero is late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TapOffsets {
    chips: [f64; MAX_TAPS],
    len: u8,
}

impl TapOffsets {
    /// Offsets in the order in which [`Taps`] returns their sums.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] unless there are 1 to [`MAX_TAPS`] finite offsets.
    pub fn new(chips: &[f64]) -> Result<Self, SignalError> {
        let fits = (1..=MAX_TAPS).contains(&chips.len()) && chips.iter().all(|c| c.is_finite());
        if !fits {
            return Err(SignalError::Parameter {
                name: "tap offsets (chips)",
                value: format!("{chips:?}"),
                expected: "1 to 16 finite offsets",
            });
        }
        let mut all = [0.0; MAX_TAPS];
        all[..chips.len()].copy_from_slice(chips);
        Ok(Self {
            chips: all,
            len: chips.len() as u8,
        })
    }

    /// Early, prompt, late, with `spacing_chips` between early and late.
    #[must_use]
    pub fn early_prompt_late(spacing_chips: f64) -> Self {
        let mut chips = [0.0; MAX_TAPS];
        chips[0] = -spacing_chips / 2.0;
        chips[2] = spacing_chips / 2.0;
        Self { chips, len: 3 }
    }

    /// These offsets and then `further` ones; `None` where they are more than [`MAX_TAPS`].
    #[must_use]
    pub fn with(mut self, further: &Self) -> Option<Self> {
        let (first, len) = (usize::from(self.len), usize::from(self.len + further.len));
        let free = self.chips.get_mut(first..len)?;
        free.copy_from_slice(further.as_slice());
        self.len = len as u8;
        Some(self)
    }

    /// The offsets, chips.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.chips[..usize::from(self.len)]
    }
}

/// What to correlate with, over which samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Replica {
    /// The ranging code.
    pub signal: SignalId,
    /// First tick of the interval.
    pub start_tick: u64,
    /// End tick of the interval (exclusive).
    pub end_tick: u64,
    /// Code phase of the prompt replica at `start_tick`, chips, in [0, code length).
    pub code_phase_chips: f64,
    /// Code rate over the interval, chips/s.
    pub code_rate_hz: f64,
    /// Carrier phase at `start_tick`, cycles.
    pub carrier_phase_cycles: f64,
    /// Carrier frequency as sampled (intermediate frequency plus Doppler), Hz.
    pub carrier_frequency_hz: f64,
    /// Where to sample the correlation function.
    pub tap_offsets: TapOffsets,
}

/// Correlator sums of one [`Replica`].
///
/// Tap k is the sum over the interval's samples x\[n\] of
/// x\[n\] * exp(-2 pi i (phase + f (n - start) / fs)) * code(code phase - offset_k), in units of
/// the samples' 8-bit values. Under white noise alone its expected square is
/// `samples * sample_power` (real samples too).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taps {
    sums: [Complex64; MAX_TAPS],
    len: u8,
    /// Number of samples summed.
    pub samples: u32,
    /// Mean square of the samples of the interval (|x|^2 for complex samples).
    pub sample_power: f64,
}

impl Taps {
    /// Sums in the order of the replica's tap offsets (at most [`MAX_TAPS`] are kept).
    #[must_use]
    pub fn new(sums: &[Complex64], samples: u32, sample_power: f64) -> Self {
        let len = sums.len().min(MAX_TAPS);
        let mut all = [Complex64::default(); MAX_TAPS];
        all[..len].copy_from_slice(&sums[..len]);
        Self {
            sums: all,
            len: len as u8,
            samples,
            sample_power,
        }
    }

    /// The sums, one for each tap offset.
    #[must_use]
    pub fn as_slice(&self) -> &[Complex64] {
        &self.sums[..usize::from(self.len)]
    }
}

/// Which signals to look for, where, and how hard.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchRequest {
    /// The codes to look for.
    pub signals: Vec<SignalId>,
    /// First tick of the samples searched.
    pub start_tick: u64,
    /// Middle of the Doppler range, Hz.
    pub doppler_centre_hz: f64,
    /// Half of the Doppler range, Hz.
    pub doppler_half_width_hz: f64,
    /// Coherent integration, code periods.
    pub coherent_periods: u32,
    /// Non-coherent sums of those.
    pub noncoherent_sums: u32,
    /// Probability that noise alone yields any hit in the whole request.
    pub false_alarm_probability: f64,
}

/// A signal found by a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AcquisitionHit {
    /// The ranging code.
    pub signal: SignalId,
    /// Tick at which code phase and Doppler hold.
    pub tick: u64,
    /// Code phase at `tick`, chips, in [0, code length).
    pub code_phase_chips: f64,
    /// Doppler, Hz.
    pub doppler_hz: f64,
    /// Detection statistic: non-coherent power at the peak over its mean under noise.
    pub statistic: f64,
    /// The threshold it exceeded.
    pub threshold: f64,
    /// Estimated C/N0, dB-Hz.
    pub cn0_dbhz: f64,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchReport {
    /// The signals found, by PRN.
    pub hits: Vec<AcquisitionHit>,
    /// The largest statistic among signals not found, and whose.
    pub best_missed: Option<(SignalId, f64)>,
    /// Threshold of the statistic.
    pub threshold: f64,
}

/// Correlates replicas with samples that it alone sees.
pub trait CorrelatorBank {
    /// Sample rate, intermediate frequency and kind of the samples.
    fn front_end(&self) -> FrontEnd;

    /// Brings in samples until `tick` (exclusive) is reached or the source ends, and returns the
    /// end of the samples now held.
    ///
    /// # Errors
    /// Where the source cannot be read or holds a value that is no sample.
    fn advance_to(&mut self, tick: u64) -> Result<u64, SignalError>;

    /// Oldest tick that can still be correlated.
    fn oldest_tick(&self) -> u64;

    /// Correlates every replica over its own interval; `taps` receives one entry for each, in
    /// order, after being cleared.
    ///
    /// # Errors
    /// [`SignalError::NotHeld`] where an interval reaches outside the held samples.
    fn correlate(&mut self, replicas: &[Replica], taps: &mut Vec<Taps>) -> Result<(), SignalError>;

    /// Looks for signals in the held samples.
    ///
    /// # Errors
    /// [`SignalError::NotHeld`] where the search reaches outside the held samples.
    fn search(&mut self, request: &SearchRequest) -> Result<SearchReport, SignalError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn further_taps_follow_as_far_as_there_is_room() {
        let three = TapOffsets::early_prompt_late(0.5);
        let further = TapOffsets::new(&[-0.4, 0.4]).unwrap();
        let five = three.with(&further).unwrap();
        assert_eq!(five.as_slice(), [-0.25, 0.0, 0.25, -0.4, 0.4]);
        let many = TapOffsets::new(&[0.1; 14]).unwrap();
        assert_eq!(three.with(&many), None);
    }
}
