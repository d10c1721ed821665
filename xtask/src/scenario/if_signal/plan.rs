//! Who makes which samples: a scene cut into blocks of plain numbers, which can be made in any
//! order.

use std::sync::Arc;

use anyhow::{Result, ensure};

use super::front_end::MARGIN_TICKS;
use super::grid::{Grid, HALVES};
use super::segment::{Segment, Track};
use crate::scenario::antenna::{Emitter, Gap};

/// Samples delivered by a block, at most: 4 ms, and no more than this. A multiple of 8, so that
/// blocks of any format end with a byte.
const LONGEST_BLOCK_S: f64 = 4e-3;
const LARGEST_BLOCK: i64 = 16_384;

/// Consecutive ticks of a block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Run {
    /// The first.
    pub(super) tick: i64,
    /// How many.
    pub(super) samples: usize,
    /// Whether they reach the file.
    pub(super) delivered: bool,
    /// Everything that is received meanwhile, and [`MARGIN_TICKS`] before and after.
    pub(super) segments: Vec<Arc<Segment>>,
}

/// Cuts a scene into blocks.
pub(super) struct Planner {
    tracks: Vec<Track>,
    /// First ticks lost and first ones after, in order.
    gaps: Vec<(i64, i64)>,
    /// Whether lost samples are made all the same, for a gain that follows them.
    makes_lost: bool,
    block: i64,
    tick: i64,
    /// Samples still to be delivered.
    left: i64,
}

impl Planner {
    /// # Errors
    /// Where gaps overlap or edges go back.
    pub(super) fn new(
        emitters: Vec<Box<dyn Emitter>>,
        gaps: &[Gap],
        grid: Grid,
        length_ticks: u64,
        makes_lost: bool,
    ) -> Result<Self> {
        let ticks = |gap: &Gap| {
            let begin = grid.first_tick(gap.begin_s);
            (begin, grid.first_tick(gap.begin_s + gap.duration_s))
        };
        ensure!(
            gaps.iter().all(|g| g.duration_s >= 0.0 && g.begin_s >= 0.0)
                && gaps.is_sorted_by(|a, b| a.begin_s + a.duration_s <= b.begin_s),
            "gaps are {gaps:?}: expected them in increasing order, from 0 s on, not overlapping"
        );
        let tracks = emitters
            .into_iter()
            .map(|emitter| Track::new(emitter, grid));
        let block = (LONGEST_BLOCK_S * grid.sample_rate_hz) as i64 / 8 * 8;
        Ok(Self {
            tracks: tracks.collect::<Result<_>>()?,
            gaps: gaps.iter().map(ticks).collect(),
            makes_lost,
            block: block.min(LARGEST_BLOCK),
            tick: 0,
            left: length_ticks as i64,
        })
    }

    /// The runs of the next block; none at the end. It ends with a whole byte, is the last, or ends
    /// with lost samples that are made: a gap of any length takes no more memory than a block.
    ///
    /// # Errors
    /// Where an emitter has no value.
    pub(super) fn next_block(&mut self) -> Result<Option<Vec<Run>>> {
        let mut wanted = self.block.min(self.left);
        if wanted == 0 {
            return Ok(None);
        }
        let mut runs = Vec::new();
        while wanted > 0 {
            let gap = self.gaps.iter().find(|(_, end)| *end > self.tick).copied();
            let run = match gap {
                Some((begin, end)) if begin <= self.tick => {
                    if self.makes_lost {
                        let samples = (end - self.tick).min(self.block);
                        runs.push(self.run(samples, false)?);
                        self.tick += samples;
                        return Ok(Some(runs));
                    }
                    // What is not made is passed over at once.
                    self.tick = end;
                    continue;
                }
                Some((begin, _)) => wanted.min(begin - self.tick),
                None => wanted,
            };
            runs.push(self.run(run, true)?);
            self.tick += run;
            self.left -= run;
            wanted -= run;
        }
        Ok(Some(runs))
    }

    fn run(&mut self, samples: i64, delivered: bool) -> Result<Run> {
        let from = (self.tick - MARGIN_TICKS) * HALVES;
        let to = (self.tick + samples + MARGIN_TICKS) * HALVES;
        let mut segments = Vec::new();
        for track in &mut self.tracks {
            segments.extend(track.cover(from, to)?);
        }
        Ok(Run {
            tick: self.tick,
            samples: samples as usize,
            delivered,
            segments,
        })
    }
}
