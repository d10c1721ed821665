//! The inner loop of synthesis: code, bits and carrier of a ray, added to samples.
//!
//! Samples of an unfiltered signal hold the chip of their instant. Where a front-end filter
//! follows, a signal is made twice a sample, and its chip edges are smooth: a chip is what it is
//! after a low-pass ([`EDGE`]) that passes what the filter lets through and stops what sampling
//! would fold into it.

use super::carrier::{Carrier, GROUP, VECTORS};
use super::chips::{ChipTable, Chips, MOST_CHIPS};
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
    /// Chips among which the bit changes.
    signed: ChipTable,
}

impl Modulator {
    pub(super) fn new(sampling: Sampling, scale: f64) -> Self {
        Self {
            sampling,
            scale,
            signed: ChipTable::default(),
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
        let chips = match constant_sign(&ray.bits, first, last) {
            Some(sign) => {
                amplitude *= f64::from(sign);
                segment.code.from((ray.first_chip + first) % CODE_CHIPS)
            }
            None => {
                let count = last + 1 - first;
                self.signed
                    .refill_signed(&segment.code, ray.first_chip, &ray.bits, first, count);
                self.signed.from(0)
            }
        };
        let sweep = Sweep {
            phase: phase - ((first as u64) << FRACTION_BITS),
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
            Sampling::Delivered => lanes::run(AddSharp { sweep, chips }),
            Sampling::Filtered => {
                let width = (EDGE_HALF_WIDTH * ray.half_step as f64 / CHIP).min(0.5);
                lanes::run(AddSmooth {
                    sweep,
                    chips,
                    per_width: (1.0 / width) as f32,
                });
            }
        }
    }
}

const CODE_CHIPS: usize = 1023;

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

/// One pass over samples: code phase (chips in fixed point, from the begin of a table) and carrier.
struct Sweep<'a> {
    phase: u64,
    step: u64,
    carrier: Carrier,
    i: &'a mut [f32],
    q: &'a mut [f32],
}

impl Sweep<'_> {
    /// Adds the carrier times `value_at` (chip number, and the fraction in each lane of a chip with
    /// [`LANE_BITS`] behind the point) to every sample.
    #[inline(always)]
    fn add<F: Floats>(self, value_at: impl Fn(usize, F::Words) -> F) {
        let Self {
            phase,
            step,
            carrier,
            i,
            q,
        } = self;
        let shift = FRACTION_BITS - LANE_BITS as u32;
        let ahead: [u32; LANES] = std::array::from_fn(|k| ((k as u64 * step) >> shift) as u32);
        let mut groups = Groups {
            phase,
            step,
            carrier,
            ahead: F::Words::load(&ahead),
        };
        let (whole_i, rest_i) = i.as_chunks_mut::<GROUP>();
        let (whole_q, rest_q) = q.as_chunks_mut::<GROUP>();
        for (i, q) in whole_i.iter_mut().zip(whole_q) {
            groups.add(i, q, &value_at);
        }
        if !rest_i.is_empty() {
            let (mut i, mut q) = ([0.0; GROUP], [0.0; GROUP]);
            i[..rest_i.len()].copy_from_slice(rest_i);
            q[..rest_q.len()].copy_from_slice(rest_q);
            groups.add(&mut i, &mut q, &value_at);
            rest_i.copy_from_slice(&i[..rest_i.len()]);
            rest_q.copy_from_slice(&q[..rest_q.len()]);
        }
    }
}

/// Where a [`Sweep`] stands.
struct Groups<W> {
    phase: u64,
    step: u64,
    carrier: Carrier,
    /// Advance of each lane over the first.
    ahead: W,
}

impl<W: Words> Groups<W> {
    #[inline(always)]
    fn add(
        &mut self,
        i: &mut [f32; GROUP],
        q: &mut [f32; GROUP],
        value_at: &impl Fn(usize, W) -> W::Floats,
    ) {
        let mask = (1_u64 << FRACTION_BITS) - 1;
        let shift = FRACTION_BITS - LANE_BITS as u32;
        let (cosine, sine) = self.carrier.next();
        let (c, s) = (W::Floats::splat(cosine), W::Floats::splat(sine));
        let minus_s = W::Floats::splat(-sine);
        let (i, q) = (i.as_chunks_mut::<LANES>().0, q.as_chunks_mut::<LANES>().0);
        for k in 0..VECTORS {
            let fraction = W::splat(((self.phase & mask) >> shift) as u32);
            let value = value_at(
                (self.phase >> FRACTION_BITS) as usize,
                fraction + self.ahead,
            );
            self.phase = self.phase.wrapping_add(LANES as u64 * self.step);
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

/// Eight entries from `at` on.
#[inline(always)]
fn window(table: &[f32], at: usize) -> &[f32; LANES] {
    // Never beyond the end for want of chips.
    table
        .get(at..at + LANES)
        .and_then(|some| some.first_chunk())
        .unwrap_or(&[0.0; LANES])
}

struct AddSharp<'a> {
    sweep: Sweep<'a>,
    chips: Chips<'a>,
}

impl Kernel for AddSharp<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let chips = self.chips.chips;
        self.sweep.add::<F>(
            #[inline(always)]
            |chip, fraction| fraction.right::<LANE_BITS>().pick(window(chips, chip)),
        );
    }
}

struct AddSmooth<'a> {
    sweep: Sweep<'a>,
    chips: Chips<'a>,
    /// One over half the width of an edge, 1/chips.
    per_width: f32,
}

impl Kernel for AddSmooth<'_> {
    #[inline(always)]
    fn run<F: Floats>(mut self) {
        let Chips {
            middles, halves, ..
        } = self.chips;
        // The nearest edge is the one before half a chip on.
        self.sweep.phase += 1 << (FRACTION_BITS - 1);
        let to_width = F::splat(self.per_width / (1 << LANE_BITS) as f32);
        let half_chip = F::splat(-0.5 * self.per_width);
        let (low, high) = (F::splat(-1.0), F::splat(1.0));
        let [a, b, c, d] = EDGE.map(|coefficient| F::splat(coefficient as f32));
        let mask = F::Words::splat((1 << LANE_BITS) - 1);
        self.sweep.add::<F>(
            #[inline(always)]
            |chip, fraction| {
                let index = fraction.right::<LANE_BITS>();
                let x = (fraction & mask).to_floats().fused(to_width, half_chip);
                let x = x.min(high).max(low);
                let x2 = x * x;
                let slope = d.fused(x2, c).fused(x2, b).fused(x2, a);
                let half = index.pick(window(halves, chip)) * x;
                half.fused(slope, index.pick(window(middles, chip)))
            },
        );
    }
}
