//! The front-end filter: a linear-phase low-pass whose delay is taken out.

use std::f64::consts::{PI, TAU};

use super::baseband::Planes;

/// Taps on either side of the middle one; the transition is 3.3 / 65 of the sample rate wide.
pub(super) const HALF_TAPS: usize = 32;

/// Samples filtered at a time.
const TILE: usize = 256;

/// A windowed-sinc low-pass (Hamming) with unit gain at zero frequency.
#[derive(Debug, Clone)]
pub(super) struct LowPass {
    /// Middle tap first, then the symmetric ones outward.
    taps: [f32; HALF_TAPS + 1],
    history: Planes,
}

impl LowPass {
    /// Passes `bandwidth`, two-sided, as a fraction of the sample rate.
    pub(super) fn new(bandwidth: f64) -> Self {
        let sinc = |k: usize| {
            let x = PI * bandwidth * k as f64;
            if k == 0 { 1.0 } else { x.sin() / x }
        };
        let window = |k: usize| 0.54 + 0.46 * (PI * k as f64 / (HALF_TAPS + 1) as f64).cos();
        let raw: [f64; HALF_TAPS + 1] = std::array::from_fn(|k| sinc(k) * window(k));
        let gain = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
        let zeros = vec![0.0; 2 * HALF_TAPS];
        Self {
            taps: raw.map(|tap| (tap / gain) as f32),
            history: Planes {
                i: zeros.clone(),
                q: zeros,
            },
        }
    }

    /// Sum of the squared taps: what is left of the power of white noise.
    pub(super) fn noise_gain(&self) -> f64 {
        let square = |tap: &f32| f64::from(*tap).powi(2);
        square(&self.taps[0]) + 2.0 * self.taps[1..].iter().map(square).sum::<f64>()
    }

    /// Replaces the first `samples` of `planes` by filtered ones, [`HALF_TAPS`] samples older.
    pub(super) fn filter(&mut self, samples: usize, planes: &mut Planes) {
        filter_plane(&self.taps, samples, &mut self.history.i, &mut planes.i);
        filter_plane(&self.taps, samples, &mut self.history.q, &mut planes.q);
    }
}

/// One plane; `history` holds the last 2 [`HALF_TAPS`] inputs.
fn filter_plane(
    taps: &[f32; HALF_TAPS + 1],
    samples: usize,
    history: &mut Vec<f32>,
    plane: &mut [f32],
) {
    history.extend_from_slice(&plane[..samples]);
    let out = &mut plane[..samples];
    let middle = &history[HALF_TAPS..];
    // A tile stays in registers or the nearest cache while all taps pass over it.
    for (at, out) in out
        .chunks_mut(TILE)
        .enumerate()
        .map(|(n, tile)| (n * TILE, tile))
    {
        for (out, x) in out.iter_mut().zip(&middle[at..]) {
            *out = taps[0] * x;
        }
        for (k, tap) in taps.iter().enumerate().skip(1) {
            let (before, after) = (
                &history[at + HALF_TAPS - k..],
                &history[at + HALF_TAPS + k..],
            );
            for ((out, a), b) in out.iter_mut().zip(before).zip(after) {
                *out += tap * (a + b);
            }
        }
    }
    history.drain(..samples);
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

    fn response(filter: &LowPass, frequency: f64) -> f64 {
        let pair = |k: usize| 2.0 * (TAU * frequency * k as f64).cos();
        let taps = filter.taps.iter().enumerate().skip(1);
        f64::from(filter.taps[0]) + taps.map(|(k, t)| f64::from(*t) * pair(k)).sum::<f64>()
    }

    #[test]
    fn passes_its_band_and_stops_the_rest() {
        let filter = LowPass::new(0.8);
        for k in 0..=50 {
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
        let wave = |n: i64| (0.3 * n as f64).cos() as f32;
        let mut filter = LowPass::new(0.5);
        let (mut next, mut out) = (0, Vec::new());
        for samples in [10, 1, 300, 64, 65] {
            let plane: Vec<f32> = (next..next + samples).map(wave).collect();
            let mut planes = Planes {
                i: plane.clone(),
                q: plane,
            };
            filter.filter(samples as usize, &mut planes);
            out.extend(planes.i);
            next += samples;
        }
        for (n, value) in out.iter().enumerate().skip(2 * HALF_TAPS) {
            // Ripple of the pass band.
            assert!((value - wave(n as i64 - HALF_TAPS as i64)).abs() < 0.005);
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
