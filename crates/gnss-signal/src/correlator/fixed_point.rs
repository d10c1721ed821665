//! The fixed-point scheme shared by the portable and the vector kernels.
//!
//! An interval is cut into chunks. Of each chunk the carrier is wiped off once, into 8-bit
//! baseband; then every tap adds up the baseband under its own replica of the code, whose phase is
//! kept in 32.32 bits. The sums of a chunk are turned by the carrier phase at its start.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::{
    carrier_table::{CHUNK_SAMPLES, CarrierTable, TableAmplitude},
    change_sums::{AddedChunk, ChangeSums},
    interval::{BLOCK_SAMPLES, Interval},
};

/// Below this 64 samples may span more than the 64 chips that one table look-up reaches.
pub(super) const LOWEST_SAMPLE_RATE_HZ: f64 = 1.15e6;

/// The inner loops of one instruction set.
///
/// Sums are kept over the chunks of an interval: those of the taps, in units of (code bits 0 and 1)
/// times baseband, and that of the baseband alone.
pub(super) trait Kernel {
    /// Bytes of a vector from which samples are unpacked (see [`CarrierTable::new`]).
    const VECTOR: usize;

    /// Makes ready for `interval` and clears the sums.
    fn start(&mut self, interval: &Interval<'_>);

    /// Fills the carrier table (compiled for the instruction set).
    fn fill(
        &self,
        table: &mut CarrierTable,
        len: usize,
        step: f64,
        amplitude: TableAmplitude,
    ) -> Complex64 {
        table.fill(len, step, amplitude)
    }

    /// Adds one chunk, a multiple of [`BLOCK_SAMPLES`] long, its sums turned by `turn`.
    fn add(
        &mut self,
        interval: &Interval<'_>,
        samples: &[i8],
        carrier: &CarrierTable,
        turn: Complex64,
    );

    /// Adds what the taps differ by in the chunk last added (compiled for the instruction set).
    fn add_changes(&mut self, changes: &mut ChangeSums, chunk: &AddedChunk<'_>);

    /// Sum of the baseband, and those of the taps into `sums`.
    fn sums(&self, sums: &mut [Complex64]) -> Complex64;
}

/// Correlates intervals on one kernel.
#[derive(Debug)]
pub(super) struct FixedPoint<K> {
    kernel: K,
    carrier: CarrierTable,
    changes: ChangeSums,
    /// The last chunk, filled up with zeros.
    last: [i8; 2 * CHUNK_SAMPLES],
}

impl<K: Kernel> FixedPoint<K> {
    pub(super) fn boxed(kernel: K) -> Box<Self> {
        Box::new(Self {
            kernel,
            carrier: CarrierTable::new(K::VECTOR),
            changes: ChangeSums::new(),
            last: [0; 2 * CHUNK_SAMPLES],
        })
    }

    /// Sums of the taps, in units of the samples.
    pub(super) fn correlate(&mut self, interval: &Interval<'_>, sums: &mut [Complex64]) {
        let chunk_samples = interval.chunk_samples();
        let step_cycles = interval.carrier_step_cycles;
        let chunk_turn = self.kernel.fill(
            &mut self.carrier,
            chunk_samples,
            step_cycles,
            interval.amplitude,
        );
        let mut turn = Complex64::cis(-TAU * interval.carrier_phase_cycles.fract());
        let earliest = self.changes.start(interval);
        let only = earliest.map(|tap| interval.only(tap));
        let one_by_one = only.as_ref().unwrap_or(interval);
        self.kernel.start(one_by_one);
        for chunk in interval
            .samples
            .chunks(chunk_samples * interval.components())
        {
            let whole = chunk
                .len()
                .next_multiple_of(BLOCK_SAMPLES * interval.components());
            let chunk = if whole == chunk.len() {
                chunk
            } else {
                self.last[..chunk.len()].copy_from_slice(chunk);
                self.last[chunk.len()..whole].fill(0);
                &self.last[..whole]
            };
            self.kernel.add(one_by_one, chunk, &self.carrier, turn);
            if earliest.is_some() {
                let added = AddedChunk {
                    interval,
                    len: whole / interval.components(),
                    turn,
                };
                self.kernel.add_changes(&mut self.changes, &added);
            }
            turn *= chunk_turn;
        }
        let baseband_sum = self.kernel.sums(&mut sums[..one_by_one.taps]);
        if earliest.is_some() {
            sums.fill(sums[0]);
            self.changes.finish(sums);
        }
        let scale =
            32_768.0 / (f64::from(interval.amplitude.carrier) * f64::from(1 << interval.shift));
        for sum in sums {
            // Code bits 0, 1 to chips -1, +1.
            *sum = (*sum * 2.0 - baseband_sum) * scale;
        }
    }
}
