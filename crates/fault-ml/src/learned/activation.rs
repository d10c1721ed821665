//! exp, sigmoid and tanh in single precision, without branches or calls, so that loops over them become
//! vector instructions on every processor.

/// Numbers worked on side by side: a vector register or two.
pub(crate) const LANES: usize = 8;

/// 1.5 x 2^23: added to a number up to 2^22 it leaves the nearest integer in the lowest bits.
const ROUNDER: f32 = 12_582_912.0;
/// ln 2 in two parts, the first with zeros at its end so that its multiples are exact.
const LN2_HIGH: f32 = 0.693_145_75;
const LN2_LOW: f32 = 1.428_606_8e-6;

/// exp(x); for x outside -87 to 88 that of the nearer end. Within 2e-7 of itself.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    let x = x.clamp(-87.0, 88.0);
    // x = n ln 2 + r, |r| at most half of ln 2.
    let shifted = x * std::f32::consts::LOG2_E + ROUNDER;
    let n = shifted - ROUNDER;
    let r = x - n * LN2_HIGH - n * LN2_LOW;
    // Taylor's polynomial: the next term is below 1.2e-7 of the whole.
    let p = 1.0 / 720.0;
    let p = p * r + 1.0 / 120.0;
    let p = p * r + 1.0 / 24.0;
    let p = p * r + 1.0 / 6.0;
    let p = p * r + 0.5;
    let p = p * r + 1.0;
    let p = p * r + 1.0;
    // 2^n: n is in the lowest bits of `shifted`, the rest is shifted out.
    let power = f32::from_bits((shifted.to_bits().wrapping_add(127)) << 23);
    p * power
}

/// 1 / (1 + exp(-x)).
#[inline(always)]
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Hyperbolic tangent.
#[inline(always)]
pub(super) fn tanh(x: f32) -> f32 {
    2.0 / (1.0 + exp(-2.0 * x)) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_those_of_double_precision() {
        for k in -8700..=8800_i16 {
            let x = f32::from(k) / 100.0;
            let exact = f64::from(x).exp();
            let apart = (f64::from(exp(x)) / exact - 1.0).abs();
            // Remainder of the series and five roundings of 6e-8.
            assert!(apart < 4e-7, "exp({x}): {apart:e}");
            let exact = f64::from(x).tanh();
            assert!((f64::from(tanh(x)) - exact).abs() < 3e-7, "tanh({x})");
            let exact = 1.0 / (1.0 + (-f64::from(x)).exp());
            assert!((f64::from(sigmoid(x)) - exact).abs() < 3e-7, "sigmoid({x})");
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!((sigmoid(1e30), sigmoid(-1e30) < 1e-37), (1.0, true));
        assert_eq!((tanh(f32::INFINITY), tanh(f32::NEG_INFINITY)), (1.0, -1.0));
    }
}
