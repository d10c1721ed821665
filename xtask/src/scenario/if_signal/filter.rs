//! The front-end filter: a linear-phase low-pass whose delay is taken out.

use std::f64::consts::{PI, TAU};

use super::baseband::Planes;

/// Samples made for each sample delivered: a front end filters before it samples.
pub(in crate::scenario) const OVERSAMPLING: usize = 4;
/// Half the length of the filter, samples delivered; the transition is 3.3 / 65 of their rate wide.
pub(super) const HALF_LENGTH: usize = 32;
const HALF_TAPS: usize = HALF_LENGTH * OVERSAMPLING;
const TAPS: usize = 2 * HALF_TAPS + 1;

/// Partial sums of a tap product.
const LANES: usize = 16;

/// A windowed-sinc low-pass (Hamming) with unit gain at zero frequency, before the sampler.
#[derive(Debug, Clone)]
pub(super) struct LowPass {
    taps: Box<[f32; TAPS]>,
    history: Planes,
}

impl LowPass {
    /// Passes `bandwidth`, two-sided, as a fraction of the rate delivered.
    pub(super) fn new(bandwidth: f64) -> Self {
        let tap = |k: usize| {
            let from_middle = k as f64 - HALF_TAPS as f64;
            let x = PI * bandwidth / OVERSAMPLING as f64 * from_middle;
            let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
            sinc * (0.54 + 0.46 * (PI * from_middle / (HALF_TAPS + 1) as f64).cos())
        };
        let gain: f64 = (0..TAPS).map(tap).sum();
        let zeros = vec![0.0; 2 * HALF_TAPS];
        Self {
            taps: Box::new(std::array::from_fn(|k| (tap(k) / gain) as f32)),
            history: Planes {
                i: zeros.clone(),
                q: zeros,
            },
        }
    }

    /// What is left of the power of white noise that has a variance of 1 at the rate delivered.
    pub(super) fn noise_gain(&self) -> f64 {
        let squares = self.taps.iter().map(|tap| f64::from(*tap).powi(2));
        OVERSAMPLING as f64 * squares.sum::<f64>()
    }

    /// Replaces [`OVERSAMPLING`] times `samples` of `planes` by `samples` filtered ones,
    /// [`HALF_LENGTH`] samples older.
    pub(super) fn filter(&mut self, samples: usize, planes: &mut Planes) {
        filter_plane(&self.taps, samples, &mut self.history.i, &mut planes.i);
        filter_plane(&self.taps, samples, &mut self.history.q, &mut planes.q);
    }
}

/// One plane; `history` holds the last 2 [`HALF_TAPS`] inputs.
fn filter_plane(taps: &[f32; TAPS], samples: usize, history: &mut Vec<f32>, plane: &mut [f32]) {
    let made = samples * OVERSAMPLING;
    history.extend_from_slice(&plane[..made]);
    for (n, out) in plane[..samples].iter_mut().enumerate() {
        *out = product(taps, &history[n * OVERSAMPLING..n * OVERSAMPLING + TAPS]);
    }
    history.drain(..made);
}

/// Sum of the products, in [`LANES`] partial sums that a processor makes at once.
fn product(taps: &[f32; TAPS], inputs: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    let (taps, inputs) = (taps.chunks(LANES), inputs.chunks(LANES));
    for (taps, inputs) in taps.zip(inputs) {
        for ((sum, tap), input) in sums.iter_mut().zip(taps).zip(inputs) {
            *sum += tap * input;
        }
    }
    sums.iter().sum()
}

/// Coefficients of the filter that passes `bandwidth`, two-sided, as a fraction of the rate
/// delivered: [`OVERSAMPLING`] to a sample, symmetric about the middle one, of unit sum.
pub(in crate::scenario) fn impulse_response(bandwidth: f64) -> Vec<f64> {
    let filter = LowPass::new(bandwidth);
    filter.taps.iter().map(|tap| f64::from(*tap)).collect()
}

/// Turns baseband samples to the intermediate frequency.
///
/// `first_tick` is that of the first sample; phase is counted from tick 0.
pub(super) fn shift(frequency: f64, first_tick: i64, samples: usize, planes: &mut Planes) {
    let (step_sin, step_cos) = (TAU * frequency).sin_cos();
    let turns = (frequency * first_tick as f64).rem_euclid(1.0);
    let (mut sin, mut cos) = (TAU * turns).sin_cos();
    let samples = planes.i[..samples].iter_mut().zip(&mut planes.q[..samples]);
    for (i, q) in samples {
        let (c, s) = (cos as f32, sin as f32);
        (*i, *q) = (*i * c - *q * s, *i * s + *q * c);
        (sin, cos) = (
            sin * step_cos + cos * step_sin,
            cos * step_cos - sin * step_sin,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gain at a frequency in units of the rate delivered.
    fn response(filter: &LowPass, frequency: f64) -> f64 {
        let from_middle = |k: usize| (k as f64 - HALF_TAPS as f64) / OVERSAMPLING as f64;
        let taps = filter.taps.iter().enumerate();
        taps.map(|(k, t)| f64::from(*t) * (TAU * frequency * from_middle(k)).cos())
            .sum()
    }

    #[test]
    fn passes_its_band_and_stops_the_rest() {
        let filter = LowPass::new(0.8);
        for k in 0..=200 {
            let frequency = f64::from(k) / 100.0;
            let gain = response(&filter, frequency);
            // Half the transition is 0.026; Hamming ripples by 0.2 % and stops 53 dB.
            if frequency < 0.37 {
                assert!((gain - 1.0).abs() < 0.003, "{gain} at {frequency}");
            } else if frequency > 0.43 {
                assert!(gain.abs() < 0.003, "{gain} at {frequency}");
            }
        }
        assert!((filter.noise_gain() - 0.8).abs() < 0.02);
    }

    #[test]
    fn delays_by_half_its_length_over_blocks_of_any_size() {
        // Cosine of the time in samples delivered.
        let wave = |made: i64| (0.3 * made as f64 / OVERSAMPLING as f64).cos() as f32;
        let mut filter = LowPass::new(0.5);
        let (mut next, mut out) = (0, Vec::new());
        for samples in [10, 1, 300, 64, 65] {
            let made = samples * OVERSAMPLING as i64;
            let plane: Vec<f32> = (next..next + made).map(wave).collect();
            let mut planes = Planes {
                i: plane.clone(),
                q: plane,
            };
            filter.filter(samples as usize, &mut planes);
            out.extend_from_slice(&planes.i[..samples as usize]);
            next += made;
        }
        for (n, value) in out.iter().enumerate().skip(2 * HALF_LENGTH) {
            // Ripple of the pass band.
            let expected = wave((n as i64 - HALF_LENGTH as i64) * OVERSAMPLING as i64);
            assert!((value - expected).abs() < 0.005);
        }
    }

    #[test]
    fn shifts_continuously_by_the_frequency() {
        let mut planes = Planes {
            i: vec![1.0; 1000],
            q: vec![0.0; 1000],
        };
        shift(0.123, -40, 1000, &mut planes);
        for (n, i) in planes.i.iter().enumerate() {
            let expected = (TAU * 0.123 * (n as f64 - 40.0)).cos();
            assert!((f64::from(*i) - expected).abs() < 1e-6);
        }
    }
}
