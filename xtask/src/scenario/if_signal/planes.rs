//! I and Q of consecutive samples, each in an array of its own.

use super::lanes::LANES;

/// I and Q, padded with zeros to whole vectors.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Planes {
    pub(super) i: Vec<f32>,
    pub(super) q: Vec<f32>,
}

impl Planes {
    /// Zeros for `samples`.
    pub(super) fn clear(&mut self, samples: usize) {
        for plane in [&mut self.i, &mut self.q] {
            plane.clear();
            plane.resize(samples.next_multiple_of(LANES), 0.0);
        }
    }

    /// Both.
    pub(super) fn each(&mut self) -> [&mut Vec<f32>; 2] {
        [&mut self.i, &mut self.q]
    }
}
