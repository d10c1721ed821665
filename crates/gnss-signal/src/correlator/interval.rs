//! An interval to correlate in the units of the kernels.

use super::{
    carrier_table::{CHUNK_SAMPLES, TableAmplitude},
    code_bits::{CodeBits, CodeChanges, code_bits, code_changes},
};
use crate::{CA_CODE_LENGTH_CHIPS, FrontEnd, MAX_TAPS, Replica, SignalError};

/// Samples a chunk is a multiple of, and for which the vector kernels look up the code at a time.
pub(super) const BLOCK_SAMPLES: usize = 128;

/// One chip in fixed point.
pub(super) const ONE_CHIP: f64 = 4_294_967_296.0;

/// One code period in fixed point.
pub(super) const CODE_PERIOD: u64 = (CA_CODE_LENGTH_CHIPS as u64) << 32;

/// A chunk begins within a code period and is shorter than one at every sample rate: its chips have smaller numbers, so
/// that bits of this mask hold them all.
pub(super) const MOST_CHIPS: usize = 2047;

/// Samples in a chunk that is not long.
const MEDIUM_SAMPLES: usize = 1024;

/// Chips of a long chunk: with those that its last tap is late fewer than 256, for whose changes sums of 16 bits do.
const MOST_CHIPS_OF_LONG: f64 = 250.0;

/// A phase below two code periods, within the first.
#[inline(always)]
pub(super) fn within_period(phase: u64) -> u64 {
    phase.min(phase.wrapping_sub(CODE_PERIOD))
}

/// A replica and its samples in the units of the kernels.
#[derive(Debug, Clone)]
pub(super) struct Interval<'a> {
    pub(super) samples: &'a [i8],
    pub(super) complex: bool,
    pub(super) code: &'static CodeBits,
    pub(super) changes: &'static CodeChanges,
    pub(super) carrier_phase_cycles: f64,
    pub(super) carrier_step_cycles: f64,
    /// Code step of a sample, chips.
    pub(super) code_step_chips: f64,
    /// Code phase of every tap at the first sample, 32.32 bits of chips, below [`CODE_PERIOD`].
    pub(super) phases: [u64; MAX_TAPS],
    pub(super) taps: usize,
    /// Samples are multiplied by two to this power before they are rounded.
    pub(super) shift: i32,
    pub(super) amplitude: TableAmplitude,
}

impl<'a> Interval<'a> {
    pub(super) fn new(
        front_end: FrontEnd,
        samples: &'a [i8],
        sample_power: f64,
        replica: &Replica,
    ) -> Result<Self, SignalError> {
        check(front_end, samples, replica)?;
        let offsets_chips = replica.tap_offsets.as_slice();
        let mut phases = [0; MAX_TAPS];
        for (phase, offset_chips) in phases.iter_mut().zip(offsets_chips) {
            *phase = fixed_phase(replica.code_phase_chips - offset_chips);
        }
        let (shift, amplitude) = levels(sample_power, front_end.complex);
        Ok(Self {
            samples,
            complex: front_end.complex,
            code: code_bits(replica.signal),
            changes: code_changes(replica.signal),
            carrier_phase_cycles: replica.carrier_phase_cycles,
            carrier_step_cycles: replica.carrier_frequency_hz / front_end.sample_rate_hz,
            code_step_chips: replica.code_rate_hz / front_end.sample_rate_hz,
            phases,
            taps: offsets_chips.len(),
            shift,
            amplitude,
        })
    }

    /// The same with one of its taps alone.
    pub(super) fn only(&self, tap: usize) -> Self {
        let mut only = self.clone();
        only.phases[0] = self.phases[tap];
        only.taps = 1;
        only
    }

    /// 2 where complex, otherwise 1.
    pub(super) const fn components(&self) -> usize {
        if self.complex { 2 } else { 1 }
    }

    /// Samples in a chunk: fewer in short intervals, where the carrier table would cost most, and in long ones more where a
    /// chip has many.
    pub(super) fn chunk_samples(&self) -> usize {
        let count = self.samples.len() / self.components();
        let most = (MOST_CHIPS_OF_LONG / self.code_step_chips) as usize;
        let most = (most / BLOCK_SAMPLES * BLOCK_SAMPLES).clamp(MEDIUM_SAMPLES, CHUNK_SAMPLES);
        (count / 8)
            .min(MEDIUM_SAMPLES)
            .max(count / 64)
            .next_multiple_of(BLOCK_SAMPLES)
            .clamp(256, most)
    }

    /// Code step of `samples` samples, 32.32 bits of chips.
    pub(super) fn code_step(&self, samples: usize) -> u64 {
        (self.code_step_chips * samples as f64 * ONE_CHIP).round() as u64
    }
}

/// Shift of the samples and amplitudes of the carrier for samples of mean square `sample_power`.
///
/// The rms of noise then lies between an eighth and a quarter of the 8-bit range, where rounding
/// costs little and clipping is rare; complex products reach sqrt(2) times further than real ones.
/// The dither spans one unit of the baseband at that rms.
fn levels(sample_power: f64, complex: bool) -> (i32, TableAmplitude) {
    let (carrier, largest_rms, component) = if complex {
        (22_938.0, 64.0, std::f64::consts::FRAC_1_SQRT_2)
    } else {
        (31_700.0, 32.0, 1.0)
    };
    let rms = sample_power.max(0.0).sqrt();
    let shift = ((largest_rms / rms).log2().floor() as i32).clamp(0, 6);
    let shifted_rms = (rms * f64::from(1 << shift)).max(largest_rms / 2.0);
    let dither = (32_768.0 / (shifted_rms * component)) as f32;
    (shift, TableAmplitude { carrier, dither })
}

/// `phase_chips` within the code period, 32.32 bits.
fn fixed_phase(phase_chips: f64) -> u64 {
    let period_chips = CA_CODE_LENGTH_CHIPS as f64;
    // The remainder of a division takes as long as 500 samples, and is rarely needed.
    let wrapped = if (0.0..period_chips).contains(&phase_chips) {
        phase_chips
    } else {
        phase_chips.rem_euclid(period_chips)
    };
    (wrapped * ONE_CHIP) as u64 % CODE_PERIOD
}

fn check(front_end: FrontEnd, samples: &[i8], replica: &Replica) -> Result<(), SignalError> {
    let refuse = |name, value: f64, expected| {
        Err(SignalError::Parameter {
            name,
            value: value.to_string(),
            expected,
        })
    };
    let components = if front_end.complex { 2 } else { 1 };
    let ticks = replica.end_tick.saturating_sub(replica.start_tick);
    if ticks.saturating_mul(components) != samples.len() as u64 || ticks > u64::from(u32::MAX) {
        let expected = "as many as the replica's interval has";
        return refuse("number of samples", samples.len() as f64, expected);
    }
    for (name, value) in [
        ("code rate (chips/s)", replica.code_rate_hz),
        ("code phase (chips)", replica.code_phase_chips),
        ("carrier phase (cycles)", replica.carrier_phase_cycles),
        ("carrier frequency (Hz)", replica.carrier_frequency_hz),
    ] {
        if !value.is_finite() {
            return refuse(name, value, "a finite number");
        }
    }
    let nominal_hz = replica.signal.spec().code_rate_hz;
    if (replica.code_rate_hz / nominal_hz - 1.0).abs() > 0.05 {
        let expected = "within 5 % of the nominal rate";
        return refuse("code rate (chips/s)", replica.code_rate_hz, expected);
    }
    Ok(())
}
