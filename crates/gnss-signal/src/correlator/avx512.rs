//! The inner loops with AVX-512 VBMI and VNNI, 64 samples at a time.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use num_complex::Complex64;

use super::{
    InstructionSet, avx2,
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
const LANES: usize = 64;

/// Vectors of a block.
const VECTORS: usize = BLOCK_SAMPLES / LANES;

/// In-phase and quadrature sums by lane.
type Sums = [__m512; 2];

/// Fixed-point kernel for AVX-512.
#[derive(Debug)]
pub(super) struct Avx512 {
    lanes: LaneTables,
    baseband: Baseband,
    phases: [u64; MAX_TAPS],
    sums: [Sums; MAX_TAPS],
    baseband_sums: Sums,
}

pub(super) fn is_supported() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vbmi")
        && is_x86_feature_detected!("avx512vnni")
        && avx2::is_supported()
}

impl Avx512 {
    /// The kernel, which exists only where the processor can run it.
    pub(super) fn new() -> Result<Self, SignalError> {
        if !is_supported() {
            return Err(InstructionSet::Avx512.unsupported());
        }
        let origin = std::array::from_fn(|byte| (byte / 64 * 64) as u8);
        // SAFETY: all bits zero are floats, and the instruction set is there.
        let zero = unsafe { [_mm512_setzero_ps(); 2] };
        Ok(Self {
            lanes: LaneTables::new(origin),
            baseband: Baseband::zeroed(),
            phases: [0; MAX_TAPS],
            sums: [zero; MAX_TAPS],
            baseband_sums: zero,
        })
    }
}

impl Kernel for Avx512 {
    const VECTOR: usize = LANES;

    fn start(&mut self, interval: &Interval<'_>) {
        self.lanes.select(interval.code_step_chips);
        self.phases = interval.phases;
        // SAFETY: an `Avx512` exists only where its instruction set does (`new`).
        unsafe { clear(self) };
    }

    fn fill(
        &self,
        table: &mut CarrierTable,
        len: usize,
        step: f64,
        amplitude: TableAmplitude,
    ) -> Complex64 {
        // SAFETY: an `Avx512` exists only where its instruction set does (`new`).
        unsafe { fill(table, len, step, amplitude) }
    }

    fn add(
        &mut self,
        interval: &Interval<'_>,
        samples: &[i8],
        carrier: &CarrierTable,
        turn: Complex64,
    ) {
        // SAFETY: an `Avx512` exists only where its instruction set does (`new`).
        unsafe { add(self, interval, samples, carrier, turn) }
    }

    fn add_changes(&mut self, changes: &mut ChangeSums, chunk: &AddedChunk<'_>) {
        // SAFETY: an `Avx512` exists only where its instruction set does (`new`).
        unsafe { add_changes(&mut self.baseband, changes, chunk) };
    }

    fn sums(&self, sums: &mut [Complex64]) -> Complex64 {
        // SAFETY: an `Avx512` exists only where its instruction set does (`new`).
        unsafe {
            for (sum, lanes) in sums.iter_mut().zip(&self.sums) {
                *sum = total(lanes);
            }
            total(&self.baseband_sums)
        }
    }
}

#[target_feature(enable = "avx512f")]
fn clear(kernel: &mut Avx512) {
    let zero = [_mm512_setzero_ps(); 2];
    kernel.sums = [zero; MAX_TAPS];
    kernel.baseband_sums = zero;
}

#[target_feature(enable = "avx512f,avx512bw,fma")]
fn fill(table: &mut CarrierTable, len: usize, step: f64, amplitude: TableAmplitude) -> Complex64 {
    table.fill(len, step, amplitude)
}

#[target_feature(enable = "avx512f")]
fn total(lanes: &Sums) -> Complex64 {
    let [re, im] = lanes.map(|lanes| f64::from(_mm512_reduce_add_ps(lanes)));
    Complex64::new(re, im)
}

#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni,fma")]
fn add(
    kernel: &mut Avx512,
    interval: &Interval<'_>,
    samples: &[i8],
    carrier: &CarrierTable,
    turn: Complex64,
) {
    let Avx512 {
        lanes,
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
    let taps = interval.taps;
    let (phases, rest_phases) = phases[..taps].as_chunks_mut();
    let (sums, rest_sums) = sums[..taps].as_chunks_mut();
    for (phases, sums) in phases.iter_mut().zip(sums) {
        add_taps::<4>(&chunk, phases, sums);
    }
    match (rest_phases, rest_sums) {
        ([a, b, c], [x, y, z]) => {
            let (mut phases, mut sums) = ([*a, *b, *c], [*x, *y, *z]);
            add_taps::<3>(&chunk, &mut phases, &mut sums);
            [*a, *b, *c] = phases;
            [*x, *y, *z] = sums;
        }
        (phases, sums) => {
            for (phase, sum) in phases.iter_mut().zip(sums) {
                add_taps::<1>(
                    &chunk,
                    std::array::from_mut(phase),
                    std::array::from_mut(sum),
                );
            }
        }
    }
}

#[target_feature(enable = "avx512f,avx512bw,fma")]
fn add_changes(baseband: &mut Baseband, changes: &mut ChangeSums, chunk: &AddedChunk<'_>) {
    changes.add(chunk, baseband, |grid, batch| locate(grid, batch));
}

/// Changes located at a time.
const BATCH: usize = 32;

/// As [`Grid::locate`].
#[target_feature(enable = "avx512f,avx512bw")]
fn locate(grid: &Grid<'_>, batch: &[u16; BATCH]) -> Located<BATCH> {
    let zero = _mm512_setzero_si512();
    let chip_samples = _mm512_set1_epi32(grid.chip_samples.cast_signed());
    let origin = _mm512_set1_epi32(grid.origin.cast_signed());
    let chips = _mm512_srli_epi16::<1>(load(batch));
    let chips = _mm512_sub_epi16(chips, _mm512_set1_epi16(grid.first_chip.cast_signed()));
    let rest = _mm512_mulhi_epu16(chips, _mm512_set1_epi16(grid.rest.cast_signed()));
    let position = |chips, rest| {
        let position = _mm512_add_epi32(_mm512_mullo_epi32(chips, chip_samples), rest);
        _mm512_add_epi32(position, origin)
    };
    let low = position(
        _mm512_unpacklo_epi16(chips, zero),
        _mm512_unpacklo_epi16(rest, zero),
    );
    let high = position(
        _mm512_unpackhi_epi16(chips, zero),
        _mm512_unpackhi_epi16(rest, zero),
    );
    let most = _mm512_set1_epi32(0xffff);
    let next = |position| _mm512_srli_epi32::<16>(_mm512_add_epi32(position, most));
    let at = _mm512_packus_epi32(next(low), next(high));
    let fraction = _mm512_packus_epi32(_mm512_and_si512(low, most), _mm512_and_si512(high, most));
    let fraction = _mm512_srli_epi16::<FRACTION_SHIFT>(_mm512_sub_epi16(zero, fraction));
    let one = _mm512_set1_epi16(1);
    let passed = grid.limits.iter().fold(zero, |passed, limit| {
        let passes = _mm512_cmpgt_epi16_mask(fraction, _mm512_set1_epi16(*limit));
        _mm512_mask_add_epi16(passed, passes, passed, one)
    });
    let bit = _mm512_and_si512(load(batch), one);
    let slot = _mm512_add_epi16(_mm512_add_epi16(passed, passed), bit);
    // SAFETY: vectors of 32 numbers of 16 bits, as arrays of them.
    unsafe {
        Located {
            at: std::mem::transmute::<__m512i, [u16; BATCH]>(at),
            slot: std::mem::transmute::<__m512i, [u16; BATCH]>(slot),
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

#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni,fma")]
fn add_taps<const TAPS: usize>(
    chunk: &Chunk<'_>,
    phases: &mut [u64; TAPS],
    sums: &mut [Sums; TAPS],
) {
    // A sum of its own for each vector of a block: one alone would wait for itself.
    let mut in_phase = [[_mm512_setzero_si512(); VECTORS]; TAPS];
    let mut quadrature = [[_mm512_setzero_si512(); VECTORS]; TAPS];
    let mut now = *phases;
    let origins: [usize; VECTORS] =
        std::array::from_fn(|vector| chunk.lanes.origin_chips(vector * LANES) & 127);
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
                let window = load(window(chunk.code, chip + origins[vector]));
                let code = _mm512_permutexvar_epi8(load(&row[vector]), window);
                let (in_phase, quadrature) =
                    (&mut in_phase[tap][vector], &mut quadrature[tap][vector]);
                *in_phase = _mm512_dpbusd_epi32(*in_phase, code, i);
                *quadrature = _mm512_dpbusd_epi32(*quadrature, code, q);
            }
            now[tap] = phase + chunk.step;
        }
    }
    *phases = now.map(within_period);
    for tap in 0..TAPS {
        let total = [in_phase[tap], quadrature[tap]];
        let total = total.map(|[first, second]| _mm512_add_epi32(first, second));
        add_turned(&mut sums[tap], total, chunk.turn);
    }
}

/// The code from `chip` (at most [`MOST_CHIPS`] + 127) on.
#[inline(always)]
fn window(code: &CodeBits, chip: usize) -> &[u8; LANES] {
    const { assert!(size_of::<CodeBits>() >= MOST_CHIPS + 127 + LANES) };
    // SAFETY: the window lies within `CodeBits`, and bytes are always aligned.
    unsafe { &*code.as_ptr().add(chip).cast() }
}

/// The vectors of a block.
#[inline]
#[target_feature(enable = "avx512f")]
fn vectors(block: &[i8; BLOCK_SAMPLES]) -> [__m512i; VECTORS] {
    let (vectors, _) = block.as_chunks::<LANES>();
    std::array::from_fn(|vector| load(&vectors[vector]))
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load<T: Copy, const N: usize>(values: &[T; N]) -> __m512i {
    const { assert!(size_of::<T>() * N == 64) };
    // SAFETY: the array is 64 bytes long, and the load asks for no alignment.
    unsafe { _mm512_loadu_si512(values.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(values: &mut [i8; LANES], vector: __m512i) {
    // SAFETY: the array is 64 bytes long, and the store asks for no alignment.
    unsafe { _mm512_storeu_si512(values.as_mut_ptr().cast(), vector) }
}

/// Adds the sums of a chunk, turned by the carrier phase at its start.
#[inline]
#[target_feature(enable = "avx512f,fma")]
fn add_turned(sums: &mut Sums, chunk: [__m512i; 2], turn: Complex64) {
    let [i, q] = chunk.map(|sum| _mm512_cvtepi32_ps(sum));
    let re = _mm512_set1_ps(turn.re as f32);
    let im = _mm512_set1_ps(turn.im as f32);
    sums[0] = _mm512_fnmadd_ps(q, im, _mm512_fmadd_ps(i, re, sums[0]));
    sums[1] = _mm512_fmadd_ps(q, re, _mm512_fmadd_ps(i, im, sums[1]));
}

/// Wipes the carrier off real samples and returns the sums of the baseband.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn wipe_off_real(
    samples: &[i8],
    shift: i32,
    carrier: &CarrierTable,
    out: &mut Baseband,
) -> [__m512i; 2] {
    // A sample is moved to the top of a 16-bit lane, then down to its shifted place.
    let down = _mm_cvtsi32_si128(8 - shift);
    let zero = _mm512_setzero_si512();
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
        let first = _mm512_sra_epi16(_mm512_unpacklo_epi8(zero, x), down);
        let second = _mm512_sra_epi16(_mm512_unpackhi_epi8(zero, x), down);
        let baseband_i = _mm512_packs_epi16(
            _mm512_mulhrs_epi16(first, load(&re[0])),
            _mm512_mulhrs_epi16(second, load(&re[1])),
        );
        let baseband_q = _mm512_packs_epi16(
            _mm512_mulhrs_epi16(first, load(&im[0])),
            _mm512_mulhrs_epi16(second, load(&im[1])),
        );
        store(i, baseband_i);
        store(q, baseband_q);
        add_total(&mut totals, baseband_i, baseband_q);
    }
    totals
}

/// Wipes the carrier off complex samples and returns the sums of the baseband.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn wipe_off_complex(
    samples: &[i8],
    shift: i32,
    carrier: &CarrierTable,
    out: &mut Baseband,
) -> [__m512i; 2] {
    // Components are moved to the top of a 16-bit lane, then down to their shifted place.
    let down = _mm_cvtsi32_si128(8 - shift);
    let mut totals = [_mm512_setzero_si512(); 2];
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
            _mm512_shuffle_i64x2::<0b10_00_10_00>(x[0], x[1]),
            _mm512_shuffle_i64x2::<0b11_01_11_01>(x[0], x[1]),
        ];
        let mut wide_i = [_mm512_setzero_si512(); 2];
        let mut wide_q = [_mm512_setzero_si512(); 2];
        for half in 0..2 {
            let (re, im) = (load(&re[half]), load(&im[half]));
            let x_i = _mm512_sra_epi16(_mm512_slli_epi16::<8>(x[half]), down);
            let x_q = _mm512_and_si512(x[half], _mm512_set1_epi16(-256));
            let x_q = _mm512_sra_epi16(x_q, down);
            wide_i[half] =
                _mm512_sub_epi16(_mm512_mulhrs_epi16(x_i, re), _mm512_mulhrs_epi16(x_q, im));
            wide_q[half] =
                _mm512_add_epi16(_mm512_mulhrs_epi16(x_i, im), _mm512_mulhrs_epi16(x_q, re));
        }
        let baseband_i = _mm512_packs_epi16(wide_i[0], wide_i[1]);
        let baseband_q = _mm512_packs_epi16(wide_q[0], wide_q[1]);
        store(i, baseband_i);
        store(q, baseband_q);
        add_total(&mut totals, baseband_i, baseband_q);
    }
    totals
}

#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn add_total(totals: &mut [__m512i; 2], i: __m512i, q: __m512i) {
    let ones = _mm512_set1_epi8(1);
    totals[0] = _mm512_dpbusd_epi32(totals[0], ones, i);
    totals[1] = _mm512_dpbusd_epi32(totals[1], ones, q);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correlator::change_sums::tests::is_located_as_in_plain_rust;

    #[test]
    #[allow(clippy::print_stdout, reason = "a skip must not be silent")]
    fn windows_are_located_as_in_plain_rust() {
        if !is_supported() {
            println!("SKIPPED: no AVX-512");
            return;
        }
        // SAFETY: the instruction set is there.
        is_located_as_in_plain_rust(|grid, batch| unsafe { locate(grid, batch) });
    }
}
