//! Symmetric filters whose delay is taken out: from half samples to samples, and the front end.

use std::f64::consts::PI;

use super::lanes::{self, Floats, Kernel, LANES};
use super::planes::Planes;

/// Half the length of the front-end filter, samples; its transition is 3.3 / 65 of the rate wide.
pub(in crate::scenario) const REACH: usize = 32;
const TAPS: usize = 2 * REACH + 1;

/// Half the length of the half-band filter, in samples of each of its two inputs.
pub(super) const HALF_BAND_REACH: usize = 12;

/// Vectors of samples that one pass over the taps makes.
const VECTORS: usize = 4;
const STRIDE: usize = VECTORS * LANES;

/// The low-pass of the front end: a windowed sinc (Hamming) with unit gain at zero frequency.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LowPass {
    taps: [f32; TAPS],
}

impl LowPass {
    /// Passes `bandwidth`, two-sided, as a fraction of the sample rate.
    pub(super) fn new(bandwidth: f64) -> Self {
        let tap = |k: usize| response(bandwidth, k as f64 - REACH as f64);
        let gain: f64 = (0..TAPS).map(tap).sum();
        Self {
            taps: std::array::from_fn(|k| (tap(k) / gain) as f32),
        }
    }

    /// What is left of the power of white noise.
    pub(super) fn noise_gain(&self) -> f64 {
        self.taps.iter().map(|tap| f64::from(*tap).powi(2)).sum()
    }

    /// Makes `samples` of `out` from planes that begin [`REACH`] samples before them, and
    /// `skipped` more.
    pub(super) fn filter(&self, from: &Planes, skipped: usize, samples: usize, out: &mut Planes) {
        out.clear(samples);
        for (from, to) in [(&from.i, &mut out.i), (&from.q, &mut out.q)] {
            lanes::run(Convolve {
                taps: &self.taps,
                from: &from[skipped..],
                to,
            });
        }
    }
}

/// Impulse response of the front-end filter, which passes `bandwidth` (two-sided, over the sample
/// rate), so many samples from its middle: up to a factor, and zero beyond [`REACH`].
pub(in crate::scenario) fn response(bandwidth: f64, from_middle: f64) -> f64 {
    if from_middle.abs() > REACH as f64 {
        return 0.0;
    }
    let window = 0.54 + 0.46 * (PI * from_middle / (REACH + 1) as f64).cos();
    sinc(bandwidth * from_middle) * window
}

/// sin(pi x) / (pi x).
fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

/// The low-pass from two samples a tick to one: half its taps are zero.
///
/// Flat to 0.425 of the sample rate; what lies beyond 0.575, and would fold into that, is 58 dB
/// down; in between it falls to 6 dB at half the rate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HalfBand {
    /// Taps on either side of the middle, from it outwards; that of the middle is 1/2.
    taps: [f32; HALF_BAND_REACH],
}

impl HalfBand {
    /// Shape of the Kaiser window for 60 dB (`Kaiser1974`).
    const BETA: f64 = 5.65;

    pub(super) fn new() -> Self {
        let tap = |k: usize| {
            let from_middle = (2 * k + 1) as f64;
            let x = from_middle / (2 * HALF_BAND_REACH) as f64;
            0.5 * sinc(0.5 * from_middle) * bessel_i0(Self::BETA * (1.0 - x * x).sqrt())
                / bessel_i0(Self::BETA)
        };
        // With the middle, unit gain at zero frequency.
        let gain: f64 = 4.0 * (0..HALF_BAND_REACH).map(tap).sum::<f64>();
        Self {
            taps: std::array::from_fn(|k| (tap(k) / gain) as f32),
        }
    }

    /// Makes `samples` of `out` from samples on ticks and samples half a tick later, both from
    /// [`HALF_BAND_REACH`] ticks before them on.
    pub(super) fn decimate(&self, on: &Planes, between: &Planes, samples: usize, out: &mut Planes) {
        out.clear(samples);
        let planes = [
            (&on.i, &between.i, &mut out.i),
            (&on.q, &between.q, &mut out.q),
        ];
        for (on, between, to) in planes {
            lanes::run(Decimate {
                taps: &self.taps,
                on,
                between,
                to,
            });
        }
    }
}

/// Modified Bessel function of the first kind and order 0 (Abramowitz1964, 9.6.12).
fn bessel_i0(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        term *= (x / f64::from(2 * k)).powi(2);
        sum += term;
    }
    sum
}

struct Convolve<'a> {
    taps: &'a [f32; TAPS],
    from: &'a [f32],
    to: &'a mut [f32],
}

impl Kernel for Convolve<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let Self { taps, from, to } = self;
        each_stride(to, |at, vectors| sum_of_taps::<F>(taps, from, at, vectors));
    }
}

struct Decimate<'a> {
    taps: &'a [f32; HALF_BAND_REACH],
    on: &'a [f32],
    between: &'a [f32],
    to: &'a mut [f32],
}

impl Kernel for Decimate<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let Self {
            taps,
            on,
            between,
            to,
        } = self;
        each_stride(
            to,
            #[inline(always)]
            |at, out| {
                let mut sums = [F::splat(0.0); VECTORS];
                for (j, tap) in taps.iter().enumerate() {
                    let tap = F::splat(*tap);
                    let after = strip(between, at + HALF_BAND_REACH + j, out.len());
                    let before = strip(between, at + HALF_BAND_REACH - 1 - j, out.len());
                    for ((sum, a), b) in sums.iter_mut().zip(after).zip(before) {
                        *sum = *sum + (F::load(a) + F::load(b)) * tap;
                    }
                }
                let middle = strip(on, at + HALF_BAND_REACH, out.len());
                for ((sum, middle), out) in sums.iter().zip(middle).zip(out) {
                    (*sum + F::load(middle) * F::splat(0.5)).store(out);
                }
            },
        );
    }
}

/// Convolution with symmetric taps of `out`, which begins at `at`.
#[inline(always)]
fn sum_of_taps<F: Floats>(taps: &[f32; TAPS], from: &[f32], at: usize, out: &mut [[f32; LANES]]) {
    let mut sums = [F::splat(0.0); VECTORS];
    for (j, tap) in taps.iter().enumerate() {
        let tap = F::splat(*tap);
        for (sum, input) in sums.iter_mut().zip(strip(from, at + j, out.len())) {
            *sum = *sum + F::load(input) * tap;
        }
    }
    for (sum, out) in sums.iter().zip(out) {
        sum.store(out);
    }
}

/// `vectors` vectors of a plane from `at` on.
#[inline(always)]
fn strip(plane: &[f32], at: usize, vectors: usize) -> &[[f32; LANES]] {
    plane[at..at + vectors * LANES].as_chunks().0
}

/// Calls `make` with every stride of a plane and where it begins; the last may be shorter.
#[inline(always)]
fn each_stride(plane: &mut [f32], make: impl Fn(usize, &mut [[f32; LANES]])) {
    let (vectors, _) = plane.as_chunks_mut::<LANES>();
    for (k, vectors) in vectors.chunks_mut(VECTORS).enumerate() {
        make(k * STRIDE, vectors);
    }
}
