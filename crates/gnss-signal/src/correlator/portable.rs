//! The inner loops in plain Rust, written for the compiler to vectorise.

use num_complex::Complex64;

use super::{
    carrier_table::{CHUNK_SAMPLES, CarrierTable},
    fixed_point::{Baseband, CODE_PERIOD, Interval, Kernel},
};
use crate::{CA_CODE_LENGTH_CHIPS, MAX_TAPS};

/// Fixed-point kernel for any processor.
#[derive(Debug)]
pub(super) struct Portable {
    baseband: Baseband,
    code: [u8; CHUNK_SAMPLES],
    phases: [u64; MAX_TAPS],
    sums: [Complex64; MAX_TAPS],
    baseband_sum: Complex64,
}

impl Default for Portable {
    fn default() -> Self {
        Self {
            baseband: Baseband::zeroed(),
            code: [0; CHUNK_SAMPLES],
            phases: [0; MAX_TAPS],
            sums: [Complex64::default(); MAX_TAPS],
            baseband_sum: Complex64::default(),
        }
    }
}

impl Kernel for Portable {
    fn start(&mut self, interval: &Interval<'_>) {
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
        let (i, q) = (&self.baseband.i[..len], &self.baseband.q[..len]);
        let total = |values: &[i8]| values.iter().map(|&v| i32::from(v)).sum::<i32>();
        self.baseband_sum += turn * Complex64::new(total(i).into(), total(q).into());
        let code = &mut self.code[..len];
        let step = interval.code_step(len);
        for (phase, sum) in self
            .phases
            .iter_mut()
            .zip(&mut self.sums)
            .take(interval.taps)
        {
            fill_code(interval, *phase, code);
            *sum += turn * Complex64::new(dot(code, i).into(), dot(code, q).into());
            *phase = (*phase + step) % CODE_PERIOD;
        }
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
    let out = out.i.iter_mut().zip(&mut out.q);
    for ((&x, (&re, &im)), (i, q)) in samples.iter().zip(table).zip(out) {
        let x = i16::from(x) << shift;
        *i = saturate(product(x, re));
        *q = saturate(product(x, im));
    }
}

fn wipe_off_complex(samples: &[i8], shift: i32, carrier: &CarrierTable, out: &mut Baseband) {
    let (samples, _) = samples.as_chunks::<2>();
    let table = carrier.re.iter().zip(&carrier.im);
    let out = out.i.iter_mut().zip(&mut out.q);
    for ((x, (&re, &im)), (i, q)) in samples.iter().zip(table).zip(out) {
        let [x_i, x_q] = x.map(|x| i16::from(x) << shift);
        *i = saturate(product(x_i, re) - product(x_q, im));
        *q = saturate(product(x_i, im) + product(x_q, re));
    }
}

/// Code bits of consecutive samples, chip by chip.
fn fill_code(interval: &Interval<'_>, phase: u64, out: &mut [u8]) {
    let samples_per_chip = interval.code_step_chips.recip();
    let mut chip = (phase >> 32) as usize;
    let fraction_chips = (phase & u64::from(u32::MAX)) as f64 / 4_294_967_296.0;
    let mut chips_ended = 1.0 - fraction_chips;
    let mut start = 0;
    while start < out.len() {
        let end = ((chips_ended * samples_per_chip).ceil() as usize).min(out.len());
        out[start..end].fill(interval.code[chip]);
        start = end;
        chips_ended += 1.0;
        chip = (chip + 1) % CA_CODE_LENGTH_CHIPS;
    }
}

fn dot(code: &[u8], values: &[i8]) -> i32 {
    let products = code.iter().zip(values);
    products
        .map(|(&bit, &value)| i32::from(i16::from(bit) * i16::from(value)))
        .sum()
}
