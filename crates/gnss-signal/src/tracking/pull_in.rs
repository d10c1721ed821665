//! Pull-in: Doppler, code phase and bit boundary from a stretch of one-period sums.
//!
//! Right after acquisition the Doppler is known to tens of hertz and the data bits not at all. A
//! stretch correlated open loop, period by period, holds both: the likelihood of every bit
//! boundary and Doppler offset, each bit with an unknown phase, is largest at the true pair.
//! That needs no transient of a loop, so that tracking can start at the first sample.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::discriminator::EarlyPromptLate;

/// Code periods in a bit.
const BIT: usize = 20;
/// Doppler offsets searched, Hz: acquisition leaves less, at a step that loses under 0.1 dB.
const HALF_WIDTH_HZ: f64 = 60.0;
const STEP_HZ: f64 = 5.0;
/// Log likelihood ratio of the best bit boundary to the second best that is believed: one wrong
/// in 20 000.
const BIT_EDGE_CONFIDENCE: f64 = 10.0;
/// ... which is also that of so many periods of signal over noise: a change of sign taken one period off
/// costs four. Of a strong signal less than two changes is what an oscillator's phase noise makes of bits
/// that are all alike.
const BIT_EDGE_PERIODS: f64 = 6.0;

/// Whole bits that a drift of the code is found from: in an inverted spectrum it goes at up to 6 chips/s.
const DRIFT_BITS: usize = 3;

/// The one-period sums of a stretch, and the noise variance of each.
#[derive(Debug, Clone, Default)]
pub(super) struct Stretch {
    sums: Vec<EarlyPromptLate>,
    noise: f64,
}

/// What a stretch says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PullInEstimate {
    /// Doppler of the signal over that of the replica, Hz.
    pub(super) doppler_offset_hz: f64,
    /// Code phase of the signal over that of the replica in the middle of the stretch, chips.
    pub(super) code_offset_chips: f64,
    /// How much that grew from the first half of the first whole bits to the second, chips; 0 with
    /// fewer than two.
    pub(super) code_drift_chips: f64,
    /// How many whole bits those are.
    pub(super) drift_bits: usize,
    /// First period that begins a bit, where it is certain.
    pub(super) bit_edge: Option<u32>,
    /// Phase of the signal over that of the replica in the middle of the first period, cycles
    /// (half a cycle unresolved).
    pub(super) phase_offset_cycles: f64,
    /// C/N0, Hz.
    pub(super) cn0_hz: f64,
}

impl Stretch {
    /// Adds the sums of the next period and their noise variance.
    pub(super) fn push(&mut self, sums: EarlyPromptLate, noise_variance: f64) {
        self.sums.push(sums);
        self.noise += (noise_variance - self.noise) / self.sums.len() as f64;
    }

    /// Periods held.
    pub(super) fn len(&self) -> usize {
        self.sums.len()
    }

    /// Sums of the last period.
    pub(super) fn last(&self) -> Option<EarlyPromptLate> {
        self.sums.last().copied()
    }

    /// Noise variance of a one-period sum.
    pub(super) fn noise_variance(&self) -> f64 {
        self.noise
    }

    /// The most likely Doppler, bit boundary and code phase; `None` without sums or without power
    /// above the noise.
    pub(super) fn estimate(&self, period_s: f64, spacing_chips: f64) -> Option<PullInEstimate> {
        let power = self.sums.iter().map(|s| s.prompt.norm_sqr()).sum::<f64>();
        let signal = (power / self.len() as f64 - self.noise).max(0.02 * self.noise);
        let (mut offset_hz, edges) = self.most_likely(signal, period_s)?;
        let (edge, certain) = edges;
        for _ in 0..2 {
            offset_hz += self.fine_offset_hz(edge, offset_hz, period_s);
        }
        let blocks = Blocks::new(&self.sums, edge, offset_hz * period_s);
        let cn0_hz = blocks.signal_power(self.noise)? / self.noise / period_s;
        Some(PullInEstimate {
            doppler_offset_hz: offset_hz,
            code_offset_chips: code_error_chips(&blocks.used, self.noise, spacing_chips),
            code_drift_chips: blocks.code_drift_chips(self.noise, spacing_chips),
            drift_bits: blocks.first_whole().len(),
            bit_edge: certain.then_some(edge as u32),
            phase_offset_cycles: blocks.phase_cycles(),
            cn0_hz,
        })
    }

    /// Most likely Doppler offset, Hz, and bit boundary with whether it is certain.
    fn most_likely(&self, signal: f64, period_s: f64) -> Option<(f64, (usize, bool))> {
        let scale = 2.0 * signal.sqrt() / self.noise;
        let mut best_edges = [f64::NEG_INFINITY; BIT];
        let mut by_offset = Vec::new();
        let steps = (HALF_WIDTH_HZ / STEP_HZ) as i32;
        for step in -steps..=steps {
            let offset_hz = f64::from(step) * STEP_HZ;
            let running = self.running_sums(offset_hz * period_s);
            let likelihood: [f64; BIT] =
                std::array::from_fn(|edge| log_likelihood(&running, edge, scale));
            for (best, value) in best_edges.iter_mut().zip(likelihood) {
                *best = best.max(value);
            }
            let largest = likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            by_offset.push((offset_hz, largest));
        }
        let (edge, best) = largest(best_edges.iter().copied())?;
        let others = best_edges.iter().enumerate().filter(|(k, _)| *k != edge);
        let second = others.map(|(_, v)| *v).fold(f64::NEG_INFINITY, f64::max);
        let needed = BIT_EDGE_CONFIDENCE.max(BIT_EDGE_PERIODS * signal / self.noise);
        let certain = best - second > needed;
        Some((interpolated_peak(&by_offset)?, (edge, certain)))
    }

    /// Sums of the first k prompts, turned back by `cycles` a period.
    fn running_sums(&self, cycles: f64) -> Vec<Complex64> {
        let turn = Complex64::from_polar(1.0, -TAU * cycles);
        let mut rotor = Complex64::new(1.0, 0.0);
        let mut total = Complex64::default();
        let mut running = Vec::with_capacity(self.len() + 1);
        running.push(total);
        for sums in &self.sums {
            total += sums.prompt * rotor;
            rotor *= turn;
            running.push(total);
        }
        running
    }

    /// What the phases of successive bits, squared to lose the data, say of the Doppler left, Hz.
    fn fine_offset_hz(&self, edge: usize, offset_hz: f64, period_s: f64) -> f64 {
        let blocks = Blocks::new(&self.sums, edge, offset_hz * period_s);
        let squares: Vec<Complex64> = blocks.whole.iter().map(|b| b.prompt * b.prompt).collect();
        let product: Complex64 = squares.windows(2).map(|w| w[1] * w[0].conj()).sum();
        if product.norm_sqr() > 0.0 {
            product.arg() / (2.0 * TAU * BIT as f64 * period_s)
        } else {
            0.0
        }
    }
}

/// Log likelihood of a bit boundary, up to what is common to all: every bit has its own phase.
fn log_likelihood(running: &[Complex64], edge: usize, scale: f64) -> f64 {
    let last = running.len() - 1;
    let mut start = 0;
    let mut end = if edge == 0 { BIT } else { edge };
    let mut total = 0.0;
    while start < last {
        let stop = end.min(last);
        total += ln_bessel_i0(scale * (running[stop] - running[start]).norm());
        start = stop;
        end += BIT;
    }
    total
}

/// ln I0(x) for x >= 0; Abramowitz1964, 9.8.1 and 9.8.2 (to 2e-7).
fn ln_bessel_i0(x: f64) -> f64 {
    if x < 3.75 {
        let t = (x / 3.75).powi(2);
        let series = [
            3.5156229, 3.0899424, 1.2067492, 0.2659732, 0.0360768, 0.0045813,
        ];
        let tail = series.iter().rev().fold(0.0, |sum, c| (sum + c) * t);
        (1.0 + tail).ln()
    } else {
        // The leading terms of 9.8.2 suffice for a comparison of likelihoods.
        x - 0.5 * (TAU * x).ln() + (1.0 + 0.125 / x + 0.0703125 / (x * x)).ln()
    }
}

fn largest(values: impl Iterator<Item = f64>) -> Option<(usize, f64)> {
    values
        .enumerate()
        .filter(|(_, v)| v.is_finite())
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Peak of a parabola through the largest point of (abscissa, ordinate) and its neighbours.
fn interpolated_peak(points: &[(f64, f64)]) -> Option<f64> {
    let (k, _) = largest(points.iter().map(|p| p.1))?;
    let centre = points[k].0;
    if k == 0 || k + 1 == points.len() {
        return Some(centre);
    }
    let (a, b, c) = (points[k - 1].1, points[k].1, points[k + 1].1);
    let curvature = a - 2.0 * b + c;
    let shift = if curvature < 0.0 {
        (0.5 * (a - c) / curvature).clamp(-0.5, 0.5)
    } else {
        0.0
    };
    Some(centre + shift * (points[k + 1].0 - centre))
}

/// A stretch cut at its bit boundaries and turned to zero Doppler.
struct Blocks {
    whole: Vec<EarlyPromptLate>,
    /// Whole bits, or the pieces of a stretch that has none, each with its number of periods.
    used: Vec<(EarlyPromptLate, f64)>,
}

impl Blocks {
    fn new(sums: &[EarlyPromptLate], edge: usize, cycles: f64) -> Self {
        let turned =
            |k: usize| sums[k].turned(Complex64::from_polar(1.0, -TAU * cycles * k as f64));
        let add = |from: usize, to: usize| {
            let zero = Complex64::default();
            (from..to).map(turned).fold((zero, zero, zero), |s, t| {
                (s.0 + t.early, s.1 + t.prompt, s.2 + t.late)
            })
        };
        let block = |from: usize, to: usize| {
            let (early, prompt, late) = add(from, to);
            EarlyPromptLate {
                early,
                prompt,
                late,
            }
        };
        let edge = edge.min(sums.len());
        let whole: Vec<_> = (edge..)
            .step_by(BIT)
            .take_while(|k| k + BIT <= sums.len())
            .map(|k| block(k, k + BIT))
            .collect();
        let mut used: Vec<_> = whole.iter().map(|b| (*b, BIT as f64)).collect();
        let tail = edge + whole.len() * BIT;
        for (from, to) in [(0, edge), (tail, sums.len())] {
            if to > from {
                used.push((block(from, to), (to - from) as f64));
            }
        }
        Self { whole, used }
    }

    /// Power of the signal in one period; `None` where there is none above the noise.
    fn signal_power(&self, noise: f64) -> Option<f64> {
        let (mut power, mut weight) = (0.0, 0.0);
        for (block, periods) in &self.used {
            power += block.prompt.norm_sqr() - periods * noise;
            weight += periods * periods;
        }
        (power > 0.0).then(|| power / weight)
    }

    /// The whole bits in which a code that slips is still on the flanks of the taps.
    fn first_whole(&self) -> &[EarlyPromptLate] {
        &self.whole[..self.whole.len().min(DRIFT_BITS)]
    }

    /// Growth of the code error from the first half of the first whole bits to the second, chips.
    fn code_drift_chips(&self, noise: f64, spacing_chips: f64) -> f64 {
        let first = self.first_whole().iter();
        let whole: Vec<_> = first.map(|b| (*b, BIT as f64)).collect();
        let (first, second) = whole.split_at(whole.len() / 2);
        if first.is_empty() {
            return 0.0;
        }
        code_error_chips(second, noise, spacing_chips)
            - code_error_chips(first, noise, spacing_chips)
    }

    /// Phase of the signal over the replica, turned back to the first period, cycles.
    fn phase_cycles(&self) -> f64 {
        self.used.first().map_or(0.0, |(b, _)| b.prompt.arg() / TAU)
    }
}

/// Code error by the envelopes of early and late freed of their noise, chips.
fn code_error_chips(blocks: &[(EarlyPromptLate, f64)], noise: f64, spacing_chips: f64) -> f64 {
    let envelope = |pick: fn(&EarlyPromptLate) -> Complex64| {
        let power = blocks.iter().map(|(b, n)| pick(b).norm_sqr() - n * noise);
        power.sum::<f64>().max(0.0).sqrt()
    };
    let (early, late) = (envelope(|b| b.early), envelope(|b| b.late));
    if early + late > 0.0 {
        (1.0 - spacing_chips / 2.0) * (early - late) / (early + late)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    /// A stretch of `periods` with unit noise: bits begin at `edge`.
    fn stretch(cn0_dbhz: f64, offset_hz: f64, edge: usize, periods: usize, seed: u64) -> Stretch {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let amplitude = (10f64.powf(cn0_dbhz / 10.0) * 1e-3).sqrt();
        let mut bit = 1.0;
        let mut stretch = Stretch::default();
        for k in 0..periods {
            if k % BIT == edge {
                bit = if rng.random::<bool>() { 1.0 } else { -1.0 };
            }
            let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
            let mut noise = || Complex64::new(gauss(), gauss()) / 2f64.sqrt();
            let phase = TAU * (0.1 + offset_hz * 1e-3 * k as f64);
            let signal = Complex64::from_polar(amplitude * bit, phase);
            let sums = EarlyPromptLate {
                early: signal * 0.85 + noise(),
                prompt: signal * 0.9 + noise(),
                late: signal * 0.65 + noise(),
            };
            stretch.push(sums, 1.0);
        }
        stretch
    }

    #[test]
    fn finds_doppler_bit_edge_and_code_phase_down_to_33_dbhz() {
        for (seed, cn0) in [(1, 33.0), (2, 40.0), (3, 50.0)] {
            for (edge, offset) in [(0, -37.3), (7, 12.1), (19, 55.0)] {
                let found = stretch(cn0, offset, edge, 500, seed)
                    .estimate(1e-3, 0.5)
                    .unwrap();
                assert_eq!(found.bit_edge, Some(edge as u32), "{cn0} dB-Hz");
                // 0.5 s coherent over pairs of bits: well under 1 Hz at 33 dB-Hz.
                assert!((found.doppler_offset_hz - offset).abs() < 1.0);
                // The sums are those of a signal 0.1 chip early; code noise at 33 dB-Hz over
                // 0.5 s is 0.01 chip.
                assert!((found.code_offset_chips - 0.1).abs() < 0.04);
                // Prompt lies 0.1 chip off the peak, 0.9 dB.
                assert!((10.0 * found.cn0_hz.log10() + 0.9 - cn0).abs() < 1.0);
            }
        }
    }

    #[test]
    fn bits_that_are_all_alike_have_no_certain_edge_whatever_the_oscillator_does() {
        // White frequency noise of h0 = 1.2e-19 s walks 0.34 rad in a bit.
        let step_rad = 0.34 / (BIT as f64).sqrt();
        for (cn0, seed) in [(43.0, 0), (50.0, 100)] {
            for seed in seed..seed + 50 {
                let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                let mut alike = Stretch::default();
                let mut phase_rad = 0.0;
                for sums in stretch(cn0, 12.0, 0, 500, seed).sums {
                    let sign =
                        sums.prompt * Complex64::cis(-TAU * (0.1 + 12e-3 * alike.len() as f64));
                    let walk: f64 = StandardNormal.sample(&mut rng);
                    phase_rad += step_rad * walk;
                    let turn = Complex64::from_polar(sign.re.signum(), phase_rad);
                    alike.push(sums.turned(turn.conj()), 1.0);
                }
                let found = alike.estimate(1e-3, 0.5).unwrap();
                assert_eq!(found.bit_edge, None, "{cn0} dB-Hz, seed {seed}");
            }
        }
    }

    #[test]
    fn noise_alone_has_no_certain_bit_edge() {
        let certain = (0..200).filter(|seed| {
            let found = stretch(-50.0, 0.0, 3, 200, 100 + seed).estimate(1e-3, 0.5);
            found.is_some_and(|f| f.bit_edge.is_some())
        });
        assert_eq!(certain.count(), 0);
    }

    #[test]
    fn an_empty_stretch_says_nothing() {
        assert_eq!(Stretch::default().estimate(1e-3, 0.5), None);
    }

    #[test]
    fn bessel_function_is_continuous_and_right() {
        // Tabulated: I0(1) = 1.2660658778, I0(5) = 27.2398718236.
        assert!((ln_bessel_i0(1.0) - 1.266_065_877_8_f64.ln()).abs() < 1e-6);
        assert!((ln_bessel_i0(5.0) - 27.239_871_823_6_f64.ln()).abs() < 1e-3);
        assert!((ln_bessel_i0(3.749_999) - ln_bessel_i0(3.75)).abs() < 1e-2);
    }
}
