//! Emitters as plain numbers: short stretches in which every ray runs uniformly.

use std::collections::VecDeque;
use std::sync::Arc;

use anyhow::{Result, ensure};
use gnss_nav::GpsTime;
use gnss_signal::ranging_code;

use super::chips::ChipTable;
use super::grid::{Grid, HALVES};
use crate::scenario::antenna::{Emitter, Ray};

/// Length of a segment, s: an acceleration of 100 m/s^2 bends a ray by 50 um (3e-4 cycles) in it.
const SEGMENT_S: f64 = 2e-3;
/// Chips a segment may span: code rates far from the nominal one are a fault of the scene.
const MOST_CHIPS: f64 = 4096.0;
/// Chips in the table before the first and after the last: neighbours of an edge, and what a
/// vector reads beyond the end.
const GUARD_CHIPS: usize = 12;
/// Fraction bits of code phases: rounding of the rate reaches 4e-9 chips in a segment.
pub(super) const FRACTION_BITS: u32 = 48;
/// A chip in fixed point.
pub(super) const CHIP: f64 = (1_u64 << FRACTION_BITS) as f64;

/// A stretch of one emitter between two half ticks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Segment {
    /// First half tick.
    pub(super) begin: i64,
    /// First half tick of the next.
    pub(super) end: i64,
    /// Its code.
    pub(super) code: Arc<ChipTable>,
    /// Its rays.
    pub(super) rays: Vec<UniformRay>,
}

/// A ray with constant amplitude, code rate and carrier frequency.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct UniformRay {
    /// Square root of C/N0 in the middle, Hz^(1/2).
    pub(super) amplitude: f64,
    /// Place in the code of the chip at phase 0: the one before that which the segment begins in.
    pub(super) first_chip: usize,
    /// Code phase at the begin, chips in fixed point, in [1, 2).
    pub(super) phase: u64,
    /// Advance in half a tick, chips in fixed point.
    pub(super) half_step: u64,
    /// Chips, and the sign of the bit they carry, from phase 0 on.
    pub(super) bits: Vec<(usize, f32)>,
    /// Carrier at the begin, cycles in [0, 1).
    pub(super) cycles: f64,
    /// Advance in half a tick, cycles.
    pub(super) half_cycles: f64,
}

/// An emitter on the grid of samples; segments are asked for in order.
pub(super) struct Track {
    emitter: Box<dyn Emitter>,
    code: Arc<ChipTable>,
    grid: Grid,
    segment_halves: i64,
    /// Edges, with their first half tick.
    edges: Vec<(i64, f64)>,
    /// The last segments made.
    recent: VecDeque<Arc<Segment>>,
    /// Rays at the end of the last of them.
    last: Vec<Ray>,
}

impl Track {
    pub(super) fn new(emitter: Box<dyn Emitter>, grid: Grid) -> Result<Self> {
        let edges_s = emitter.edges_s();
        ensure!(
            edges_s.is_sorted() && edges_s.iter().all(|t| t.is_finite()),
            "edges of {} are {edges_s:?}: expected instants in increasing order",
            emitter.signal()
        );
        let edges = edges_s.iter().map(|&t| (grid.first_half(t), t)).collect();
        let segment_halves = (SEGMENT_S * grid.sample_rate_hz) as i64 * HALVES;
        Ok(Self {
            code: Arc::new(ChipTable::of(ranging_code(emitter.signal()))),
            emitter,
            grid,
            segment_halves,
            edges,
            recent: VecDeque::new(),
            last: Vec::new(),
        })
    }

    /// The segments that cover half ticks `from` to `to`; `from` never goes back by more than what
    /// the last call ended with.
    ///
    /// # Errors
    /// Where a ray has no value.
    pub(super) fn cover(&mut self, from: i64, to: i64) -> Result<Vec<Arc<Segment>>> {
        while self.recent.front().is_some_and(|s| s.end <= from) {
            self.recent.pop_front();
        }
        let mut next = self.recent.back().map_or(from, |s| s.end);
        while next < to {
            let segment = self.segment_around(next)?;
            next = segment.end;
            self.recent.push_back(Arc::new(segment));
        }
        let covering = self.recent.iter().filter(|s| s.begin < to);
        Ok(covering.cloned().collect())
    }

    /// The segment that `half` lies in: segments are the same wherever one begins to ask.
    fn segment_around(&mut self, half: i64) -> Result<Segment> {
        let node = half.div_euclid(self.segment_halves) * self.segment_halves;
        let after = self.edges.partition_point(|(edge, _)| *edge <= half);
        let before = after.checked_sub(1).and_then(|k| self.edges.get(k));
        let next = self.edges.get(after);
        let begin = before.map_or(node, |(edge, _)| node.max(*edge));
        let end = next.map_or(i64::MAX, |e| e.0);
        let end = end.min(node + self.segment_halves);
        let within_s = {
            let (begin_s, end_s) = (self.grid.elapsed_s(begin).0, self.grid.elapsed_s(end).0);
            let begin_s = before.map_or(begin_s, |(_, edge_s)| begin_s.max(*edge_s));
            let end_s = next.map_or(end_s, |(_, edge_s)| end_s.min(*edge_s));
            0.5 * (begin_s + end_s)
        };
        let continues = self.recent.back().is_some_and(|s| s.end == begin)
            && before.is_none_or(|(edge, _)| *edge < begin);
        let begins = if continues {
            std::mem::take(&mut self.last)
        } else {
            self.rays(begin, within_s)?
        };
        let ends = self.rays(end, within_s)?;
        ensure!(
            begins.len() == ends.len(),
            "{} has {} rays at {within_s} s and then {}: expected the same between edges",
            self.emitter.signal(),
            begins.len(),
            ends.len()
        );
        let halves = (end - begin) as f64;
        let rays = begins.iter().zip(&ends);
        let rays = rays.map(|(a, b)| uniform(self.emitter.as_mut(), a, b, halves));
        let rays = rays.collect::<Result<_>>()?;
        self.last = ends;
        Ok(Segment {
            begin,
            end,
            code: Arc::clone(&self.code),
            rays,
        })
    }

    /// Rays at a half tick, exactly there.
    fn rays(&mut self, half: i64, within_s: f64) -> Result<Vec<Ray>> {
        let (elapsed_s, rest_s) = self.grid.elapsed_s(half);
        let mut rays = Vec::new();
        self.emitter.rays(elapsed_s, within_s, &mut rays)?;
        for ray in &mut rays {
            // The Doppler of 7 ps is nothing.
            ray.arrival.code_time = ray.arrival.code_time + rest_s;
        }
        Ok(rays)
    }
}

/// The ray from `begin` to `end`, `halves` half ticks on.
fn uniform(emitter: &mut dyn Emitter, begin: &Ray, end: &Ray, halves: f64) -> Result<UniformRay> {
    let spec = emitter.signal().spec();
    let (from, to) = (&begin.arrival, &end.arrival);
    let chips = (to.code_time - from.code_time) * spec.code_rate_hz;
    let cycles = to.carrier_cycles - from.carrier_cycles;
    let amplitude = 0.5 * (begin.amplitude + end.amplitude);
    ensure!(
        chips > 0.0 && chips < MOST_CHIPS && cycles.is_finite() && amplitude.is_finite(),
        "{} advances by {chips} chips and {cycles} cycles at amplitude {amplitude} in {SEGMENT_S} s",
        emitter.signal()
    );
    let since_second = from.code_time.fraction_s() * spec.code_rate_hz;
    let per_second = spec.code_rate_hz as usize;
    let chip = (since_second.floor() as usize).min(per_second - 1);
    let second = GpsTime::from_parts(from.code_time.week(), from.code_time.second().into(), 0.0);
    // One chip earlier, so that an edge at the begin has both its neighbours.
    let (second, before) = match chip.checked_sub(1) {
        Some(before) => (second, before),
        None => (second - 1.0, per_second - 1),
    };
    let length = spec.code_length_chips as usize;
    let wanted = chips as usize + 2 + GUARD_CHIPS;
    let chips_per_bit = length * spec.code_periods_per_bit as usize;
    Ok(UniformRay {
        amplitude,
        first_chip: before % length,
        phase: ((since_second - chip as f64 + 1.0) * CHIP).round() as u64,
        half_step: (chips / halves * CHIP).round() as u64,
        bits: bits(emitter, second, before, wanted, chips_per_bit)?,
        cycles: from.carrier_cycles - from.carrier_cycles.floor(),
        half_cycles: cycles / halves,
    })
}

/// Signs of `wanted` chips from chip `at` of a second on.
fn bits(
    emitter: &mut dyn Emitter,
    mut second: GpsTime,
    mut at: usize,
    wanted: usize,
    chips_per_bit: usize,
) -> Result<Vec<(usize, f32)>> {
    let per_second = emitter.signal().spec().code_rate_hz as usize;
    let (mut bits, mut filled) = (Vec::with_capacity(2), 0);
    while filled < wanted {
        let run = (chips_per_bit - at % chips_per_bit).min(wanted - filled);
        bits.push((run, emitter.bit_sign(second, at / chips_per_bit)?));
        filled += run;
        at += run;
        if at == per_second {
            (at, second) = (0, second + 1.0);
        }
    }
    Ok(bits)
}
