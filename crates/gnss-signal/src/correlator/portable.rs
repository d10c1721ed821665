//! The inner loops in plain Rust, written for the compiler to vectorise.

use num_complex::Complex64;

use super::{
    baseband::Baseband,
    carrier_table::CarrierTable,
    change_sums::{AddedChunk, ChangeSums},
    code_bits::CodeBits,
    fixed_point::Kernel,
    interval::{BLOCK_SAMPLES, CODE_PERIOD, Interval},
    lane_table::{LaneTable, LaneTables},
};
use crate::MAX_TAPS;

/// Fixed-point kernel for any processor.
#[derive(Debug)]
pub(super) struct Portable {
    lanes: LaneTables,
    baseband: Baseband,
    phases: [u64; MAX_TAPS],
    sums: [Complex64; MAX_TAPS],
    baseband_sum: Complex64,
}

impl Default for Portable {
    fn default() -> Self {
        Self {
            lanes: LaneTables::new([0; BLOCK_SAMPLES]),
            baseband: Baseband::zeroed(),
            phases: [0; MAX_TAPS],
            sums: [Complex64::default(); MAX_TAPS],
            baseband_sum: Complex64::default(),
        }
    }
}

impl Kernel for Portable {
    const VECTOR: usize = 16;

    fn start(&mut self, interval: &Interval<'_>) {
        self.lanes.select(interval.code_step_chips);
        self.phases = interval.phases;
        self.sums = [Complex64::default(); MAX_TAPS];
        self.baseband_sum = Complex64::default();
    }

    fn add(
        &mut self,
        interval: &Interval<'_>,
        samples: &[i8],
        carrier: &CarrierTable,
        turn: Complex64,
    ) {
        let len = samples.len() / interval.components();
        if interval.complex {
            wipe_off_complex(samples, interval.shift, carrier, &mut self.baseband);
        } else {
            wipe_off_real(samples, interval.shift, carrier, &mut self.baseband);
        }
        let [i, q] = self.baseband.parts().map(|part| &part[..len]);
        let total = |values: &[i8]| values.iter().map(|&v| i32::from(v)).sum::<i32>();
        self.baseband_sum += turn * Complex64::new(total(i).into(), total(q).into());
        let Some(lanes) = self.lanes.current() else {
            return;
        };
        let step = interval.code_step(BLOCK_SAMPLES);
        let blocks = || i.as_chunks().0.iter().zip(q.as_chunks().0);
        for (phase, sum) in self
            .phases
            .iter_mut()
            .zip(&mut self.sums)
            .take(interval.taps)
        {
            let mut total = [0; 2];
            for (i, q) in blocks() {
                let code = code_of(interval.code, lanes, *phase);
                total[0] += dot(&code, i);
                total[1] += dot(&code, q);
                *phase = (*phase + step) % CODE_PERIOD;
            }
            *sum += turn * Complex64::new(total[0].into(), total[1].into());
        }
    }

    fn add_changes(&mut self, changes: &mut ChangeSums, chunk: &AddedChunk<'_>) {
        changes.add(chunk, &mut self.baseband, |grid, batch: &[u16; 16]| {
            grid.locate(batch)
        });
    }

    fn sums(&self, sums: &mut [Complex64]) -> Complex64 {
        sums.copy_from_slice(&self.sums[..sums.len()]);
        self.baseband_sum
    }
}

/// `x * c / 32768`, rounded as the vector instruction `pmulhrsw` does.
fn product(x: i16, c: i16) -> i32 {
    (i32::from(x) * i32::from(c) + (1 << 14)) >> 15
}

fn saturate(value: i32) -> i8 {
    value.clamp(-128, 127) as i8
}

fn wipe_off_real(samples: &[i8], shift: i32, carrier: &CarrierTable, out: &mut Baseband) {
    let table = carrier.re.iter().zip(&carrier.im);
    let [out_i, out_q] = out.parts_mut();
    let out = out_i.iter_mut().zip(out_q);
    for ((&x, (&re, &im)), (i, q)) in samples.iter().zip(table).zip(out) {
        let x = i16::from(x) << shift;
        *i = saturate(product(x, re));
        *q = saturate(product(x, im));
    }
}

fn wipe_off_complex(samples: &[i8], shift: i32, carrier: &CarrierTable, out: &mut Baseband) {
    let (samples, _) = samples.as_chunks::<2>();
    let table = carrier.re.iter().zip(&carrier.im);
    let [out_i, out_q] = out.parts_mut();
    let out = out_i.iter_mut().zip(out_q);
    for ((x, (&re, &im)), (i, q)) in samples.iter().zip(table).zip(out) {
        let [x_i, x_q] = x.map(|x| i16::from(x) << shift);
        *i = saturate(product(x_i, re) - product(x_q, im));
        *q = saturate(product(x_i, im) + product(x_q, re));
    }
}

/// Code bits of a block that starts at `phase`, as masks.
fn code_of(code: &CodeBits, lanes: &LaneTable, phase: u64) -> [i8; BLOCK_SAMPLES] {
    let window = &code[(phase >> 32) as usize & 1023..];
    let row = lanes.row(phase as u32);
    let mut masks = [0; BLOCK_SAMPLES];
    if let Some(window) = window.first_chunk::<256>() {
        for (mask, &chip) in masks.iter_mut().zip(row) {
            *mask = (window[usize::from(chip)] as i8).wrapping_neg();
        }
    }
    masks
}

/// Sum of the values under a mask; of 128 values it fits 16 bits.
fn dot(masks: &[i8; BLOCK_SAMPLES], values: &[i8; BLOCK_SAMPLES]) -> i32 {
    let masked = masks
        .iter()
        .zip(values)
        .map(|(mask, value)| i16::from(mask & value));
    i32::from(masked.fold(0_i16, i16::wrapping_add))
}
