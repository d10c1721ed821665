//! Tap sums of an interval, drawn from their distribution given the true errors of a replica, and what the
//! product's discriminators say of them.

use gnss_nav::constants::{CA_CODE_RATE_HZ, L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use gnss_signal::tracking::Reception;
use gnss_signal::tracking::discriminator::EarlyPromptLate;
use num_complex::Complex64;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{PI, TAU};

/// Coherent interval, a data bit, s.
pub const INTERVAL_S: f64 = 0.02;
/// Early to late, chips.
const SPACING_CHIPS: f64 = 0.5;
/// Length of a chip, m.
pub const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / CA_CODE_RATE_HZ;

/// Where a replica was put: its pseudorange at the beginning of an interval, m, and its rate, m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Replica {
    /// Pseudorange, m.
    pub range_m: f64,
    /// Its rate, m/s.
    pub rate_mps: f64,
}

impl Replica {
    /// The true pseudorange minus the replica's at the beginning, middle and end of an interval, m.
    #[must_use]
    pub fn errors_m(&self, true_m: [f64; 3]) -> [f64; 3] {
        let [begin, middle, end] = true_m.map(|m| m - self.range_m);
        let half_m = self.rate_mps * INTERVAL_S / 2.0;
        [begin, middle - half_m, end - 2.0 * half_m]
    }
}

/// What an interval measured of a signal, at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Pseudorange, m, and its variance, m^2.
    pub range_m: f64,
    /// Variance, m^2.
    pub range_m2: f64,
    /// Its rate, m/s.
    pub rate_mps: f64,
    /// Variance, (m/s)^2.
    pub rate_m2_s2: f64,
}

/// Measures a signal of `cn0_hz` by a replica that is wrong by `errors_m`.
pub fn measure(
    cn0_hz: f64,
    replica: &Replica,
    errors_m: [f64; 3],
    rng: &mut ChaCha8Rng,
) -> Measured {
    let reception = Reception {
        cn0_hz,
        spacing_chips: SPACING_CHIPS,
        period_s: 1e-3,
    };
    let half_s = INTERVAL_S / 2.0;
    let [begin, middle, end] = errors_m;
    let frequencies_hz = [middle - begin, end - middle].map(|m| -m / half_s / L1_WAVELENGTH_M);
    let phases = [
        0.5 * frequencies_hz[0],
        frequencies_hz[0] + 0.5 * frequencies_hz[1],
    ];
    let codes_m = [f64::midpoint(begin, middle), f64::midpoint(middle, end)];
    let [first, second] = [0, 1].map(|half| {
        let spread = sinc(frequencies_hz[half] * half_s);
        let sum = Complex64::from_polar(
            (cn0_hz * half_s).sqrt() * spread,
            TAU * phases[half] * half_s,
        );
        taps(sum, -codes_m[half] / CHIP_M, rng)
    });
    let whole = EarlyPromptLate {
        early: first.early + second.early,
        prompt: first.prompt + second.prompt,
        late: first.late + second.late,
    };
    let code_chips = reception.code_error_chips(&whole, 2.0, INTERVAL_S);
    let prompts = [first.prompt, second.prompt];
    let frequency_hz = reception.frequency_error_hz(prompts, 1.0, half_s, half_s);
    Measured {
        range_m: replica.range_m + replica.rate_mps * INTERVAL_S - code_chips * CHIP_M,
        range_m2: reception.code_variance_chips2(INTERVAL_S) * CHIP_M * CHIP_M,
        rate_mps: replica.rate_mps - frequency_hz * L1_WAVELENGTH_M,
        rate_m2_s2: reception.frequency_variance_hz2(half_s) * L1_WAVELENGTH_M * L1_WAVELENGTH_M,
    }
}

fn sinc(cycles: f64) -> f64 {
    let x = PI * cycles;
    if x.abs() < 1e-9 { 1.0 } else { x.sin() / x }
}

/// Sums over half an interval in units of the noise's deviation: noise of two taps correlates as their codes.
fn taps(prompt: Complex64, code_chips: f64, rng: &mut ChaCha8Rng) -> EarlyPromptLate {
    let half = SPACING_CHIPS / 2.0;
    let correlation = |chips: f64| (1.0 - chips.abs()).max(0.0);
    let (near, far) = (correlation(half), correlation(SPACING_CHIPS));
    let [a, b, c] = [(); 3].map(|()| normal(rng));
    let own = (1.0 - near * near).sqrt();
    let shared = (near - near * far) / own;
    let rest = (1.0 - far * far - shared * shared).sqrt();
    EarlyPromptLate {
        early: prompt * correlation(code_chips - half) + a,
        prompt: prompt * correlation(code_chips) + a * near + b * own,
        late: prompt * correlation(code_chips + half) + a * far + b * shared + c * rest,
    }
}

/// A complex number of mean 0 and variance 1.
fn normal(rng: &mut ChaCha8Rng) -> Complex64 {
    let (re, im): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
    Complex64::new(re, im) * 0.5f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn strong_signals_are_measured_where_they_are_and_as_well_as_said() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let replica = Replica {
            range_m: 2e7,
            rate_mps: 100.0,
        };
        // 0.05 chip late and 0.3 m/s faster than the replica.
        let truth = |s: f64| 2e7 + 15.0 + 100.3 * s;
        let errors = replica.errors_m([0.0, 0.01, 0.02].map(truth));
        let n = 4000;
        let (mut ranges, mut rates) = (Vec::new(), Vec::new());
        for _ in 0..n {
            let measured = measure(1e4, &replica, errors, &mut rng);
            // The errors are those of the middle, 3 mm less.
            ranges.push((measured.range_m - truth(0.02)) / measured.range_m2.sqrt());
            rates.push((measured.rate_mps - 100.3) / measured.rate_m2_s2.sqrt());
        }
        for values in [ranges, rates] {
            let mean = values.iter().sum::<f64>() / f64::from(n);
            let variance = values.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
            // Four standard errors of 4000; the variances by theory are generous by up to 5 %.
            assert!(mean.abs() < 0.065, "{mean}");
            assert!((0.85..1.1).contains(&variance), "{variance}");
        }
    }

    #[test]
    fn taps_correlate_as_their_codes() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let n = 20_000;
        let (mut near, mut far, mut power) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let t = taps(Complex64::default(), 0.0, &mut rng);
            near += (t.prompt * t.late.conj()).re;
            far += (t.early * t.late.conj()).re;
            power += t.late.norm_sqr();
        }
        // Standard errors of 20 000 products: 0.7 %; four of them.
        for (sum, expected) in [(near, 0.75), (far, 0.5), (power, 1.0)] {
            assert!((sum / f64::from(n) - expected).abs() < 0.03);
        }
    }
}
