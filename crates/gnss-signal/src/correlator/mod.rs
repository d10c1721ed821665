//! Correlators: carrier wipe-off and code correlation of one interval at any tap offsets.
//!
//! [`Reference`](InstructionSet::Reference) says in `f64` what is meant. The others share one
//! fixed-point scheme (see `fixed_point`) and differ in the instructions of its inner loops.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod baseband;
mod carrier_table;
mod change_sums;
mod code_bits;
mod fixed_point;
mod if_bank;
mod instruction_set;
mod interval;
mod lane_table;
mod portable;
mod reference;
#[cfg(test)]
mod tests;

pub use if_bank::IfCorrelatorBank;
pub use instruction_set::InstructionSet;

use num_complex::Complex64;

use self::{fixed_point::FixedPoint, interval::Interval};
use crate::{FrontEnd, Replica, SignalError, Taps};

/// Correlates 8-bit samples with replicas on a chosen instruction set.
///
/// Against [`InstructionSet::Reference`] the others keep amplitude within 0.3 % of what a signal of
/// the interval's power would give, phase within 0.1 degree, and lose less than 0.01 dB of
/// signal-to-noise ratio to rounding.
#[derive(Debug)]
pub struct Correlator {
    front_end: FrontEnd,
    kernel: Kernel,
}

#[derive(Debug)]
enum Kernel {
    Reference,
    Portable(Box<FixedPoint<portable::Portable>>),
    #[cfg(target_arch = "x86_64")]
    Avx2(Box<FixedPoint<avx2::Avx2>>),
    #[cfg(target_arch = "x86_64")]
    Avx512(Box<FixedPoint<avx512::Avx512>>),
}

impl Correlator {
    /// A correlator for samples of `front_end` on `instruction_set`. Samples too few per
    /// chip for any but the reference (below 1.15 MHz) are left to that.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] where the sample rate is not a number of at least 1 kHz, or this
    /// processor lacks the instruction set.
    pub fn new(front_end: FrontEnd, instruction_set: InstructionSet) -> Result<Self, SignalError> {
        if !(1e3..=1e9).contains(&front_end.sample_rate_hz) {
            return Err(SignalError::Parameter {
                name: "sample rate (Hz)",
                value: front_end.sample_rate_hz.to_string(),
                expected: "1e3 to 1e9",
            });
        }
        let sample_rate_hz = front_end.sample_rate_hz;
        let kernel = match instruction_set {
            InstructionSet::Reference => Kernel::Reference,
            InstructionSet::Portable => {
                Kernel::Portable(FixedPoint::boxed(portable::Portable::default()))
            }
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => {
                Kernel::Avx2(FixedPoint::boxed(avx2::Avx2::new(sample_rate_hz)?))
            }
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => Kernel::Avx512(FixedPoint::boxed(avx512::Avx512::new()?)),
            #[cfg(not(target_arch = "x86_64"))]
            other => return Err(other.unsupported()),
        };
        let kernel = if sample_rate_hz < fixed_point::LOWEST_SAMPLE_RATE_HZ {
            Kernel::Reference
        } else {
            kernel
        };
        Ok(Self { front_end, kernel })
    }

    /// The sums of `replica` over its interval.
    ///
    /// `samples` are those from `start_tick` to `end_tick`, I and Q interleaved where complex, none
    /// below -127; `sample_power` is their mean square.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] where `samples` does not fit the interval, or a rate or phase of
    /// the replica is not finite, or its code rate is more than 5 % off.
    pub fn correlate(
        &mut self,
        samples: &[i8],
        sample_power: f64,
        replica: &Replica,
    ) -> Result<Taps, SignalError> {
        let interval = Interval::new(self.front_end, samples, sample_power, replica)?;
        let mut sums = [Complex64::default(); crate::MAX_TAPS];
        let sums = &mut sums[..replica.tap_offsets.as_slice().len()];
        match &mut self.kernel {
            Kernel::Reference => reference::correlate(self.front_end, samples, replica, sums),
            Kernel::Portable(kernel) => kernel.correlate(&interval, sums),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2(kernel) => kernel.correlate(&interval, sums),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx512(kernel) => kernel.correlate(&interval, sums),
        }
        let count = samples.len() / interval.components();
        Ok(Taps::new(sums, count as u32, sample_power))
    }
}
