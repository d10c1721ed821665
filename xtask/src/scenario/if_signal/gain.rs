//! The level at the quantiser.

use super::planes::Planes;
use crate::scenario::antenna::Gain;

/// Ticks between steps of an automatic gain; steps lie on multiples of it.
const STEP_TICKS: i64 = 256;

/// Brings samples to an rms of 1 in a component.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum GainControl {
    /// Divides by this rms.
    Fixed { rms: f64 },
    /// Divides by the rms of the past.
    Automatic {
        /// Mean power of a component, weighted by exp(-age / time constant).
        power: f64,
        /// Part of the past that is left after a step.
        kept: f64,
        /// Sum of the powers since the last step, and their number.
        sum: f64,
        count: u32,
    },
}

impl GainControl {
    /// Level control that begins at `rms`.
    pub(super) fn new(gain: Gain, rms: f64, sample_rate_hz: f64) -> Self {
        match gain {
            Gain::Fixed => Self::Fixed { rms },
            Gain::Automatic { time_s } => Self::Automatic {
                power: rms * rms,
                kept: (-(STEP_TICKS as f64) / (sample_rate_hz * time_s)).exp(),
                sum: 0.0,
                count: 0,
            },
        }
    }

    /// Whether it needs all samples in order.
    pub(super) const fn follows(&self) -> bool {
        matches!(self, Self::Automatic { .. })
    }

    /// Scales `samples` of `planes`, the first of which is `tick`; real samples count I only.
    pub(super) fn apply(&mut self, tick: i64, samples: usize, complex: bool, planes: &mut Planes) {
        let mut at = 0;
        while at < samples {
            let here = tick + at as i64;
            let step_end = (here.div_euclid(STEP_TICKS) + 1) * STEP_TICKS;
            let end = match self {
                Self::Fixed { .. } => samples,
                Self::Automatic { .. } => samples.min(at + (step_end - here) as usize),
            };
            let per_rms = self.per_rms();
            self.measure(planes, at..end, complex);
            for plane in planes.each() {
                plane[at..end].iter_mut().for_each(|x| *x *= per_rms);
            }
            if tick + end as i64 == step_end {
                self.step();
            }
            at = end;
        }
    }

    fn per_rms(&self) -> f32 {
        let power = match self {
            Self::Fixed { rms } => rms * rms,
            Self::Automatic { power, .. } => *power,
        };
        // Silence without noise has no level.
        (1.0 / power.sqrt().max(1e-6)) as f32
    }

    fn measure(&mut self, planes: &Planes, range: std::ops::Range<usize>, complex: bool) {
        let Self::Automatic { sum, count, .. } = self else {
            return;
        };
        let square = |x: &f32| f64::from(*x) * f64::from(*x);
        *count += range.len() as u32;
        *sum += if complex {
            let (i, q) = (&planes.i[range.clone()], &planes.q[range]);
            i.iter()
                .zip(q)
                .map(|(i, q)| 0.5 * (square(i) + square(q)))
                .sum::<f64>()
        } else {
            planes.i[range].iter().map(square).sum::<f64>()
        };
    }

    fn step(&mut self) {
        if let Self::Automatic {
            power,
            kept,
            sum,
            count,
        } = self
            && *count > 0
        {
            *power = *kept * *power + (1.0 - *kept) * *sum / f64::from(*count);
            (*sum, *count) = (0.0, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels of constant input of amplitude 3, given a block at a time.
    fn levels(blocks: &[usize]) -> Vec<f32> {
        let mut gain = GainControl::new(Gain::Automatic { time_s: 1e-3 }, 1.0, 1e6);
        let (mut tick, mut out) = (0, Vec::new());
        for &samples in blocks {
            let mut planes = Planes {
                i: vec![3.0; samples],
                q: vec![3.0; samples],
            };
            gain.apply(tick, samples, true, &mut planes);
            tick += samples as i64;
            out.extend(planes.i);
        }
        out
    }

    #[test]
    fn the_level_follows_the_power_with_the_time_constant() {
        let levels = levels(&[5120]);
        for step in [0, 1, 4, 19] {
            // The power goes from 1 to 9; steps see what came before them.
            let age = step as f64 * 256e-6 / 1e-3;
            let power = 9.0 - 8.0 * (-age).exp();
            let expected = 3.0 / power.sqrt();
            assert!((f64::from(levels[step * 256 + 7]) - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn blocks_of_any_length_give_the_same() {
        assert_eq!(levels(&[5120]), levels(&[1, 255, 256, 300, 4000, 308]));
    }
}
