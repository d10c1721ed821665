//! The inner loops with AVX2, 32 samples at a time.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use num_complex::Complex64;

use super::{
    InstructionSet,
    baseband::Baseband,
    carrier_table::{CarrierTable, TableAmplitude},
    change_sums::{AddedChunk, ChangeSums, FRACTION_SHIFT, Grid, Located},
    code_bits::CodeBits,
    fixed_point::Kernel,
    interval::{BLOCK_SAMPLES, Interval, MOST_CHIPS, within_period},
    lane_table::{LaneTable, LaneTables},
};
use crate::{MAX_TAPS, SignalError};

/// Samples of one vector of bytes.
const LANES: usize = 32;

/// Vectors of a block.
const VECTORS: usize = BLOCK_SAMPLES / LANES;

/// Chips that `vpshufb` reaches from the first of a window.
const REACH_CHIPS: f64 = 15.0;

/// Windows of the code that a block looks up, at most: one for each half of a vector, which reaches its samples from 1.08 MHz
/// on, at a code rate 5 % above the nominal one.
const MOST_WINDOWS: usize = 2 * VECTORS;

/// In-phase and quadrature sums by lane.
type Sums = [__m256; 2];

/// Fixed-point kernel for AVX2.
#[derive(Debug)]
pub(super) struct Avx2 {
    lanes: LaneTables,
    /// Windows of the code that a block looks up.
    windows: usize,
    baseband: Baseband,
    phases: [u64; MAX_TAPS],
    sums: [Sums; MAX_TAPS],
    baseband_sums: Sums,
}

pub(super) fn is_supported() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

impl Avx2 {
    /// The kernel for samples of this rate, which exists only where the processor can run it.
    pub(super) fn new(sample_rate_hz: f64) -> Result<Self, SignalError> {
        if !is_supported() {
            return Err(InstructionSet::Avx2.unsupported());
        }
        let windows = windows_of_block(sample_rate_hz);
        let samples = BLOCK_SAMPLES / windows;
        let origin = std::array::from_fn(|byte| (byte / samples * samples) as u8);
        // SAFETY: all bits zero are floats, and the instruction set is there.
        let zero = unsafe { [_mm256_setzero_ps(); 2] };
        Ok(Self {
            lanes: LaneTables::new(origin),
            windows,
            baseband: Baseband::zeroed(),
            phases: [0; MAX_TAPS],
            sums: [zero; MAX_TAPS],
            baseband_sums: zero,
        })
    }
}

/// So few that each reaches its samples, at a code rate 5 % above the nominal one.
fn windows_of_block(sample_rate_hz: f64) -> usize {
    let step_chips = 1.05 * 1.023e6 / sample_rate_hz;
    let reaches =
        |windows: &usize| (BLOCK_SAMPLES / windows - 1) as f64 * step_chips <= REACH_CHIPS;
    let whole_vectors = [1, VECTORS].into_iter();
    whole_vectors.filter(reaches).min().unwrap_or(MOST_WINDOWS)
}

impl Kernel for Avx2 {
    const VECTOR: usize = LANES;

    fn start(&mut self, interval: &Interval<'_>) {
        self.lanes.select(interval.code_step_chips);
        self.phases = interval.phases;
        // SAFETY: an `Avx2` exists only where its instruction set does (`new`).
        unsafe { clear(self) };
    }

    fn fill(
        &self,
        table: &mut CarrierTable,
        len: usize,
        step: f64,
        amplitude: TableAmplitude,
    ) -> Complex64 {
        // SAFETY: an `Avx2` exists only where its instruction set does (`new`).
        unsafe { fill(table, len, step, amplitude) }
    }

    fn add(
        &mut self,
        interval: &Interval<'_>,
        samples: &[i8],
        carrier: &CarrierTable,
        turn: Complex64,
    ) {
        // SAFETY: an `Avx2` exists only where its instruction set does (`new`).
        unsafe { add(self, interval, samples, carrier, turn) }
    }

    fn add_changes(&mut self, changes: &mut ChangeSums, chunk: &AddedChunk<'_>) {
        // SAFETY: an `Avx2` exists only where its instruction set does (`new`).
        unsafe { add_changes(&mut self.baseband, changes, chunk) };
    }

    fn sums(&self, sums: &mut [Complex64]) -> Complex64 {
        // SAFETY: an `Avx2` exists only where its instruction set does (`new`).
        unsafe {
            for (sum, lanes) in sums.iter_mut().zip(&self.sums) {
                *sum = total(lanes);
            }
            total(&self.baseband_sums)
        }
    }
}

#[target_feature(enable = "avx2,fma")]
fn clear(kernel: &mut Avx2) {
    let zero = [_mm256_setzero_ps(); 2];
    kernel.sums = [zero; MAX_TAPS];
    kernel.baseband_sums = zero;
}

#[target_feature(enable = "avx2,fma")]
fn fill(table: &mut CarrierTable, len: usize, step: f64, amplitude: TableAmplitude) -> Complex64 {
    table.fill(len, step, amplitude)
}

#[target_feature(enable = "avx2,fma")]
fn total(lanes: &Sums) -> Complex64 {
    let [re, im] = lanes.map(|lanes| {
        let half = _mm_add_ps(
            _mm256_castps256_ps128(lanes),
            _mm256_extractf128_ps::<1>(lanes),
        );
        let quarter = _mm_add_ps(half, _mm_movehl_ps(half, half));
        let pair = _mm_add_ss(quarter, _mm_movehdup_ps(quarter));
        f64::from(_mm_cvtss_f32(pair))
    });
    Complex64::new(re, im)
}

#[target_feature(enable = "avx2,fma")]
fn add(
    kernel: &mut Avx2,
    interval: &Interval<'_>,
    samples: &[i8],
    carrier: &CarrierTable,
    turn: Complex64,
) {
    let Avx2 {
        lanes,
        windows,
        baseband,
        phases,
        sums,
        baseband_sums,
    } = kernel;
    let totals = if interval.complex {
        wipe_off_complex(samples, interval.shift, carrier, baseband)
    } else {
        wipe_off_real(samples, interval.shift, carrier, baseband)
    };
    add_turned(baseband_sums, totals, turn);
    let Some(lanes) = lanes.current() else {
        return;
    };
    let chunk = Chunk {
        baseband,
        blocks: samples.len() / interval.components() / BLOCK_SAMPLES,
        code: interval.code,
        lanes,
        step: interval.code_step(BLOCK_SAMPLES),
        turn,
    };
    let (phases, sums) = (&mut phases[..interval.taps], &mut sums[..interval.taps]);
    match *windows {
        1 => add_all_taps::<1>(&chunk, phases, sums),
        VECTORS => add_all_taps::<VECTORS>(&chunk, phases, sums),
        _ => add_all_taps::<MOST_WINDOWS>(&chunk, phases, sums),
    }
}

/// Adds a chunk to every tap, two at a time: their sums stay in registers, which those of more do not.
#[target_feature(enable = "avx2,fma")]
fn add_all_taps<const WINDOWS: usize>(chunk: &Chunk<'_>, phases: &mut [u64], sums: &mut [Sums]) {
    let (phases, rest_phases) = phases.as_chunks_mut();
    let (sums, rest_sums) = sums.as_chunks_mut();
    for (phases, sums) in phases.iter_mut().zip(sums) {
        add_taps::<2, WINDOWS>(chunk, phases, sums);
    }
    for (phase, sum) in rest_phases.iter_mut().zip(rest_sums) {
        add_taps::<1, WINDOWS>(
            chunk,
            std::array::from_mut(phase),
            std::array::from_mut(sum),
        );
    }
}

#[target_feature(enable = "avx2,fma")]
fn add_changes(baseband: &mut Baseband, changes: &mut ChangeSums, chunk: &AddedChunk<'_>) {
    changes.add(chunk, baseband, |grid, batch| locate(grid, batch));
}

/// Changes located at a time.
const BATCH: usize = 16;

/// As [`Grid::locate`].
#[target_feature(enable = "avx2,fma")]
fn locate(grid: &Grid<'_>, batch: &[u16; BATCH]) -> Located<BATCH> {
    let zero = _mm256_setzero_si256();
    let chip_samples = _mm256_set1_epi32(grid.chip_samples.cast_signed());
    let origin = _mm256_set1_epi32(grid.origin.cast_signed());
    let chips = _mm256_srli_epi16::<1>(load(batch));
    let chips = _mm256_sub_epi16(chips, _mm256_set1_epi16(grid.first_chip.cast_signed()));
    let rest = _mm256_mulhi_epu16(chips, _mm256_set1_epi16(grid.rest.cast_signed()));
    let position = |chips, rest| {
        let position = _mm256_add_epi32(_mm256_mullo_epi32(chips, chip_samples), rest);
        _mm256_add_epi32(position, origin)
    };
    let low = position(
        _mm256_unpacklo_epi16(chips, zero),
        _mm256_unpacklo_epi16(rest, zero),
    );
    let high = position(
        _mm256_unpackhi_epi16(chips, zero),
        _mm256_unpackhi_epi16(rest, zero),
    );
    let most = _mm256_set1_epi32(0xffff);
    let next = |position| _mm256_srli_epi32::<16>(_mm256_add_epi32(position, most));
    let at = _mm256_packus_epi32(next(low), next(high));
    let fraction = _mm256_packus_epi32(_mm256_and_si256(low, most), _mm256_and_si256(high, most));
    let fraction = _mm256_sub_epi16(zero, fraction);
    let fraction = _mm256_srli_epi16::<{ FRACTION_SHIFT.cast_signed() }>(fraction);
    let passed = grid.limits.iter().fold(zero, |passed, limit| {
        let passes = _mm256_cmpgt_epi16(fraction, _mm256_set1_epi16(*limit));
        _mm256_sub_epi16(passed, passes)
    });
    let bit = _mm256_and_si256(load(batch), _mm256_set1_epi16(1));
    let slot = _mm256_add_epi16(_mm256_add_epi16(passed, passed), bit);
    // SAFETY: vectors of 16 numbers of 16 bits, as arrays of them.
    unsafe {
        Located {
            at: std::mem::transmute::<__m256i, [u16; BATCH]>(at),
            slot: std::mem::transmute::<__m256i, [u16; BATCH]>(slot),
        }
    }
}

/// What the taps of one chunk share.
struct Chunk<'a> {
    baseband: &'a Baseband,
    blocks: usize,
    code: &'a CodeBits,
    lanes: &'a LaneTable,
    step: u64,
    turn: Complex64,
}

#[target_feature(enable = "avx2,fma")]
fn add_taps<const TAPS: usize, const WINDOWS: usize>(
    chunk: &Chunk<'_>,
    phases: &mut [u64; TAPS],
    sums: &mut [Sums; TAPS],
) {
    let mut in_phase = [_mm256_setzero_si256(); TAPS];
    let mut quadrature = [_mm256_setzero_si256(); TAPS];
    let mut now = *phases;
    let origins: [usize; MOST_WINDOWS] =
        std::array::from_fn(|half| chunk.lanes.origin_chips(half * LANES / 2) & 127);
    let [i, q] = chunk.baseband.parts();
    let (i_blocks, _) = i.as_chunks::<BLOCK_SAMPLES>();
    let (q_blocks, _) = q.as_chunks::<BLOCK_SAMPLES>();
    for (i, q) in i_blocks.iter().zip(q_blocks).take(chunk.blocks) {
        let (i, q) = (vectors(i), vectors(q));
        for tap in 0..TAPS {
            let phase = now[tap];
            let chip = (phase >> 32) as usize & MOST_CHIPS;
            let row = chunk.lanes.row(phase as u32).as_chunks::<LANES>().0;
            for (vector, (&i, &q)) in i.iter().zip(&q).enumerate() {
                let half = if WINDOWS == 1 { 0 } else { 2 * vector };
                let first = window(chunk.code, chip + origins[half]);
                let windows = if WINDOWS == MOST_WINDOWS {
                    let second = window(chunk.code, chip + origins[half + 1]);
                    _mm256_set_m128i(second, first)
                } else {
                    _mm256_broadcastsi128_si256(first)
                };
                let code = _mm256_shuffle_epi8(windows, load(&row[vector]));
                in_phase[tap] = _mm256_add_epi16(in_phase[tap], _mm256_maddubs_epi16(code, i));
                quadrature[tap] = _mm256_add_epi16(quadrature[tap], _mm256_maddubs_epi16(code, q));
            }
            now[tap] = phase + chunk.step;
        }
    }
    *phases = now.map(within_period);
    for tap in 0..TAPS {
        add_turned(&mut sums[tap], [in_phase[tap], quadrature[tap]], chunk.turn);
    }
}

/// 16 chips of the code from `chip` (at most [`MOST_CHIPS`] + 127) on.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn window(code: &CodeBits, chip: usize) -> __m128i {
    const { assert!(size_of::<CodeBits>() >= MOST_CHIPS + 127 + 16) };
    // SAFETY: the window lies within `CodeBits`, and the load asks for no alignment.
    unsafe { _mm_loadu_si128(code.as_ptr().add(chip).cast()) }
}

/// The vectors of a block.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn vectors(block: &[i8; BLOCK_SAMPLES]) -> [__m256i; VECTORS] {
    let (vectors, _) = block.as_chunks::<LANES>();
    std::array::from_fn(|vector| load(&vectors[vector]))
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn load<T: Copy, const N: usize>(values: &[T; N]) -> __m256i {
    const { assert!(size_of::<T>() * N == 32) };
    // SAFETY: the array is 32 bytes long, and the load asks for no alignment.
    unsafe { _mm256_loadu_si256(values.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn store(values: &mut [i8; LANES], vector: __m256i) {
    // SAFETY: the array is 32 bytes long, and the store asks for no alignment.
    unsafe { _mm256_storeu_si256(values.as_mut_ptr().cast(), vector) }
}

/// Adds the 16-bit sums of a chunk (at most 32 vectors of two products below 128 each), turned by the carrier phase at its start.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn add_turned(sums: &mut Sums, chunk: [__m256i; 2], turn: Complex64) {
    let ones = _mm256_set1_epi16(1);
    let [i, q] = chunk.map(|sum| _mm256_cvtepi32_ps(_mm256_madd_epi16(sum, ones)));
    let re = _mm256_set1_ps(turn.re as f32);
    let im = _mm256_set1_ps(turn.im as f32);
    sums[0] = _mm256_fnmadd_ps(q, im, _mm256_fmadd_ps(i, re, sums[0]));
    sums[1] = _mm256_fmadd_ps(q, re, _mm256_fmadd_ps(i, im, sums[1]));
}

/// Wipes the carrier off real samples and returns the sums of the baseband.
#[target_feature(enable = "avx2,fma")]
fn wipe_off_real(
    samples: &[i8],
    shift: i32,
    carrier: &CarrierTable,
    out: &mut Baseband,
) -> [__m256i; 2] {
    // A sample is moved to the top of a 16-bit lane, then down to its shifted place.
    let down = _mm_cvtsi32_si128(8 - shift);
    let zero = _mm256_setzero_si256();
    let mut totals = [zero; 2];
    let (samples, _) = samples.as_chunks::<LANES>();
    let (re, _) = carrier.re.as_chunks::<{ LANES / 2 }>();
    let (im, _) = carrier.im.as_chunks::<{ LANES / 2 }>();
    let [out_i, out_q] = out.parts_mut();
    let (out_i, _) = out_i.as_chunks_mut::<LANES>();
    let (out_q, _) = out_q.as_chunks_mut::<LANES>();
    let table = re.as_chunks::<2>().0.iter().zip(im.as_chunks::<2>().0);
    let out = out_i.iter_mut().zip(out_q);
    for ((x, (re, im)), (i, q)) in samples.iter().zip(table).zip(out) {
        let x = load(x);
        let first = _mm256_sra_epi16(_mm256_unpacklo_epi8(zero, x), down);
        let second = _mm256_sra_epi16(_mm256_unpackhi_epi8(zero, x), down);
        let baseband_i = _mm256_packs_epi16(
            _mm256_mulhrs_epi16(first, load(&re[0])),
            _mm256_mulhrs_epi16(second, load(&re[1])),
        );
        let baseband_q = _mm256_packs_epi16(
            _mm256_mulhrs_epi16(first, load(&im[0])),
            _mm256_mulhrs_epi16(second, load(&im[1])),
        );
        store(i, baseband_i);
        store(q, baseband_q);
        add_total(&mut totals, baseband_i, baseband_q);
    }
    totals
}

/// Wipes the carrier off complex samples and returns the sums of the baseband.
#[target_feature(enable = "avx2,fma")]
fn wipe_off_complex(
    samples: &[i8],
    shift: i32,
    carrier: &CarrierTable,
    out: &mut Baseband,
) -> [__m256i; 2] {
    // Components are moved to the top of a 16-bit lane, then down to their shifted place.
    let down = _mm_cvtsi32_si128(8 - shift);
    let mut totals = [_mm256_setzero_si256(); 2];
    let (halves, _) = samples.as_chunks::<LANES>();
    let (samples, _) = halves.as_chunks::<2>();
    let (re, _) = carrier.re.as_chunks::<{ LANES / 2 }>();
    let (im, _) = carrier.im.as_chunks::<{ LANES / 2 }>();
    let [out_i, out_q] = out.parts_mut();
    let (out_i, _) = out_i.as_chunks_mut::<LANES>();
    let (out_q, _) = out_q.as_chunks_mut::<LANES>();
    let table = re.as_chunks::<2>().0.iter().zip(im.as_chunks::<2>().0);
    let out = out_i.iter_mut().zip(out_q);
    for ((x, (re, im)), (i, q)) in samples.iter().zip(table).zip(out) {
        let x = [load(&x[0]), load(&x[1])];
        // In the order of the table, which packing undoes.
        let x = [
            _mm256_permute2x128_si256::<0x20>(x[0], x[1]),
            _mm256_permute2x128_si256::<0x31>(x[0], x[1]),
        ];
        let mut wide_i = [_mm256_setzero_si256(); 2];
        let mut wide_q = [_mm256_setzero_si256(); 2];
        for half in 0..2 {
            let (re, im) = (load(&re[half]), load(&im[half]));
            let x_i = _mm256_sra_epi16(_mm256_slli_epi16::<8>(x[half]), down);
            let x_q = _mm256_and_si256(x[half], _mm256_set1_epi16(-256));
            let x_q = _mm256_sra_epi16(x_q, down);
            wide_i[half] =
                _mm256_sub_epi16(_mm256_mulhrs_epi16(x_i, re), _mm256_mulhrs_epi16(x_q, im));
            wide_q[half] =
                _mm256_add_epi16(_mm256_mulhrs_epi16(x_i, im), _mm256_mulhrs_epi16(x_q, re));
        }
        let baseband_i = _mm256_packs_epi16(wide_i[0], wide_i[1]);
        let baseband_q = _mm256_packs_epi16(wide_q[0], wide_q[1]);
        store(i, baseband_i);
        store(q, baseband_q);
        add_total(&mut totals, baseband_i, baseband_q);
    }
    totals
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn add_total(totals: &mut [__m256i; 2], i: __m256i, q: __m256i) {
    let ones = _mm256_set1_epi8(1);
    totals[0] = _mm256_add_epi16(totals[0], _mm256_maddubs_epi16(ones, i));
    totals[1] = _mm256_add_epi16(totals[1], _mm256_maddubs_epi16(ones, q));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correlator::change_sums::tests::is_located_as_in_plain_rust;

    #[test]
    #[allow(clippy::print_stdout, reason = "a skip must not be silent")]
    fn windows_are_located_as_in_plain_rust() {
        if !is_supported() {
            println!("SKIPPED: no AVX2");
            return;
        }
        // SAFETY: the instruction set is there.
        is_located_as_in_plain_rust(|grid, batch| unsafe { locate(grid, batch) });
    }
}
