//! Estimators of the carrier-to-noise density ratio.

use num_complex::Complex64;

/// Converts a ratio in Hz to dB-Hz; zero and below become `f64::NEG_INFINITY`.
#[must_use]
pub fn dbhz(cn0_hz: f64) -> f64 {
    if cn0_hz > 0.0 {
        10.0 * cn0_hz.log10()
    } else {
        f64::NEG_INFINITY
    }
}

/// Converts dB-Hz to a ratio in Hz.
#[must_use]
pub fn ratio_hz(cn0_dbhz: f64) -> f64 {
    10f64.powf(cn0_dbhz / 10.0)
}

/// C/N0, Hz, of one integration of `interval_s` whose noise variance E|n|^2 is known:
/// unbiased, (|prompt|^2 - variance) / (variance * interval); may be negative.
#[must_use]
pub fn against_noise_floor(prompt: Complex64, noise_variance: f64, interval_s: f64) -> f64 {
    (prompt.norm_sqr() / noise_variance - 1.0) / interval_s
}

/// C/N0, Hz, by the second and fourth moments of prompt sums of `interval_s` each (Pauluzzi2000,
/// M2M4): needs no noise floor and no bit boundaries, fails below an SNR of about 1 per sum.
///
/// `None` where the moments admit no signal or there are no sums.
#[must_use]
pub fn moments(prompts: &[Complex64], interval_s: f64) -> Option<f64> {
    let n = prompts.len() as f64;
    let m2 = prompts.iter().map(Complex64::norm_sqr).sum::<f64>() / n;
    let m4 = prompts.iter().map(|p| p.norm_sqr().powi(2)).sum::<f64>() / n;
    let signal = (2.0 * m2 * m2 - m4).max(0.0).sqrt();
    let noise = m2 - signal;
    (signal > 0.0 && noise > 0.0).then(|| signal / noise / interval_s)
}

/// C/N0, Hz, by the ratio of narrow-band to wide-band power (VanDierendonck1996): `bits` holds
/// equally many sums of `interval_s` for each data bit, at least two.
///
/// `None` where the ratio admits no signal.
#[must_use]
pub fn narrow_wide(bits: &[&[Complex64]], interval_s: f64) -> Option<f64> {
    let sums = bits.first()?.len() as f64;
    let mean = bits
        .iter()
        .map(|bit| {
            let wide = bit.iter().map(Complex64::norm_sqr).sum::<f64>();
            let narrow = bit.iter().sum::<Complex64>().norm_sqr();
            narrow / wide
        })
        .sum::<f64>()
        / bits.len() as f64;
    (mean > 1.0 && mean < sums).then(|| (mean - 1.0) / (sums - mean) / interval_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// 1 ms prompts with unit noise variance at `cn0_dbhz`, random data bits of 20.
    fn prompts(cn0_dbhz: f64, count: usize, seed: u64) -> Vec<Complex64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let amplitude = (ratio_hz(cn0_dbhz) * 1e-3).sqrt();
        let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..count)
            .map(|k| {
                let bit = if (k / 20) % 3 == 0 { -1.0 } else { 1.0 };
                let noise = Complex64::new(gauss(), gauss()) / 2f64.sqrt();
                Complex64::new(bit * amplitude, 0.0) + noise
            })
            .collect()
    }

    #[test]
    fn estimators_find_the_true_ratio() {
        for (seed, truth) in [(1, 35.0), (2, 40.0), (3, 45.0), (4, 50.0)] {
            let sums = prompts(truth, 10_000, seed);
            let floor = sums
                .iter()
                .map(|p| against_noise_floor(*p, 1.0, 1e-3))
                .sum::<f64>()
                / 10_000.0;
            let bits: Vec<&[Complex64]> = sums.chunks(20).collect();
            let wide = narrow_wide(&bits, 1e-3).unwrap();
            let m2m4 = moments(&sums, 1e-3).unwrap();
            // 10 000 sums at an SNR of 3 or more: 2 % (one sigma) of noise power, 0.3 dB is over
            // three; the ratio of powers has a known bias of 0.2 dB at 500 bits.
            for (name, value) in [("floor", floor), ("m2m4", m2m4), ("narrow/wide", wide)] {
                let error = dbhz(value) - truth;
                assert!(error.abs() < 0.5, "{name} at {truth}: {error} dB");
            }
        }
    }

    #[test]
    fn nothing_is_made_of_nothing() {
        assert_eq!(moments(&[], 1e-3), None);
        assert_eq!(narrow_wide(&[], 1e-3), None);
        let zero = [Complex64::default(); 20];
        assert_eq!(moments(&zero, 1e-3), None);
        assert_eq!(narrow_wide(&[&zero], 1e-3), None);
        assert_eq!(dbhz(0.0), f64::NEG_INFINITY);
    }
}
