//! The inner loop of synthesis: code, bits and carrier of a ray, added to samples.
//!
//! Samples of an unfiltered signal hold the chip of their instant. Where a front-end filter
//! follows, a signal is made twice a sample, and its chip edges are smooth: a chip is what it is
//! after a low-pass ([`EDGE`]) that passes what the filter lets through and stops what sampling
//! would fold into it.

use super::carrier::{Carrier, GROUP, VECTORS};
use super::chips::{CODE_CHIPS, ChipTable, MOST_CHIPS, Table, window};
use super::lanes::{self, Floats, Kernel, LANES, Words};
use super::planes::Planes;
use super::segment::{CHIP, FRACTION_BITS, Segment, UniformRay};

/// Samples in which all rays add up before the next ones are made: they stay in the nearest cache.
const CHUNK: usize = 2688;
/// Fraction bits of the code phase within a vector: 1e-6 m.
const LANE_BITS: i32 = 28;

/// Half the width of a chip edge, half samples; never more than half a chip.
const EDGE_HALF_WIDTH: f64 = 2.5;
/// A step from -1 to 1 as odd polynomial (x, x^3, x^5, x^7) of the distance from the edge over half
/// its width: least squares to a spectrum of 1 up to 0.43 of the sample rate (0.4 dB less there)
/// and of 0 above 1.57 (40 dB less): what sampling at twice the rate folds into the band.
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
    edge: Edge,
    /// Chips among which the bit changes.
    signed: Box<ChipTable>,
}

impl Modulator {
    pub(super) fn new(sampling: Sampling, scale: f64) -> Self {
        Self {
            sampling,
            scale,
            edge: Edge::new(),
            signed: Box::new(ChipTable::empty()),
        }
    }

    /// Adds what `segments` have to samples whose first one stands at half tick `first`.
    pub(super) fn add_all<'a>(
        &mut self,
        segments: impl Iterator<Item = &'a Segment> + Clone,
        first: i64,
        planes: &mut Planes,
    ) {
        let length = planes.i.len();
        // Even parts: none is short, at most rates none crosses into another millisecond.
        let parts = length.div_ceil(CHUNK).max(1);
        let chunk = length.div_ceil(parts).next_multiple_of(LANES).max(LANES);
        for begin in (0..length).step_by(chunk) {
            let range = begin..(begin + chunk).min(length);
            for segment in segments.clone() {
                self.add(segment, first, range.clone(), planes);
            }
        }
    }

    /// Adds what `segment` has of the samples in `range`.
    fn add(
        &mut self,
        segment: &Segment,
        first: i64,
        range: std::ops::Range<usize>,
        planes: &mut Planes,
    ) {
        let halves = self.sampling.halves();
        let index_of = |half: i64| {
            let samples = (half - first + halves - 1).div_euclid(halves);
            samples.clamp(range.start as i64, range.end as i64) as usize
        };
        let (begin, end) = (index_of(segment.begin), index_of(segment.end));
        for ray in &segment.rays {
            let step = halves as u64 * ray.half_step;
            let longest = ((MOST_CHIPS as f64 * CHIP / step as f64) as usize).max(1);
            for begin in (begin..end).step_by(longest) {
                let range = begin..(begin + longest).min(end);
                let since = first + halves * begin as i64 - segment.begin;
                self.add_ray(segment, ray, since, range, planes);
            }
        }
    }

    /// Adds the samples in `range` of a ray, the first of them `since` half ticks after its begin.
    fn add_ray(
        &mut self,
        segment: &Segment,
        ray: &UniformRay,
        since: i64,
        range: std::ops::Range<usize>,
        planes: &mut Planes,
    ) {
        let halves = self.sampling.halves();
        let step = halves as u64 * ray.half_step;
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
        let sweep = Sweep {
            // In chips of the table.
            phase: phase - ((first as u64) << FRACTION_BITS) + ((at as u64) << FRACTION_BITS),
            step,
            carrier: Carrier::new(
                amplitude,
                ray.cycles + since as f64 * ray.half_cycles,
                halves as f64 * ray.half_cycles,
            ),
            i: &mut planes.i[range.clone()],
            q: &mut planes.q[range],
        };
        match self.sampling {
            Sampling::Delivered => sweep.run(Sharp { chips: &code.chips }),
            Sampling::Filtered => {
                let width = (EDGE_HALF_WIDTH * ray.half_step as f64 / CHIP).min(0.5);
                sweep.run(Smooth {
                    middles: &code.middles,
                    halves: &code.halves,
                    edge: self.edge,
                    per_width: (self.edge.reach / width) as f32,
                });
            }
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
    /// What eight consecutive chips have in common.
    type Window<F: Floats>: Copy;
    /// The shape in vectors, which finds its way from the chips with numbers `first` and after.
    fn window<F: Floats>(self, first: usize) -> Self::Window<F>;
    /// Values where code phases are so many chips ([`LANE_BITS`] of them behind the point) after
    /// the begin of a window, less than eight.
    fn values<F: Floats>(self, window: Self::Window<F>, chips: F::Words) -> F;
    /// Phase at which a window's first entry is the one to take, chips in fixed point.
    const AHEAD: u64;
}

/// One pass over samples: code phase (chips of a table, in fixed point) and carrier.
struct Sweep<'a> {
    phase: u64,
    step: u64,
    carrier: Carrier,
    i: &'a mut [f32],
    q: &'a mut [f32],
}

impl Sweep<'_> {
    /// Adds the carrier times `shape` to every sample.
    fn run(self, shape: impl Shape) {
        // Vectors that share a window: they begin in its first chip and reach into its last.
        let last = |vectors: u64| (vectors * LANES as u64 - 1) * self.step;
        let reach = (LANES as u64 - 1) << FRACTION_BITS;
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
                    carrier,
                    i,
                    q,
                },
            shape,
        } = self;
        let ahead = |row: usize| {
            let lane = |k: usize| (row * LANES + k) as u64 * step;
            F::Words::load(&std::array::from_fn(|k| (lane(k) >> LANE_SHIFT) as u32))
        };
        let mut groups = Groups {
            phase: phase + S::AHEAD,
            step: SHARING as u64 * LANES as u64 * step,
            carrier,
            ahead: std::array::from_fn::<_, SHARING, _>(ahead),
        };
        let (whole_i, rest_i) = i.as_chunks_mut::<GROUP>();
        let (whole_q, rest_q) = q.as_chunks_mut::<GROUP>();
        for (i, q) in whole_i.iter_mut().zip(whole_q) {
            groups.add(i, q, shape);
        }
        if !rest_i.is_empty() {
            let (mut i, mut q) = ([0.0; GROUP], [0.0; GROUP]);
            i[..rest_i.len()].copy_from_slice(rest_i);
            q[..rest_q.len()].copy_from_slice(rest_q);
            groups.add(&mut i, &mut q, shape);
            rest_i.copy_from_slice(&i[..rest_i.len()]);
            rest_q.copy_from_slice(&q[..rest_q.len()]);
        }
    }
}

/// From the fraction bits of a phase to those in a lane.
const LANE_SHIFT: u32 = FRACTION_BITS - LANE_BITS as u32;

/// Where a [`Sweep`] stands.
struct Groups<W, const SHARING: usize> {
    phase: u64,
    /// Advance from one window to the next.
    step: u64,
    carrier: Carrier,
    /// Advance of each lane over the first, by vector.
    ahead: [W; SHARING],
}

impl<W: Words, const SHARING: usize> Groups<W, SHARING> {
    #[inline(always)]
    fn add(&mut self, i: &mut [f32; GROUP], q: &mut [f32; GROUP], shape: impl Shape) {
        let mask = (1_u64 << FRACTION_BITS) - 1;
        let (cosine, sine) = self.carrier.next();
        let (c, s) = (W::Floats::splat(cosine), W::Floats::splat(sine));
        let minus_s = W::Floats::splat(-sine);
        let (i, q) = (i.as_chunks_mut::<LANES>().0, q.as_chunks_mut::<LANES>().0);
        for first in (0..VECTORS).step_by(SHARING) {
            let begin = W::splat(((self.phase & mask) >> LANE_SHIFT) as u32);
            let window = shape.window::<W::Floats>((self.phase >> FRACTION_BITS) as usize);
            self.phase = self.phase.wrapping_add(self.step);
            for (row, ahead) in self.ahead.iter().enumerate() {
                let value = shape.values(window, begin + *ahead);
                let k = first + row;
                let cosines = W::Floats::load(&self.carrier.cosines[k]);
                let sines = W::Floats::load(&self.carrier.sines[k]);
                let (i, q) = (&mut i[k], &mut q[k]);
                let re = minus_s.fused(sines, c * cosines);
                let im = s.fused(cosines, c * sines);
                value.fused(re, W::Floats::load(i)).store(i);
                value.fused(im, W::Floats::load(q)).store(q);
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
    type Window<F: Floats> = F;
    const AHEAD: u64 = 0;

    #[inline(always)]
    fn window<F: Floats>(self, first: usize) -> F {
        F::load(window(self.chips, first))
    }

    #[inline(always)]
    fn values<F: Floats>(self, window: F, chips: F::Words) -> F {
        chips.right::<LANE_BITS>().pick(window)
    }
}

/// [`EDGE`] in the variable y = x (-d)^(1/7), which spares the last coefficient: it is -1.
#[derive(Debug, Clone, Copy)]
struct Edge {
    /// y at the end of an edge.
    reach: f64,
    /// Coefficients of y, y^3, y^5.
    coefficients: [f32; 3],
}

impl Edge {
    fn new() -> Self {
        let reach = (-EDGE[3]).powf(1.0 / 7.0);
        let coefficient = |k: usize| (EDGE[k] / reach.powi(2 * k as i32 + 1)) as f32;
        Self {
            reach,
            coefficients: std::array::from_fn(coefficient),
        }
    }
}

/// Chips with smooth edges.
#[derive(Clone, Copy)]
struct Smooth<'a> {
    middles: &'a Table,
    halves: &'a Table,
    edge: Edge,
    /// Distance from the edge in y over that in chips.
    per_width: f32,
}

impl Shape for Smooth<'_> {
    /// Middles and halves.
    type Window<F: Floats> = (F, F);
    /// The nearest edge is the one before half a chip on.
    const AHEAD: u64 = 1 << (FRACTION_BITS - 1);

    #[inline(always)]
    fn window<F: Floats>(self, first: usize) -> (F, F) {
        (
            F::load(window(self.middles, first)),
            F::load(window(self.halves, first)),
        )
    }

    #[inline(always)]
    fn values<F: Floats>(self, (middles, halves): (F, F), chips: F::Words) -> F {
        let mask = F::Words::splat((1 << LANE_BITS) - 1);
        let to_width = F::splat(self.per_width / (1 << LANE_BITS) as f32);
        let half_chip = F::splat(-0.5 * self.per_width);
        let reach = self.edge.reach as f32;
        let [a, b, c] = self.edge.coefficients.map(F::splat);

        let y = (chips & mask).to_floats().fused(to_width, half_chip);
        let y = y.min(F::splat(reach)).max(F::splat(-reach));
        let y2 = y * y;
        let slope = (c - y2).fused(y2, b).fused(y2, a);
        let index = chips.right::<LANE_BITS>();
        (index.pick(halves) * y).fused(slope, index.pick(middles))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_is_its_polynomial() {
        let edge = Edge::new();
        for k in -10..=10 {
            let x = f64::from(k) / 10.0;
            let powers = [x, x.powi(3), x.powi(5), x.powi(7)];
            let expected: f64 = powers.iter().zip(EDGE).map(|(x, c)| x * c).sum();
            let y = x * edge.reach;
            let [a, b, c] = edge.coefficients.map(f64::from);
            let found = y * (a + y * y * (b + y * y * (c - y * y)));
            // Coefficients of up to 6 in single precision.
            assert!((found - expected).abs() < 2e-6, "{found} at {x}");
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
