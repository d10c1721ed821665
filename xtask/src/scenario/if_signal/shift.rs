//! From baseband to the intermediate frequency.

use std::f64::consts::TAU;

use super::lanes::{self, Floats, Kernel, LANES};
use super::planes::Planes;

/// Turns samples by a frequency in cycles per sample, the first one by `cycles`.
pub(super) fn shift(cycles: f64, frequency: f64, planes: &mut Planes) {
    lanes::run(Shift {
        cycles,
        frequency,
        planes,
    });
}

struct Shift<'a> {
    cycles: f64,
    frequency: f64,
    planes: &'a mut Planes,
}

impl Kernel for Shift<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let phasor = |cycles: f64| (TAU * (cycles - cycles.round())).sin_cos();
        let lanes: [_; LANES] = std::array::from_fn(|k| phasor(k as f64 * self.frequency));
        let cosines = F::load(&lanes.map(|(_, cosine)| cosine as f32));
        let sines = F::load(&lanes.map(|(sine, _)| sine as f32));
        let (step_sine, step_cosine) = phasor(LANES as f64 * self.frequency);
        let (mut sine, mut cosine) = phasor(self.cycles);
        let (i, _) = self.planes.i.as_chunks_mut::<LANES>();
        let (q, _) = self.planes.q.as_chunks_mut::<LANES>();
        for (i, q) in i.iter_mut().zip(q) {
            let (c, s) = (F::splat(cosine as f32), F::splat(sine as f32));
            let (c, s) = (c * cosines - s * sines, s * cosines + c * sines);
            let (a, b) = (F::load(i), F::load(q));
            (a * c - b * s).store(i);
            (a * s + b * c).store(q);
            (sine, cosine) = (
                sine * step_cosine + cosine * step_sine,
                cosine * step_cosine - sine * step_sine,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_turn_by_the_frequency() {
        let mut planes = Planes {
            i: vec![1.0; 8000],
            q: vec![0.5; 8000],
        };
        shift(0.3, -0.123_456, &mut planes);
        for n in 0..8000 {
            let (sine, cosine) = (TAU * (0.3 - 0.123_456 * n as f64)).sin_cos();
            // Single precision of three products.
            assert!((f64::from(planes.i[n]) - (cosine - 0.5 * sine)).abs() < 5e-7);
            assert!((f64::from(planes.q[n]) - (sine + 0.5 * cosine)).abs() < 5e-7);
        }
    }
}
