//! Symmetric filters whose delay is taken out: from half samples to samples, and the front end.

use std::f64::consts::PI;

use super::lanes::{self, Floats, Kernel, LANES};
use super::planes::Planes;

/// Half the length of the front-end filter, samples; its transition is 3.3 / 65 of the rate wide.
pub(in crate::scenario) const REACH: usize = 32;
const TAPS: usize = 2 * REACH + 1;

/// Half the length of the half-band filter, in samples of each of its two inputs.
pub(super) const HALF_BAND_REACH: usize = 12;

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
        out.fit(samples);
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
    /// Taps of the samples between ticks; on ticks that of the middle is 1/2 and the others are 0.
    taps: [f32; 2 * HALF_BAND_REACH],
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
        let from_middle = |k: usize| match k.checked_sub(HALF_BAND_REACH) {
            Some(after) => after,
            None => HALF_BAND_REACH - 1 - k,
        };
        Self {
            taps: std::array::from_fn(|k| (tap(from_middle(k)) / gain) as f32),
        }
    }

    /// Makes `samples` of `out` from samples on ticks and samples half a tick later, both from
    /// [`HALF_BAND_REACH`] ticks before them on.
    pub(super) fn decimate(&self, on: &Planes, between: &Planes, samples: usize, out: &mut Planes) {
        out.fit(samples);
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
        let (first, rest) = taps.split_at(REACH);
        let (second, last) = rest.split_at(REACH);
        each_stride(
            to,
            #[inline(always)]
            |at, out| {
                let zeros = [F::splat(0.0); STRIDE];
                let sums = weighed::<F, 4>(zeros, first, from, at, out.len());
                let sums = weighed::<F, 4>(sums, second, from, at + REACH, out.len());
                let last = F::splat(last[0]);
                let ends = strip(from, at + 2 * REACH, out.len());
                for ((sum, end), out) in sums.iter().zip(ends).zip(out) {
                    F::load(end).fused(last, *sum).store(out);
                }
            },
        );
    }
}

struct Decimate<'a> {
    taps: &'a [f32; 2 * HALF_BAND_REACH],
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
        let half = F::splat(0.5);
        each_stride(
            to,
            #[inline(always)]
            |at, out| {
                let zeros = [F::splat(0.0); STRIDE];
                let sums = weighed::<F, 3>(zeros, taps, between, at, out.len());
                let middles = strip(on, at + HALF_BAND_REACH, out.len());
                for ((sum, middle), out) in sums.iter().zip(middles).zip(out) {
                    F::load(middle).fused(half, *sum).store(out);
                }
            },
        );
    }
}

/// Vectors of samples that are made together: as many sums as keep both multipliers busy.
const STRIDE: usize = 8;

/// Adds to the sums of the `vectors` that begin at `at` the samples from there on times `taps`,
/// [`LANES`] times `M` of them.
///
/// Taps a multiple of [`LANES`] apart read the same vectors for different outputs, so that each is
/// loaded once for up to `M` of them.
#[inline(always)]
fn weighed<F: Floats, const M: usize>(
    mut sums: [F; STRIDE],
    taps: &[f32],
    from: &[f32],
    at: usize,
    vectors: usize,
) -> [F; STRIDE] {
    for (first, _) in taps.iter().take(LANES).enumerate() {
        let taps: [F; M] = std::array::from_fn(|m| F::splat(taps[first + m * LANES]));
        let strip = strip(from, at + first, vectors + M - 1);
        if vectors == STRIDE {
            weigh(&mut sums, &taps, strip);
        } else {
            for (k, sum) in sums.iter_mut().enumerate().take(vectors) {
                weigh(std::array::from_mut(sum), &taps, &strip[k..]);
            }
        }
    }
    sums
}

/// Adds every vector of `strip` times each of `taps` to the sum it belongs to.
#[inline(always)]
fn weigh<F: Floats, const N: usize, const M: usize>(
    sums: &mut [F; N],
    taps: &[F; M],
    strip: &[[f32; LANES]],
) {
    // Vector by vector, so that none is held in a register for later.
    for (n, vector) in strip[..N + M - 1].iter().enumerate() {
        let vector = F::load(vector);
        for (m, tap) in taps.iter().enumerate() {
            if let Some(sum) = n.checked_sub(m).and_then(|k| sums.get_mut(k)) {
                *sum = vector.fused(*tap, *sum);
            }
        }
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
    for (k, vectors) in vectors.chunks_mut(STRIDE).enumerate() {
        make(k * STRIDE * LANES, vectors);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without a pattern, in [-1, 1).
    fn planes(samples: usize, seed: u32) -> Planes {
        let mut planes = Planes::default();
        planes.clear(samples);
        let mut state = seed;
        for x in planes.i.iter_mut().chain(&mut planes.q) {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *x = state as f32 / (1_u32 << 31) as f32 - 1.0;
        }
        planes
    }

    /// Holds what was made against a sum of products in `f64`.
    fn check(made: &[f32], expected: impl Fn(usize) -> f64) {
        for (n, made) in made.iter().enumerate() {
            // 65 products of at most 0.8 that are rounded to 2^-24, and so are their sums.
            assert!((f64::from(*made) - expected(n)).abs() < 2e-6, "sample {n}");
        }
    }

    #[test]
    fn the_low_pass_is_its_sum_of_products() {
        let low_pass = LowPass::new(0.8);
        let from = planes(1000, 1);
        // Whole strides, and a part of one.
        for samples in [8, 128, 200, 840] {
            let mut out = Planes::default();
            low_pass.filter(&from, 40, samples, &mut out);
            for (from, made) in [(&from.i, &out.i), (&from.q, &out.q)] {
                check(made, |n| {
                    let taps = low_pass.taps.iter().zip(&from[40 + n..]);
                    taps.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
                });
            }
        }
    }

    #[test]
    fn the_half_band_filter_is_its_sum_of_products() {
        let half_band = HalfBand::new();
        let (on, between) = (planes(1000, 2), planes(1000, 3));
        for samples in [8, 64, 936] {
            let mut out = Planes::default();
            half_band.decimate(&on, &between, samples, &mut out);
            check(&out.i, |n| {
                let taps = half_band.taps.iter().zip(&between.i[n..]);
                let sum: f64 = taps.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                sum + 0.5 * f64::from(on.i[n + HALF_BAND_REACH])
            });
        }
    }

    #[test]
    fn a_signal_of_the_band_passes_and_one_that_would_fold_does_not() {
        let half_band = HalfBand::new();
        let wave = |cycles_per_tick: f64, stagger: f64| {
            let at = |n: usize| (2.0 * PI * cycles_per_tick * (n as f64 + stagger)).cos() as f32;
            let values: Vec<f32> = (0..1000).map(at).collect();
            Planes {
                i: values.clone(),
                q: values,
            }
        };
        for (cycles_per_tick, gain) in
            [(0.0, 1.0), (0.2, 1.0), (0.42, 1.0), (0.58, 0.0), (0.9, 0.0)]
        {
            let mut out = Planes::default();
            let (on, between) = (wave(cycles_per_tick, 0.0), wave(cycles_per_tick, 0.5));
            half_band.decimate(&on, &between, 800, &mut out);
            let expected =
                |n: usize| gain * (2.0 * PI * cycles_per_tick * (n + HALF_BAND_REACH) as f64).cos();
            for (n, made) in out.i.iter().enumerate() {
                // 55 dB, 3 dB above the stop band that the window is made for.
                assert!(
                    (f64::from(*made) - expected(n)).abs() < 1.8e-3,
                    "{cycles_per_tick}"
                );
            }
        }
    }
}
