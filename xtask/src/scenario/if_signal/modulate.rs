//! The inner loop of synthesis: code, bits and carrier of a ray, added to samples.
//!
//! Samples of an unfiltered signal hold the chip of their instant. Where a front-end filter
//! follows, a signal is made twice a sample, and its chip edges are smooth: a chip is what it is
//! after a low-pass ([`EDGE`]) that passes what the filter lets through and stops what sampling
//! would fold into it.

use std::sync::Arc;

use super::carrier::{Carrier, GROUP, Rotation, VECTORS};
use super::chips::{CODE_CHIPS, ChipTable, MOST_CHIPS, Table, window};
use super::lanes::{self, Floats, Kernel, LANES, Words};
use super::planes::Planes;
use super::segment::{CHIP, FRACTION_BITS, Segment, UniformRay};

/// Samples in which all rays add up before the next ones are made: they stay in the nearest cache.
const CHUNK: usize = 2688;
/// Fraction bits of the code phase within a vector: 1e-6 m.
const LANE_BITS: i32 = 28;

/// Half the width of a chip edge, half samples; never more than half a chip, where edges touch (from
/// 2.6 samples a microsecond down).
const EDGE_HALF_WIDTH: f64 = 2.55;
/// A step from -1 to 1 as odd polynomial (x, x^3, x^5, x^7) of the distance from the edge over half
/// its width: least squares to a spectrum of 1 up to 0.42 of the sample rate (0.4 dB less there)
/// and of 0 above 1.54 (40 dB less): what sampling at twice the rate folds into the band.
const EDGE: [f64; 4] = [
    3.513_107_609_262_331,
    -6.309_862_660_871_332,
    5.726_363_709_543_239,
    -1.929_608_657_934_238,
];

/// What samples are made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sampling {
    /// To be delivered: once a tick, and a chip edge lies between two samples.
    Delivered,
    /// To be filtered: on every half tick, with edges low-passed.
    Filtered,
}

impl Sampling {
    /// Half ticks from a sample to the next.
    const fn halves(self) -> i64 {
        match self {
            Self::Delivered => 2,
            Self::Filtered => 1,
        }
    }
}

/// Makes the signals of rays.
pub(super) struct Modulator {
    sampling: Sampling,
    /// Amplitude of a component over the square root of C/N0 in Hz.
    scale: f64,
    /// Chips among which the bit changes.
    signed: Box<ChipTable>,
}

impl Modulator {
    pub(super) fn new(sampling: Sampling, scale: f64) -> Self {
        Self {
            sampling,
            scale,
            signed: Box::new(ChipTable::empty()),
        }
    }

    /// Makes samples of what `segments` have; the first one stands at half tick `first`.
    pub(super) fn make(&mut self, segments: &[Arc<Segment>], first: i64, planes: &mut Planes) {
        let rays = segments.iter().flat_map(|segment| {
            let rays = segment.rays.iter();
            rays.map(|ray| Steady::new(segment, ray, self.sampling.halves()))
        });
        let rays: Vec<Steady> = rays.collect();
        let length = planes.i.len();
        // Even parts: none is short, at most rates none crosses into another millisecond.
        let parts = length.div_ceil(CHUNK).max(1);
        let chunk = length.div_ceil(parts).next_multiple_of(LANES).max(LANES);
        for begin in (0..length).step_by(chunk) {
            let range = begin..(begin + chunk).min(length);
            planes.i[range.clone()].fill(0.0);
            planes.q[range.clone()].fill(0.0);
            for ray in &rays {
                self.add(ray, first, range.clone(), planes);
            }
        }
    }

    /// Adds what `steady` has of the samples in `range`.
    fn add(
        &mut self,
        steady: &Steady,
        first: i64,
        range: std::ops::Range<usize>,
        planes: &mut Planes,
    ) {
        let halves = self.sampling.halves();
        let segment = steady.segment;
        let index_of = |half: i64| {
            let samples = (half - first + halves - 1).div_euclid(halves);
            samples.clamp(range.start as i64, range.end as i64) as usize
        };
        let (begin, end) = (index_of(segment.begin), index_of(segment.end));
        for begin in (begin..end).step_by(steady.longest) {
            let range = begin..(begin + steady.longest).min(end);
            let since = first + halves * begin as i64 - segment.begin;
            self.add_ray(steady, since, range, planes);
        }
    }

    /// Adds the samples in `range` of a ray, the first of them `since` half ticks after its begin.
    fn add_ray(
        &mut self,
        steady: &Steady,
        since: i64,
        range: std::ops::Range<usize>,
        planes: &mut Planes,
    ) {
        let &Steady {
            segment, ray, step, ..
        } = steady;
        let phase = ray.phase + since as u64 * ray.half_step;
        // The chips begin with the one before that of the first sample.
        let first = (phase >> FRACTION_BITS) as usize - 1;
        let last = ((phase + (range.len() as u64 - 1) * step) >> FRACTION_BITS) as usize + 1;
        let mut amplitude = self.scale * ray.amplitude;
        let (code, at) = match constant_sign(&ray.bits, first, last) {
            Some(sign) => {
                amplitude *= f64::from(sign);
                (&*segment.code, (ray.first_chip + first) % CODE_CHIPS)
            }
            None => {
                let count = last + 1 - first;
                self.signed
                    .refill_signed(&segment.code, ray.first_chip, &ray.bits, first, count);
                (&*self.signed, 0)
            }
        };
        let cycles = ray.cycles + since as f64 * ray.half_cycles;
        let sweep = Sweep {
            // In chips of the table.
            phase: phase - ((first as u64) << FRACTION_BITS) + ((at as u64) << FRACTION_BITS),
            step,
            ahead: &steady.ahead,
            carrier: Carrier::new(amplitude, cycles, &steady.rotation),
            i: &mut planes.i[range.clone()],
            q: &mut planes.q[range],
        };
        match self.sampling {
            Sampling::Delivered => sweep.run(Sharp { chips: &code.chips }),
            Sampling::Filtered => {
                let reach = EDGE_HALF_WIDTH * ray.half_step as f64 / CHIP;
                if reach < 0.5 {
                    sweep.run(Smooth::<false>::new(code, reach));
                } else {
                    sweep.run(Smooth::<true>::new(code, 0.5));
                }
            }
        }
    }
}

/// A ray of a segment with what all its samples have in common.
struct Steady<'a> {
    segment: &'a Segment,
    ray: &'a UniformRay,
    /// Advance of the code from sample to sample, chips in fixed point.
    step: u64,
    /// Advance of the code over the first sample of a group, by vector and lane.
    ahead: [[u32; LANES]; VECTORS],
    /// Samples that one table of chips reaches for.
    longest: usize,
    rotation: Rotation,
}

impl<'a> Steady<'a> {
    /// A ray whose samples are so many half ticks apart.
    fn new(segment: &'a Segment, ray: &'a UniformRay, halves: i64) -> Self {
        let step = halves as u64 * ray.half_step;
        let ahead = |sample: usize| ((sample as u64 * step) >> LANE_SHIFT) as u32;
        Self {
            segment,
            ray,
            step,
            ahead: std::array::from_fn(|row| std::array::from_fn(|k| ahead(row * LANES + k))),
            longest: ((MOST_CHIPS as f64 * CHIP / step as f64) as usize).max(1),
            rotation: Rotation::new(halves as f64 * ray.half_cycles),
        }
    }
}

/// The sign of all chips from number `first` to `last`, in runs of `bits`; none where it changes.
fn constant_sign(bits: &[(usize, f32)], first: usize, last: usize) -> Option<f32> {
    let mut begin = 0;
    for (run, sign) in bits {
        let end = begin + run;
        if first < end {
            return (last < end).then_some(*sign);
        }
        begin = end;
    }
    None
}

/// What a signal is between its chips, before its carrier.
trait Shape: Copy {
    /// What eight consecutive chips have in common, and the code phase in the first of them.
    type Window<F: Floats>: Copy;
    /// Code phases over that of a window.
    type Ahead<F: Floats>: Copy;
    /// The shape in vectors, which finds its way from the chips with numbers `first` and after,
    /// `fraction` ([`LANE_BITS`]) into the first.
    fn window<F: Floats>(self, first: usize, fraction: u32) -> Self::Window<F>;
    /// Advances in chips, [`LANE_BITS`] of them behind the point.
    fn ahead<F: Floats>(chips: &[u32; LANES]) -> Self::Ahead<F>;
    /// Values in a window, less than eight chips after its begin.
    fn values<F: Floats>(self, window: Self::Window<F>, ahead: Self::Ahead<F>) -> F;
    /// Phase at which a window's first entry is the one to take, chips in fixed point.
    const AHEAD: u64;
}

/// One pass over samples: code phase (chips of a table, in fixed point) and carrier.
struct Sweep<'a> {
    phase: u64,
    step: u64,
    ahead: &'a [[u32; LANES]; VECTORS],
    carrier: Carrier<'a>,
    i: &'a mut [f32],
    q: &'a mut [f32],
}

impl Sweep<'_> {
    /// Adds the carrier times `shape` to every sample.
    fn run(self, shape: impl Shape) {
        // Vectors that share a window: they begin in its first chip and reach into its last, short
        // of where single precision rounds to the next.
        let last = |vectors: u64| (vectors * LANES as u64 - 1) * self.step;
        let reach = ((LANES as u64 - 1) << FRACTION_BITS) - (1 << (FRACTION_BITS - 18));
        if last(4) < reach {
            lanes::run(Add::<_, 4> { sweep: self, shape });
        } else if last(2) < reach {
            lanes::run(Add::<_, 2> { sweep: self, shape });
        } else {
            lanes::run(Add::<_, 1> { sweep: self, shape });
        }
    }
}

/// A [`Sweep`] in which `SHARING` vectors share a window of chips.
struct Add<'a, S, const SHARING: usize> {
    sweep: Sweep<'a>,
    shape: S,
}

impl<S: Shape, const SHARING: usize> Kernel for Add<'_, S, SHARING> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let Self {
            sweep:
                Sweep {
                    phase,
                    step,
                    ahead,
                    carrier,
                    i,
                    q,
                },
            shape,
        } = self;
        let mut groups = Groups::<F, S, SHARING> {
            shape,
            phase: phase + S::AHEAD,
            step: SHARING as u64 * LANES as u64 * step,
            carrier,
            ahead: std::array::from_fn::<_, SHARING, _>(|row| S::ahead::<F>(&ahead[row])),
        };
        let (whole_i, rest_i) = i.as_chunks_mut::<GROUP>();
        let (whole_q, rest_q) = q.as_chunks_mut::<GROUP>();
        for (i, q) in whole_i.iter_mut().zip(whole_q) {
            groups.add(i, q);
        }
        if !rest_i.is_empty() {
            let (mut i, mut q) = ([0.0; GROUP], [0.0; GROUP]);
            i[..rest_i.len()].copy_from_slice(rest_i);
            q[..rest_q.len()].copy_from_slice(rest_q);
            groups.add(&mut i, &mut q);
            rest_i.copy_from_slice(&i[..rest_i.len()]);
            rest_q.copy_from_slice(&q[..rest_q.len()]);
        }
    }
}

/// From the fraction bits of a phase to those in a lane.
const LANE_SHIFT: u32 = FRACTION_BITS - LANE_BITS as u32;

/// Where a [`Sweep`] stands.
struct Groups<'a, F: Floats, S: Shape, const SHARING: usize> {
    shape: S,
    phase: u64,
    /// Advance from one window to the next.
    step: u64,
    carrier: Carrier<'a>,
    /// Advance of each lane over the first, by vector.
    ahead: [S::Ahead<F>; SHARING],
}

impl<F: Floats, S: Shape, const SHARING: usize> Groups<'_, F, S, SHARING> {
    #[inline(always)]
    fn add(&mut self, i: &mut [f32; GROUP], q: &mut [f32; GROUP]) {
        let mask = (1_u64 << FRACTION_BITS) - 1;
        let (cosine, sine) = self.carrier.next();
        let (c, s) = (F::splat(cosine), F::splat(sine));
        let minus_s = F::splat(-sine);
        let (i, q) = (i.as_chunks_mut::<LANES>().0, q.as_chunks_mut::<LANES>().0);
        for first in (0..VECTORS).step_by(SHARING) {
            let fraction = ((self.phase & mask) >> LANE_SHIFT) as u32;
            let chip = (self.phase >> FRACTION_BITS) as usize;
            let window = self.shape.window::<F>(chip, fraction);
            self.phase = self.phase.wrapping_add(self.step);
            for (row, ahead) in self.ahead.iter().enumerate() {
                let value = self.shape.values(window, *ahead);
                let k = first + row;
                let cosines = F::load(&self.carrier.rotation.cosines[k]);
                let sines = F::load(&self.carrier.rotation.sines[k]);
                let (i, q) = (&mut i[k], &mut q[k]);
                let re = minus_s.fused(sines, c * cosines);
                let im = s.fused(cosines, c * sines);
                value.fused(re, F::load(i)).store(i);
                value.fused(im, F::load(q)).store(q);
            }
        }
    }
}

/// The chip of the instant.
#[derive(Clone, Copy)]
struct Sharp<'a> {
    chips: &'a Table,
}

impl Shape for Sharp<'_> {
    type Window<F: Floats> = (F, F::Words);
    type Ahead<F: Floats> = F::Words;
    const AHEAD: u64 = 0;

    #[inline(always)]
    fn window<F: Floats>(self, first: usize, fraction: u32) -> (F, F::Words) {
        (
            F::load(window(self.chips, first)),
            F::Words::splat(fraction),
        )
    }

    #[inline(always)]
    fn ahead<F: Floats>(chips: &[u32; LANES]) -> F::Words {
        F::Words::load(chips)
    }

    #[inline(always)]
    fn values<F: Floats>(self, (chips, begin): (F, F::Words), ahead: F::Words) -> F {
        (begin + ahead).right::<LANE_BITS>().pick(chips)
    }
}

/// Chips with smooth edges, which may touch one another.
#[derive(Clone, Copy)]
struct Smooth<'a, const TOUCH: bool> {
    middles: &'a Table,
    halves: &'a Table,
    /// Half the width of an edge, chips.
    reach: f32,
    /// Coefficients of the distance from the edge in chips and its odd powers.
    edge: [f32; 4],
}

impl<'a, const TOUCH: bool> Smooth<'a, TOUCH> {
    /// The chips of `code` with edges that reach so many chips to either side.
    fn new(code: &'a ChipTable, reach: f64) -> Self {
        Self {
            middles: &code.middles,
            halves: &code.halves,
            reach: reach as f32,
            edge: std::array::from_fn(|k| (EDGE[k] / reach.powi(2 * k as i32 + 1)) as f32),
        }
    }
}

impl<const TOUCH: bool> Shape for Smooth<'_, TOUCH> {
    /// Middles, halves, and the code phase from the first edge on.
    type Window<F: Floats> = (F, F, F);
    type Ahead<F: Floats> = F;
    /// The nearest edge is the one before half a chip on.
    const AHEAD: u64 = 1 << (FRACTION_BITS - 1);

    #[inline(always)]
    fn window<F: Floats>(self, first: usize, fraction: u32) -> (F, F, F) {
        let chips = fraction as f32 * (1.0 / (1 << LANE_BITS) as f32) - 0.5;
        (
            F::load(window(self.middles, first)),
            F::load(window(self.halves, first)),
            F::splat(chips),
        )
    }

    #[inline(always)]
    fn ahead<F: Floats>(chips: &[u32; LANES]) -> F {
        F::Words::load(chips).to_floats() * F::splat(1.0 / (1 << LANE_BITS) as f32)
    }

    #[inline(always)]
    fn values<F: Floats>(self, (middles, halves, begin): (F, F, F), ahead: F) -> F {
        // Numbers of this size are whole, and their last bits count.
        const WHOLE: f32 = (3 << 22) as f32;
        let whole = F::splat(WHOLE);
        let [a, b, c, d] = self.edge.map(F::splat);

        let chips = begin + ahead;
        let nearest = chips + whole;
        let mut x = chips - (nearest - whole);
        if !TOUCH {
            x = x.min(F::splat(self.reach)).max(F::splat(-self.reach));
        }
        let x2 = x * x;
        let slope = d.fused(x2, c).fused(x2, b).fused(x2, a);
        let edge = nearest.bits();
        (edge.pick(halves) * x).fused(slope, edge.pick(middles))
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Portable;
    use super::*;

    #[test]
    fn an_edge_is_its_polynomial() {
        let mut table = ChipTable::empty();
        // An edge from -1 to 1 before chip 3.
        (table.middles[3], table.halves[3]) = (0.0, 1.0);
        let smooth = Smooth::<false>::new(&table, 0.4);
        for k in -10..=10 {
            let x = f64::from(k) / 10.0;
            let powers = [x, x.powi(3), x.powi(5), x.powi(7)];
            let expected: f64 = powers.iter().zip(EDGE).map(|(x, c)| x * c).sum();
            let window = smooth.window::<Portable>(0, 1 << (LANE_BITS - 1));
            let chips = ((3.0 + 0.4 * x) * f64::from(1 << LANE_BITS)) as u32;
            let ahead = Smooth::<false>::ahead::<Portable>(&[chips; LANES]);
            let mut found = [0.0; LANES];
            smooth.values(window, ahead).store(&mut found);
            // Coefficients of up to 6 and a phase of 3 chips in single precision.
            let error = f64::from(found[0]) - expected;
            assert!(error.abs() < 4e-6, "{found:?} at {x}");
        }
    }

    #[test]
    fn a_bit_is_constant_up_to_its_last_chip() {
        let bits = [(5, -1.0), (100, 1.0)];
        assert_eq!(constant_sign(&bits, 0, 4), Some(-1.0));
        assert_eq!(constant_sign(&bits, 0, 5), None);
        assert_eq!(constant_sign(&bits, 5, 104), Some(1.0));
        assert_eq!(constant_sign(&bits, 50, 105), None);
    }
}
