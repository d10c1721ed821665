//! The carrier of a ray: single-precision phasors that are taken up anew from double precision.

use std::f64::consts::TAU;

use super::lanes::LANES;

/// Vectors after which the carrier is taken up anew from double precision.
pub(super) const VECTORS: usize = 4;
/// Samples in them.
pub(super) const GROUP: usize = VECTORS * LANES;

/// How a carrier turns: the same for every group of a ray.
pub(super) struct Rotation {
    /// Turn from one group to the next.
    turn: (f64, f64),
    /// Phasors of the samples of a group against its first, by vector and lane.
    pub(super) cosines: [[f32; LANES]; VECTORS],
    pub(super) sines: [[f32; LANES]; VECTORS],
}

impl Rotation {
    /// That of a carrier which advances by `step_cycles` a sample.
    pub(super) fn new(step_cycles: f64) -> Self {
        // Powers of the step by squaring, so that few products follow one another.
        let one = unit(step_cycles);
        let two = product(one, one);
        let three = product(two, one);
        let four = product(two, two);
        let near = [(1.0, 0.0), one, two, three];
        let eight = product(four, four);
        let mut rotation = Self {
            turn: (1.0, 0.0),
            cosines: [[0.0; LANES]; VECTORS],
            sines: [[0.0; LANES]; VECTORS],
        };
        let rows = rotation.cosines.iter_mut().zip(&mut rotation.sines);
        for (cosines, sines) in rows {
            let half = product(rotation.turn, four);
            for (k, phasor) in near.iter().enumerate() {
                for (at, from) in [(k, rotation.turn), (k + 4, half)] {
                    let (cosine, sine) = product(from, *phasor);
                    (cosines[at], sines[at]) = (cosine as f32, sine as f32);
                }
            }
            rotation.turn = product(rotation.turn, eight);
        }
        rotation
    }
}

/// A carrier somewhere on its way.
pub(super) struct Carrier<'a> {
    pub(super) rotation: &'a Rotation,
    /// Amplitude and phase at the first sample of the group.
    phasor: (f64, f64),
}

impl<'a> Carrier<'a> {
    /// A carrier of `amplitude` that stands at `cycles`.
    pub(super) fn new(amplitude: f64, cycles: f64, rotation: &'a Rotation) -> Self {
        let (cosine, sine) = unit(cycles);
        Self {
            rotation,
            phasor: (amplitude * cosine, amplitude * sine),
        }
    }

    /// The phasor at the first sample of the group, and on to the next group.
    #[inline(always)]
    pub(super) fn next(&mut self) -> (f32, f32) {
        let phasor = self.phasor;
        self.phasor = product(phasor, self.rotation.turn);
        (phasor.0 as f32, phasor.1 as f32)
    }
}

/// The phasor of unit length at so many cycles.
fn unit(cycles: f64) -> (f64, f64) {
    let (sine, cosine) = (TAU * (cycles - cycles.round())).sin_cos();
    (cosine, sine)
}

/// Product of two phasors.
#[inline(always)]
fn product(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.1 * b.0 + a.0 * b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phasors_are_those_of_their_sample() {
        for step_cycles in [0.0, 1.3e-3, -0.123_456, 0.4999] {
            let rotation = Rotation::new(step_cycles);
            let mut carrier = Carrier::new(2.5, 0.3, &rotation);
            for group in 0..100 {
                let (c, s) = carrier.next();
                for k in 0..GROUP {
                    let (row, lane) = (k / LANES, k % LANES);
                    let (x, y) = (rotation.cosines[row][lane], rotation.sines[row][lane]);
                    let cycles = 0.3 + step_cycles * (group * GROUP + k) as f64;
                    let (sine, cosine) = (TAU * cycles).sin_cos();
                    // Single precision of two factors and a sum.
                    assert!((f64::from(c * x - s * y) - 2.5 * cosine).abs() < 1e-6);
                    assert!((f64::from(s * x + c * y) - 2.5 * sine).abs() < 1e-6);
                }
            }
        }
    }
}
