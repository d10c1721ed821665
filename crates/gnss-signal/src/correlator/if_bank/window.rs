//! The latest samples, unpacked, with their power.

use super::square_sum;
use crate::{
    FrontEnd, SignalError,
    sample::{SampleRing, SampleSource},
};

/// Samples over which squares are added up in advance.
const BLOCK_TICKS: u64 = 64;

/// Least duration kept, s: two of the longest integrations.
const KEPT_S: f64 = 0.04;

/// The last samples of a ring as 8-bit values, from a multiple of [`BLOCK_TICKS`] on.
#[derive(Debug)]
pub(super) struct SampleWindow {
    components: usize,
    kept_ticks: u64,
    first_tick: u64,
    end_tick: u64,
    values: Vec<i8>,
    /// Sum of the squares of all values before each block.
    squares_before: Vec<u64>,
}

impl SampleWindow {
    pub(super) fn new(front_end: FrontEnd) -> Self {
        Self {
            components: if front_end.complex { 2 } else { 1 },
            kept_ticks: ((front_end.sample_rate_hz * KEPT_S) as u64).max(2 * BLOCK_TICKS),
            first_tick: 0,
            end_tick: 0,
            values: Vec::new(),
            squares_before: vec![0],
        }
    }

    /// Takes in what `ring` has read since the last time.
    pub(super) fn follow<S: SampleSource>(
        &mut self,
        ring: &SampleRing<S>,
    ) -> Result<(), SignalError> {
        let newest = ring.newest_tick();
        let keep_from = newest
            .saturating_sub(self.kept_ticks)
            .max(ring.oldest_tick());
        let keep_from = keep_from.next_multiple_of(BLOCK_TICKS);
        if keep_from >= self.end_tick {
            self.values.clear();
            self.squares_before.clear();
            self.squares_before.push(0);
            self.first_tick = keep_from;
            self.end_tick = self.first_tick;
        } else if keep_from > self.first_tick + self.kept_ticks {
            let dropped = keep_from - self.first_tick;
            self.values.drain(..dropped as usize * self.components);
            self.squares_before
                .drain(..(dropped / BLOCK_TICKS) as usize);
            self.first_tick = keep_from;
        }
        ring.unpack(self.end_tick, newest, &mut self.values)?;
        self.end_tick = newest;
        self.add_squares();
        Ok(())
    }

    fn add_squares(&mut self) {
        let block = BLOCK_TICKS as usize * self.components;
        let done = (self.squares_before.len() - 1) * block;
        let mut sum = self.squares_before[self.squares_before.len() - 1];
        for values in self.values[done..].chunks_exact(block) {
            sum += square_sum(values);
            self.squares_before.push(sum);
        }
    }

    /// Values and mean square of the samples from `start_tick` to `end_tick` (exclusive), where
    /// the window holds them all.
    pub(super) fn get(&self, start_tick: u64, end_tick: u64) -> Option<(&[i8], f64)> {
        if start_tick < self.first_tick || end_tick > self.end_tick || start_tick > end_tick {
            return None;
        }
        let start = (start_tick - self.first_tick) as usize * self.components;
        let end = (end_tick - self.first_tick) as usize * self.components;
        let squares = self.squares_until(end) - self.squares_until(start);
        let power = squares as f64 / (end_tick - start_tick).max(1) as f64;
        Some((&self.values[start..end], power))
    }

    /// Sum of the squares of the first `len` values.
    fn squares_until(&self, len: usize) -> u64 {
        let block = BLOCK_TICKS as usize * self.components;
        let whole = len / block;
        self.squares_before[whole] + square_sum(&self.values[whole * block..len])
    }
}
