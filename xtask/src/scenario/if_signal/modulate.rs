//! The inner loop of synthesis: code, bits and carrier of a ray, added to samples.
//!
//! Samples of an unfiltered signal hold the chip of their instant. Where a front-end filter
//! follows, a signal is made twice a sample, and its chip edges are smooth: a chip is what it is
//! after a low-pass ([`EDGE`]) that passes what the filter lets through and stops what sampling
//! would fold into it.

use std::f64::consts::TAU;

use super::lanes::{self, Floats, Kernel, LANES, Words};
use super::planes::Planes;
use super::segment::{CHIP, FRACTION_BITS, Segment, UniformRay};

/// Samples in which all rays add up before the next ones are made: they stay in the nearest cache.
pub(super) const CHUNK: usize = 1024;
/// Chips of a chunk, its neighbours, and what a vector reads beyond.
const TABLE_CHIPS: usize = CHUNK + 24;
/// Vectors after which the carrier is taken up anew from double precision.
const VECTORS: usize = 4;
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

/// How chip edges are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edges {
    /// At their instant: between two samples.
    Sharp,
    /// Low-passed, for a signal made twice a sample and filtered.
    Smooth,
}

/// Chips of a ray with their amplitude, as the inner loop reads them.
pub(super) struct Modulator {
    edges: Edges,
    /// Amplitude of a component over the square root of C/N0 in Hz.
    scale: f64,
    chips: Box<[f32; TABLE_CHIPS]>,
    /// Mean of a chip and the one before it, and half their difference.
    middles: Box<[f32; TABLE_CHIPS]>,
    halves: Box<[f32; TABLE_CHIPS]>,
}

/// Where the samples of a plane stand against ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stagger {
    /// On ticks.
    Whole = 0,
    /// Half a tick later.
    Half = 1,
}

impl Modulator {
    pub(super) fn new(edges: Edges, scale: f64) -> Self {
        let zeros = || Box::new([0.0; TABLE_CHIPS]);
        Self {
            edges,
            scale,
            chips: zeros(),
            middles: zeros(),
            halves: zeros(),
        }
    }

    /// Adds what `segment` has of the [`CHUNK`] (at most) of `range` to samples whose first one is
    /// `tick`.
    pub(super) fn add(
        &mut self,
        segment: &Segment,
        tick: i64,
        range: std::ops::Range<usize>,
        stagger: Stagger,
        planes: &mut Planes,
    ) {
        // Sample n of the planes stands at half tick 2 (tick + n) + stagger.
        let index_of = |half: i64| {
            let ticks = (half - stagger as i64 + 1).div_euclid(2);
            (ticks - tick).clamp(range.start as i64, range.end as i64) as usize
        };
        let (begin, end) = (index_of(segment.begin), index_of(segment.end));
        if begin >= end {
            return;
        }
        let since = 2 * (tick + begin as i64) + stagger as i64 - segment.begin;
        for ray in &segment.rays {
            self.add_ray(segment, ray, since, begin..end, planes);
        }
    }

    fn add_ray(
        &mut self,
        segment: &Segment,
        ray: &UniformRay,
        since: i64,
        range: std::ops::Range<usize>,
        planes: &mut Planes,
    ) {
        let step = 2 * ray.half_step;
        let phase = ray.phase + since as u64 * ray.half_step;
        // The table begins with the chip before that of the first sample.
        let first = (phase >> FRACTION_BITS) as usize - 1;
        let count = (range.len() as f64 * step as f64 / CHIP) as usize + 4 + LANES;
        self.fill(segment, ray, first, count.min(TABLE_CHIPS));
        let phase = phase - ((first as u64) << FRACTION_BITS);
        let samples = Samples {
            i: &mut planes.i[range.clone()],
            q: &mut planes.q[range],
        };
        let sweep = Sweep {
            phase,
            step,
            carrier: Carrier::new(
                ray.cycles + since as f64 * ray.half_cycles,
                2.0 * ray.half_cycles,
            ),
            samples,
        };
        match self.edges {
            Edges::Sharp => lanes::run(AddSharp {
                sweep,
                chips: &self.chips,
            }),
            Edges::Smooth => {
                let width = (EDGE_HALF_WIDTH * ray.half_step as f64 / CHIP).min(0.5);
                lanes::run(AddSmooth {
                    sweep,
                    middles: &self.middles,
                    halves: &self.halves,
                    per_width: (1.0 / width) as f32,
                });
            }
        }
    }

    /// Fills the tables with `count` chips of `ray` from number `first` on.
    fn fill(&mut self, segment: &Segment, ray: &UniformRay, first: usize, count: usize) {
        let (mut skip, mut filled) = (first, 0);
        for &(run, sign) in &ray.bits {
            let passed = skip.min(run);
            skip -= passed;
            let mut left = (run - passed).min(count - filled);
            let level = sign * (self.scale * ray.amplitude) as f32;
            while left > 0 {
                let at = (ray.first_chip + first + filled) % segment.code.len();
                let some = left.min(segment.code.len() - at);
                let to = &mut self.chips[filled..filled + some];
                for (out, chip) in to.iter_mut().zip(&segment.code[at..at + some]) {
                    *out = level * f32::from(*chip);
                }
                filled += some;
                left -= some;
            }
        }
        // Read beyond the last sample, and never seen.
        self.chips[filled..count].fill(0.0);
        if self.edges == Edges::Smooth {
            let pairs = self.chips[..count].windows(2);
            let tables = self.middles[1..].iter_mut().zip(&mut self.halves[1..]);
            for (pair, (middle, half)) in pairs.zip(tables) {
                *middle = 0.5 * (pair[1] + pair[0]);
                *half = 0.5 * (pair[1] - pair[0]);
            }
        }
    }
}

struct Samples<'a> {
    i: &'a mut [f32],
    q: &'a mut [f32],
}

/// A carrier: its phasor now, and those of the samples of a group against its first.
struct Carrier {
    phasor: (f64, f64),
    group: (f64, f64),
    cosines: [[f32; LANES]; VECTORS],
    sines: [[f32; LANES]; VECTORS],
}

impl Carrier {
    fn new(cycles: f64, step_cycles: f64) -> Self {
        let phasor = |cycles: f64| {
            let (sine, cosine) = (TAU * (cycles - cycles.round())).sin_cos();
            (cosine, sine)
        };
        let step = phasor(step_cycles);
        let mut carrier = Self {
            phasor: phasor(cycles),
            group: (1.0, 0.0),
            cosines: [[0.0; LANES]; VECTORS],
            sines: [[0.0; LANES]; VECTORS],
        };
        let cosines = carrier.cosines.as_flattened_mut().iter_mut();
        for (cosine, sine) in cosines.zip(carrier.sines.as_flattened_mut()) {
            (*cosine, *sine) = (carrier.group.0 as f32, carrier.group.1 as f32);
            carrier.group = turn(carrier.group, step);
        }
        carrier
    }
}

/// Product of two phasors.
fn turn(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.1 * b.0 + a.0 * b.1)
}

/// One pass over samples: code phase (chips in fixed point, from the begin of a table) and carrier.
struct Sweep<'a> {
    phase: u64,
    step: u64,
    carrier: Carrier,
    samples: Samples<'a>,
}

impl Sweep<'_> {
    /// Adds the carrier times `value_at` (chip number, and the fraction in each lane of a chip with
    /// [`LANE_BITS`] behind the point) to every sample.
    #[inline(always)]
    fn add<F: Floats>(self, value_at: impl Fn(usize, F::Words) -> F) {
        let Self {
            mut phase,
            step,
            mut carrier,
            samples,
        } = self;
        let shift = FRACTION_BITS - LANE_BITS as u32;
        let ahead: [u32; LANES] = std::array::from_fn(|k| ((k as u64 * step) >> shift) as u32);
        let ahead = F::Words::load(&ahead);
        let mask = (1_u64 << FRACTION_BITS) - 1;
        let (i, q) = (samples.i, samples.q);
        let groups = i
            .chunks_mut(VECTORS * LANES)
            .zip(q.chunks_mut(VECTORS * LANES));
        for (i, q) in groups {
            let (c, s) = (
                F::splat(carrier.phasor.0 as f32),
                F::splat(carrier.phasor.1 as f32),
            );
            let rows = carrier.cosines.iter().zip(&carrier.sines);
            let vectors = i.chunks_mut(LANES).zip(q.chunks_mut(LANES));
            for ((i, q), (cosines, sines)) in vectors.zip(rows) {
                let fraction = F::Words::splat(((phase & mask) >> shift) as u32);
                let value = value_at((phase >> FRACTION_BITS) as usize, fraction + ahead);
                phase = phase.wrapping_add(LANES as u64 * step);
                let (cosines, sines) = (F::load(cosines), F::load(sines));
                accumulate(i, value * (c * cosines - s * sines));
                accumulate(q, value * (s * cosines + c * sines));
            }
            carrier.phasor = turn(carrier.phasor, carrier.group);
        }
    }
}

/// Adds a vector to samples, which may be fewer at the end.
#[inline(always)]
fn accumulate<F: Floats>(samples: &mut [f32], value: F) {
    if let Ok(whole) = <&mut [f32; LANES]>::try_from(&mut *samples) {
        (F::load(whole) + value).store(whole);
    } else {
        let mut values = [0.0; LANES];
        value.store(&mut values);
        for (sample, value) in samples.iter_mut().zip(values) {
            *sample += value;
        }
    }
}

/// Eight entries from `at` on.
#[inline(always)]
fn window(table: &[f32; TABLE_CHIPS], at: usize) -> &[f32; LANES] {
    // Never beyond the end for want of chips; a shorter table would repeat its last ones.
    let at = at.min(TABLE_CHIPS - LANES);
    table[at..].first_chunk().unwrap_or(&[0.0; LANES])
}

struct AddSharp<'a> {
    sweep: Sweep<'a>,
    chips: &'a [f32; TABLE_CHIPS],
}

impl Kernel for AddSharp<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let chips = self.chips;
        self.sweep.add::<F>(
            #[inline(always)]
            |chip, fraction| fraction.right::<LANE_BITS>().pick(window(chips, chip)),
        );
    }
}

struct AddSmooth<'a> {
    sweep: Sweep<'a>,
    middles: &'a [f32; TABLE_CHIPS],
    halves: &'a [f32; TABLE_CHIPS],
    /// One over half the width of an edge, 1/chips.
    per_width: f32,
}

impl Kernel for AddSmooth<'_> {
    #[inline(always)]
    fn run<F: Floats>(mut self) {
        let (middles, halves) = (self.middles, self.halves);
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
                let x = (fraction & mask).to_floats() * to_width + half_chip;
                let x = x.min(high).max(low);
                let x2 = x * x;
                let step = (((d * x2 + c) * x2 + b) * x2 + a) * x;
                index.pick(window(middles, chip)) + index.pick(window(halves, chip)) * step
            },
        );
    }
}
