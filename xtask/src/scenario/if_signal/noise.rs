//! White Gaussian noise that is a function of seed, stream and tick, so that any part of it can be
//! made at any time.
//!
//! Philox4x32-10 (Salmon2011) turns a counter into 4 random words: two complex samples of
//! independent components (`BoxMuller1958`). The largest value is 6.6 standard deviations.

use std::f32::consts::FRAC_PI_4;

use super::lanes::{self, Floats, Kernel, LANES, Words};
use super::planes::Planes;

/// Samples made together; noise is added from ticks that are multiples of it.
pub(super) const GROUP: usize = 2 * LANES;

const ROUNDS: usize = 10;
const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const KEY_STEPS: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];

/// A stream of noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    seed: u64,
    stream: u32,
}

impl Noise {
    /// Stream number `stream` of `seed`.
    pub(super) const fn new(seed: u64, stream: u32) -> Self {
        Self { seed, stream }
    }

    /// Adds noise of standard deviation `deviation` in each component; the first sample of
    /// `planes` is `tick`, a multiple of [`GROUP`], and so is their length.
    pub(super) fn add(self, tick: i64, deviation: f32, planes: &mut Planes) {
        debug_assert_eq!(tick.rem_euclid(GROUP as i64), 0);
        debug_assert_eq!(planes.i.len() % GROUP, 0);
        lanes::run(AddNoise {
            noise: self,
            // A half of the samples, for a counter makes two.
            counter: (tick / 2) as u64,
            deviation,
            planes,
        });
    }
}

struct AddNoise<'a> {
    noise: Noise,
    counter: u64,
    deviation: f32,
    planes: &'a mut Planes,
}

impl Kernel for AddNoise<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let (i, _) = self.planes.i.as_chunks_mut::<GROUP>();
        let (q, _) = self.planes.q.as_chunks_mut::<GROUP>();
        let lane = F::Words::load(&std::array::from_fn(|k| k as u32));
        let stream = F::Words::splat(self.noise.stream);
        let key = [self.noise.seed as u32, (self.noise.seed >> 32) as u32];
        let deviation = F::splat(self.deviation);
        let mut counter = self.counter;
        for (i, q) in i.iter_mut().zip(q) {
            // A counter is a multiple of 8: lanes never carry into the upper word.
            let low = F::Words::splat(counter as u32) + lane;
            let high = F::Words::splat((counter >> 32) as u32);
            let words = philox([low, high, stream, F::Words::splat(0)], key);
            let (i, q) = (i.as_chunks_mut::<LANES>().0, q.as_chunks_mut::<LANES>().0);
            for (pair, (i, q)) in words.chunks_exact(2).zip(i.iter_mut().zip(q)) {
                let (a, b) = normal::<F>(pair[0], pair[1]);
                a.fused(deviation, F::load(i)).store(i);
                b.fused(deviation, F::load(q)).store(q);
            }
            counter = counter.wrapping_add(LANES as u64);
        }
    }
}

/// Philox4x32-10.
#[inline(always)]
fn philox<W: Words>(mut counter: [W; 4], mut key: [u32; 2]) -> [W; 4] {
    for _ in 0..ROUNDS {
        let (high_0, low_0) = counter[0].product(MULTIPLIERS[0]);
        let (high_1, low_1) = counter[2].product(MULTIPLIERS[1]);
        counter = [
            high_1 ^ counter[1] ^ W::splat(key[0]),
            low_1,
            high_0 ^ counter[3] ^ W::splat(key[1]),
            low_0,
        ];
        key = [
            key[0].wrapping_add(KEY_STEPS[0]),
            key[1].wrapping_add(KEY_STEPS[1]),
        ];
    }
    counter
}

/// Two independent normal numbers from two words: radius sqrt(-2 ln u) and a direction.
#[inline(always)]
fn normal<F: Floats>(radius: F::Words, direction: F::Words) -> (F, F) {
    const TO_UNIT: f32 = 1.0 / (1_u64 << 31) as f32;
    let unit = (radius.right::<1>().to_floats() + F::splat(0.5)) * F::splat(TO_UNIT);
    let radius = (logarithm(unit) * F::splat(-2.0)).max(F::splat(0.0)).sqrt();
    let (cosine, sine) = quarter::<F>(direction.left::<2>());
    // Two bits choose one of four quarters: exchange, and the sign of the cosine.
    let exchange = F::Words::splat(0) - (direction.right::<31>());
    let sign = (direction.left::<1>()) & F::Words::splat(1 << 31);
    let (cosine, sine) = (cosine.bits() ^ sign, sine.bits());
    let difference = (cosine ^ sine) & exchange;
    (
        (cosine ^ difference).as_floats() * radius,
        (sine ^ difference).as_floats() * radius,
    )
}

/// Natural logarithm of positive normal numbers, to 2e-7 of itself: with x = 2^e m, m from 0.7 to 1.4 and
/// s = (m - 1) / (m + 1), ln m = 2 (s + s^3 / 3 + s^5 / 5 ...) (Abramowitz1964, 4.1.27).
#[inline(always)]
fn logarithm<F: Floats>(x: F) -> F {
    const SQRT_HALF: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    let from_sqrt_half = x.bits() - F::Words::splat(SQRT_HALF);
    // The exponent keeps its sign: bias it, shift, and take the bias off.
    let biased = (from_sqrt_half + F::Words::splat(128 << 23)).right::<23>();
    let exponent = (biased - F::Words::splat(128)).to_floats();
    let mantissa = from_sqrt_half & F::Words::splat((1 << 23) - 1);
    let m = (mantissa + F::Words::splat(SQRT_HALF)).as_floats();
    let one = F::splat(1.0);
    let s = (m - one).over(m + one);
    let s2 = s * s;
    let series = F::splat(2.0 / 9.0).fused(s2, F::splat(2.0 / 7.0));
    let series = series.fused(s2, F::splat(2.0 / 5.0));
    let series = series.fused(s2, F::splat(2.0 / 3.0));
    let series = series.fused(s2, F::splat(2.0));
    exponent.fused(F::splat(std::f32::consts::LN_2), series * s)
}

/// Cosine and sine of an angle from -pi/4 to pi/4 that a word, taken as `i32`, stands for, to
/// 1e-7 (Abramowitz1964, 4.3.65 and 4.3.66).
#[inline(always)]
fn quarter<F: Floats>(word: F::Words) -> (F, F) {
    let x = word.to_floats() * F::splat(FRAC_PI_4 / (1_u64 << 31) as f32);
    let x2 = x * x;
    let one = F::splat(1.0);
    let sine = x2.fused(F::splat(1.0 / 362_880.0), F::splat(-1.0 / 5040.0));
    let sine = sine.fused(x2, F::splat(1.0 / 120.0));
    let sine = sine.fused(x2, F::splat(-1.0 / 6.0));
    let sine = sine.fused(x2, one) * x;
    let cosine = x2.fused(F::splat(1.0 / 40_320.0), F::splat(-1.0 / 720.0));
    let cosine = cosine.fused(x2, F::splat(1.0 / 24.0));
    let cosine = cosine.fused(x2, F::splat(-0.5));
    (cosine.fused(x2, one), sine)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: usize = 1 << 20;

    fn planes(seed: u64, stream: u32) -> Planes {
        let mut planes = Planes::default();
        planes.clear(NUMBERS);
        Noise::new(seed, stream).add(0, 1.0, &mut planes);
        planes
    }

    fn mean(values: impl Iterator<Item = f64>) -> f64 {
        values.sum::<f64>() / NUMBERS as f64
    }

    #[test]
    fn numbers_are_normal_to_their_tails() {
        let planes = planes(7, 0);
        for plane in [&planes.i, &planes.q] {
            let power = |n: i32| mean(plane.iter().map(|x| f64::from(*x).powi(n)));
            // Four standard errors of a million numbers: 1, sqrt 2, sqrt 15 - ..., over 1000.
            assert!(power(1).abs() < 4e-3);
            assert!((power(2) - 1.0).abs() < 4.0 * 2f64.sqrt() / 1024.0);
            assert!(power(3).abs() < 4.0 * 15f64.sqrt() / 1024.0);
            assert!((power(4) - 3.0).abs() < 4.0 * 96f64.sqrt() / 1024.0);
            for (beyond, share) in [(1.0, 0.317_310_5), (3.0, 2.699_796e-3), (4.5, 6.795_346e-6)] {
                let count = plane.iter().filter(|x| f64::from(x.abs()) > beyond).count() as f64;
                let expected = share * NUMBERS as f64;
                assert!(
                    (count - expected).abs() < 4.0 * expected.sqrt(),
                    "{count} beyond {beyond}"
                );
            }
        }
    }

    #[test]
    fn neighbours_components_and_streams_are_independent() {
        let (one, other) = (planes(7, 0), planes(7, 1));
        let product = |a: &[f32], b: &[f32]| {
            let pairs = a.iter().zip(b);
            mean(pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)))
        };
        for correlation in [
            product(&one.i, &one.q),
            product(&one.i, &one.i[1..]),
            product(&one.i, &one.i[8..]),
            product(&one.i, &one.q[1..]),
            product(&one.i, &other.i),
            product(&one.i, &planes(8, 0).i),
        ] {
            // Four standard errors.
            assert!(correlation.abs() < 4.0 / 1024.0, "{correlation}");
        }
    }
}
