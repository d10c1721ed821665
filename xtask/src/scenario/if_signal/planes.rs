//! I and Q of consecutive samples, each in an array of its own.

use super::lanes::{self, Floats, Kernel, LANES};

/// Where the samples of a plane stand against ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stagger {
    /// On ticks.
    Whole = 0,
    /// Half a tick later.
    Half = 1,
}

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

    /// Room for `samples` that are about to be made.
    pub(super) fn fit(&mut self, samples: usize) {
        for plane in [&mut self.i, &mut self.q] {
            plane.resize(samples.next_multiple_of(LANES), 0.0);
        }
    }

    /// Deals samples on half ticks out to those on ticks and those between, where there are
    /// `samples` of each.
    pub(super) fn deal(&self, samples: usize, on: &mut Self, between: &mut Self) {
        on.fit(samples);
        between.fit(samples);
        let planes = [
            (&self.i, &mut on.i, &mut between.i),
            (&self.q, &mut on.q, &mut between.q),
        ];
        for (halves, on, between) in planes {
            lanes::run(Deal {
                halves,
                on,
                between,
            });
        }
    }

    /// Both.
    pub(super) fn each(&mut self) -> [&mut Vec<f32>; 2] {
        [&mut self.i, &mut self.q]
    }
}

struct Deal<'a> {
    halves: &'a [f32],
    on: &'a mut [f32],
    between: &'a mut [f32],
}

impl Kernel for Deal<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let pairs = self.halves.as_chunks::<2>().0.iter();
        let places = self.on.iter_mut().zip(self.between);
        for (place, pair) in places.zip(pairs) {
            (*place.0, *place.1) = (pair[0], pair[1]);
        }
    }
}
