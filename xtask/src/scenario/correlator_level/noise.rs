//! Noise of correlator sums: Gaussian, correlated over the taps as the code is with itself.
//!
//! Drawn by a counter-based generator keyed by the scene's seed, the code and the interval: an
//! interval always has the same noise, whoever asks when and on which thread, turned by the
//! replica's carrier phase as noise in samples would be. Different intervals, overlapping ones
//! too, and different codes have independent noise. What of an interval's noise depends on the
//! replica's exact frequency and code phase is not followed.

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use gnss_signal::{MAX_TAPS, SignalId, TapOffsets};

use super::code_correlation::CodeCorrelation;

/// Words of the generator set apart for one interval.
const WORDS: u128 = 1 << 12;
/// Codes told apart in one stream number.
const CODES: u64 = 64;

/// The generator of what happens to `signal` over an interval of `length` ticks from
/// `start_tick` (0 for a search).
pub(super) fn generator(
    seed: &ChaCha8Rng,
    signal: SignalId,
    start_tick: u64,
    length: u64,
) -> ChaCha8Rng {
    let mut generator = seed.clone();
    generator.set_stream(start_tick * CODES + u64::from(signal.prn()));
    generator.set_word_pos(u128::from(length) * WORDS);
    generator
}

/// A generator that nothing was taken from.
pub(super) fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A standard normal deviate.
pub(super) fn normal(generator: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(generator)
}

/// A complex deviate of unit mean power.
pub(super) fn complex_normal(generator: &mut ChaCha8Rng) -> Complex64 {
    let (re, im) = (normal(generator), normal(generator));
    Complex64::new(re, im) * std::f64::consts::FRAC_1_SQRT_2
}

/// Lower triangular factor of the correlation matrix of taps.
#[derive(Debug, Clone)]
pub(super) struct TapFactor {
    rows: [[f64; MAX_TAPS]; MAX_TAPS],
    taps: usize,
}

impl TapFactor {
    /// That of taps at `offsets_chips` in noise that correlates as `correlation`.
    pub(super) fn new(offsets_chips: &[f64], correlation: &CodeCorrelation) -> Self {
        let peak = correlation.at(0.0);
        let mut rows = [[0.0; MAX_TAPS]; MAX_TAPS];
        let taps = offsets_chips.len().min(MAX_TAPS);
        for i in 0..taps {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| rows[i][k] * rows[j][k]).sum();
                let away = offsets_chips[i] - offsets_chips[j];
                let left = correlation.at(away) / peak - known;
                rows[i][j] = match (i == j, rows[j][j]) {
                    // Rounding may leave less than nothing of a tap that others determine.
                    (true, _) => left.max(0.0).sqrt(),
                    (false, pivot) if pivot > 1e-6 => left / pivot,
                    (false, _) => 0.0,
                };
            }
        }
        Self { rows, taps }
    }

    /// Adds noise of root mean square `scale` to `sums`, turned by `scale`'s phase.
    pub(super) fn add(&self, scale: Complex64, generator: &mut ChaCha8Rng, sums: &mut [Complex64]) {
        let mut white = [Complex64::default(); MAX_TAPS];
        for value in &mut white[..self.taps] {
            *value = complex_normal(generator) * scale;
        }
        for (k, sum) in sums.iter_mut().enumerate().take(self.taps) {
            let row = self.rows[k][..=k].iter().zip(&white);
            *sum += row.map(|(factor, value)| value * factor).sum::<Complex64>();
        }
    }
}

/// Factors of the tap sets in use with one code.
#[derive(Debug, Clone, Default)]
pub(super) struct TapFactors(Vec<(TapOffsets, TapFactor)>);

/// Tap sets remembered: more than a receiver uses at a time.
const REMEMBERED: usize = 16;

impl TapFactors {
    /// The factor of `offsets`, made where it is new.
    pub(super) fn get(
        &mut self,
        offsets: &TapOffsets,
        correlation: &CodeCorrelation,
    ) -> &TapFactor {
        let known = self.0.iter().position(|(set, _)| set == offsets);
        let index = known.unwrap_or_else(|| {
            if self.0.len() == REMEMBERED {
                self.0.clear();
            }
            let factor = TapFactor::new(offsets.as_slice(), correlation);
            self.0.push((*offsets, factor));
            self.0.len() - 1
        });
        &self.0[index].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_correlate_as_the_code_does() {
        let signal = SignalId::gps_l1_ca(9).unwrap();
        let correlation = CodeCorrelation::new(signal, None);
        let offsets = [-0.5, -0.25, 0.0, 0.25, 0.5, 0.5, 400.0];
        let factor = TapFactor::new(&offsets, &correlation);
        for (i, a) in offsets.iter().enumerate() {
            for (j, b) in offsets.iter().enumerate() {
                let product: f64 = (0..=i.min(j))
                    .map(|k| factor.rows[i][k] * factor.rows[j][k])
                    .sum();
                // Single precision of the correlation.
                assert!((product - correlation.at(a - b)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn an_interval_has_its_own_noise_and_keeps_it() {
        let signal = |prn| SignalId::gps_l1_ca(prn).unwrap();
        let seed = seeded(7);
        let draw = |prn, start, length| normal(&mut generator(&seed, signal(prn), start, length));
        let first = draw(3, 26_000, 2_600);
        assert_eq!(first, draw(3, 26_000, 2_600));
        for other in [
            draw(4, 26_000, 2_600),
            draw(3, 26_001, 2_600),
            draw(3, 26_000, 2_601),
        ] {
            assert_ne!(first, other);
        }
    }
}
