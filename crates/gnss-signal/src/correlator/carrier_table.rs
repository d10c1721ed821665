//! The carrier replica of one chunk of samples.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};

/// Most samples in a chunk.
pub(super) const CHUNK_SAMPLES: usize = 2048;

/// Samples within which entries have an order of their own.
const ORDERED: usize = 64;

/// 1.5 * 2^23: added to a small float it leaves the rounded integer in the low bits.
const ROUND_TO_INTEGER: f32 = 12_582_912.0;

/// exp(-2 pi i f n / fs) for the samples n of a chunk, as 16-bit fractions.
///
/// Every chunk of an interval uses the same table; its sums are then turned by the carrier phase
/// at the start of the chunk. So the phase is exact at every sample, with no table of quantised
/// phases that would bias a carrier in step with the sample rate.
///
/// Entries are dithered: samples of few levels times a carrier of few phases would otherwise be
/// rounded to baseband with the same error over and over.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct CarrierTable {
    /// Real parts.
    pub(super) re: [i16; CHUNK_SAMPLES],
    /// Imaginary parts.
    pub(super) im: [i16; CHUNK_SAMPLES],
    turns: [Complex32; CHUNK_SAMPLES],
    /// Which of 64 samples each of 64 entries is for.
    order: [usize; ORDERED],
    /// Uniform in +-1/2, another for each part.
    dither: [[f32; CHUNK_SAMPLES]; 2],
}

/// Amplitude of a carrier table and of its dither, of 32768 together.
#[derive(Debug, Clone, Copy)]
pub(super) struct TableAmplitude {
    pub(super) carrier: f32,
    /// From peak to peak.
    pub(super) dither: f32,
}

impl CarrierTable {
    /// A table for samples that are unpacked from vectors of `vector` bytes: of all lanes of 16 bytes first the lower eight,
    /// then the upper eight. From one of 16 they come in their own order.
    pub(super) fn new(vector: usize) -> Self {
        let order = std::array::from_fn(|entry| {
            let (start, entry) = (entry / vector * vector, entry % vector);
            let (half, eight) = (entry / (vector / 2), entry % (vector / 2) / 8);
            start + 16 * eight + 8 * half + entry % 8
        });
        let dithers = |seed| {
            let sample = |entry| entry / ORDERED * ORDERED + order[entry % ORDERED];
            std::array::from_fn(|entry| dither(sample(entry), seed))
        };
        Self {
            re: [0; CHUNK_SAMPLES],
            im: [0; CHUNK_SAMPLES],
            turns: [Complex32::default(); CHUNK_SAMPLES],
            dither: [dithers(0x9e37_79b1), dithers(0x85eb_ca77)],
            order,
        }
    }

    /// Fills the first `len` entries (more than 64) for a carrier of `step_cycles` a sample, and returns the turn
    /// from one chunk of `len` samples to the next.
    #[inline(always)]
    pub(super) fn fill(
        &mut self,
        len: usize,
        step_cycles: f64,
        amplitude: TableAmplitude,
    ) -> Complex64 {
        let len = len.min(CHUNK_SAMPLES);
        let step = Complex64::cis(-TAU * step_cycles.fract());
        let mut doubled = step;
        self.turns[0] = Complex32::new(1.0, 0.0);
        let mut filled = 1;
        while filled < len {
            if filled == ORDERED {
                let (block, _) = self.turns.as_chunks_mut::<ORDERED>();
                block[0] = self.order.map(|sample| block[0][sample]);
            }
            let turn = Complex32::new(doubled.re as f32, doubled.im as f32);
            let (known, rest) = self.turns.split_at_mut(filled);
            for (next, known) in rest.iter_mut().zip(known) {
                *next = *known * turn;
            }
            doubled *= doubled;
            filled *= 2;
        }
        let TableAmplitude { carrier, dither } = amplitude;
        let entry = |turn: f32, level: f32| {
            (turn * carrier + level * dither + ROUND_TO_INTEGER).to_bits() as i16
        };
        let levels = self.dither[0].iter().zip(&self.dither[1]);
        let out = self.re[..len].iter_mut().zip(&mut self.im);
        for (((re, im), turn), (level_re, level_im)) in out.zip(&self.turns).zip(levels) {
            *re = entry(turn.re, *level_re);
            *im = entry(turn.im, *level_im);
        }
        Complex64::cis(-TAU * (step_cycles * len as f64).fract())
    }
}

/// Scattered levels in +-1/2. Those of every second run of 64 samples have the opposite sign, so
/// that a carrier in step with the sample rate meets no mean level in any of its phases.
fn dither(n: usize, seed: u32) -> f32 {
    let scattered = (n as u32 % 64 + 64 * (n as u32 / 128) + 1).wrapping_mul(seed);
    let scattered = (scattered ^ scattered >> 15).wrapping_mul(0x2c1b_3c6d);
    let level = (scattered >> 8) as f32 / 16_777_216.0 - 0.5;
    if (n / 64).is_multiple_of(2) {
        level
    } else {
        -level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_the_rounded_carrier() {
        const STEPS_CYCLES: [f64; 5] = [0.0, 0.25, -0.123_456, 0.499_999, 3.3];
        let vectors = [16, 32, 64].into_iter();
        for (vector, step_cycles) in vectors.flat_map(|v| STEPS_CYCLES.map(|step| (v, step))) {
            let mut table = Box::new(CarrierTable::new(vector));
            let amplitude = TableAmplitude {
                carrier: 32_700.0,
                dither: 0.0,
            };
            table.fill(CHUNK_SAMPLES, step_cycles, amplitude);
            for entry in 0..CHUNK_SAMPLES {
                let n = entry / ORDERED * ORDERED + table.order[entry % ORDERED];
                let exact = Complex64::cis(-TAU * step_cycles * n as f64) * 32_700.0;
                let error = exact - Complex64::new(table.re[entry].into(), table.im[entry].into());
                // Half a unit of rounding in each part, and eleven doublings of f32 rounding
                // (6e-8 * 32700 each).
                assert!(error.norm() < 0.75, "{step_cycles} at {n}: {error}");
            }
        }
    }
}
