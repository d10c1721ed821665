//! The noise floor, measured with a code that no satellite transmits.

use crate::{CorrelatorBank, FrontEnd, Replica, SignalError, SignalId, TapOffsets, Taps};

/// Taps of the noise replica, chips: far enough apart to see independent noise.
const OFFSETS_CHIPS: [f64; 12] = [
    -440.0, -360.0, -280.0, -200.0, -120.0, -40.0, 40.0, 120.0, 200.0, 280.0, 360.0, 440.0,
];
/// Sums averaged before the estimate becomes a sliding one.
const MEMORY_SUMS: f64 = 1200.0;

/// Estimates the ratio of the noise at the signal's frequency to the power of the samples.
///
/// White samples have a ratio of 1; a front-end filter narrower than the sampled band raises it.
/// The variance of a correlator sum is then samples * sample power * ratio, whatever the gain.
#[derive(Debug, Clone)]
pub struct NoiseFloor {
    signal: SignalId,
    front_end: FrontEnd,
    offsets: TapOffsets,
    sums: f64,
    ratio: f64,
    taps: Vec<Taps>,
}

impl NoiseFloor {
    /// An estimator that listens with the code `signal`, which must not be on the air.
    ///
    /// # Errors
    /// None in practice: the offsets are valid.
    pub fn new(signal: SignalId, front_end: FrontEnd) -> Result<Self, SignalError> {
        Ok(Self {
            signal,
            front_end,
            offsets: TapOffsets::new(&OFFSETS_CHIPS)?,
            sums: 0.0,
            ratio: 1.0,
            taps: Vec::new(),
        })
    }

    /// Measures over one code period that starts at `tick`.
    ///
    /// # Errors
    /// Where the bank does not hold these samples.
    pub fn measure(
        &mut self,
        bank: &mut impl CorrelatorBank,
        tick: u64,
    ) -> Result<(), SignalError> {
        let spec = self.signal.spec();
        let samples = (spec.code_period_s() * self.front_end.sample_rate_hz).round() as u64;
        let replica = Replica {
            signal: self.signal,
            start_tick: tick,
            end_tick: tick + samples,
            code_phase_chips: 0.0,
            code_rate_hz: spec.code_rate_hz,
            carrier_phase_cycles: 0.0,
            carrier_frequency_hz: self.front_end.intermediate_frequency_hz,
            tap_offsets: self.offsets,
        };
        let mut taps = std::mem::take(&mut self.taps);
        bank.correlate(&[replica], &mut taps)?;
        taps.iter().for_each(|t| self.update(t));
        self.taps = taps;
        Ok(())
    }

    fn update(&mut self, taps: &Taps) {
        let white = f64::from(taps.samples) * taps.sample_power;
        if white <= 0.0 {
            return;
        }
        for sum in taps.as_slice() {
            self.sums = (self.sums + 1.0).min(MEMORY_SUMS);
            self.ratio += (sum.norm_sqr() / white - self.ratio) / self.sums;
        }
    }

    /// Variance of one of the sums of `taps` under noise alone, E|n|^2.
    #[must_use]
    pub fn variance(&self, taps: &Taps) -> f64 {
        (f64::from(taps.samples) * taps.sample_power * self.ratio).max(f64::MIN_POSITIVE)
    }

    /// Ratio of noise at the signal's frequency to sample power.
    #[must_use]
    pub const fn ratio(&self) -> f64 {
        self.ratio
    }
}
