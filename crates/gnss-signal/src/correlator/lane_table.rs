//! Which chip each sample of a block falls into.

use std::hint::cold_path;

use super::interval::BLOCK_SAMPLES;

/// Step of the code steps for which a table is kept, chips a sample. Half of it over a block is
/// 4e-6 chips, 1.1 mm.
const STEP_QUANTUM_CHIPS: f64 = 1.0 / 16_777_216.0;

/// Tables kept: one for each satellite and its recent Doppler.
const TABLES_KEPT: usize = 32;

/// Ranks that a byte holds.
const RANKS: usize = 256;

/// Cells of the fractional code phase.
const CELLS: usize = 512;

/// Chip numbers of the samples of a block, counted from the chip of its first sample.
///
/// Sample n lies floor(f + n step) chips on, where f is the fractional code phase of sample 0: the
/// whole part of n step, plus one where f and the fraction of n step carry. As f grows the samples
/// carry one after the other, in the order of those fractions: so there are only
/// [`BLOCK_SAMPLES`] + 1 different rows of chip numbers, and the rank of f among the fractions
/// selects one.
#[derive(Debug, Clone)]
pub(super) struct LaneTable {
    /// By rank; those past [`BLOCK_SAMPLES`] are there so that no index of a byte lies outside.
    rows: Box<[Row; RANKS]>,
    /// Fractions of n step in falling order, then zeros.
    falling: [u32; RANKS],
    cells: [Cell; CELLS],
    /// Chips counted from for each byte of a row.
    origins: [u8; BLOCK_SAMPLES],
}

#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Row([u8; BLOCK_SAMPLES]);

/// What is known of the rank from the high bits of f: so many fractions certainly carry, of 2^32, and the largest that
/// may or may not, to which f is added; less [`CROWDED`] where a second one may.
type Cell = i64;

/// Leaves the rank above the lowest 32 bits as it is.
const CROWDED: Cell = i64::MIN;

impl LaneTable {
    /// The table for `step_chips` a sample (below 1), byte k for sample k, its chip counted
    /// from the nominal chip of sample `origin[k]`.
    fn new(step_chips: f64, origin: &[u8; BLOCK_SAMPLES]) -> Self {
        let fixed = |n: usize| (step_chips * n as f64 * 4_294_967_296.0).round() as u64;
        let mut by_fraction: Vec<(u32, usize)> = (0..BLOCK_SAMPLES)
            .map(|lane| (fixed(lane) as u32, lane))
            .collect();
        by_fraction.sort_unstable_by(|a, b| b.cmp(a));
        let mut row = Row(std::array::from_fn(|lane| {
            ((fixed(lane) >> 32) - (fixed(origin[lane].into()) >> 32)) as u8
        }));
        let mut rows = Box::new([row; RANKS]);
        let mut falling = [0; RANKS];
        for (rank, &(fraction, lane)) in by_fraction.iter().enumerate() {
            falling[rank] = fraction;
            row.0[lane] += 1;
            rows[rank + 1] = row;
        }
        Self {
            rows,
            cells: std::array::from_fn(|number| cell(number as u32, &falling)),
            falling,
            origins: origin.map(|n| (fixed(n.into()) >> 32) as u8),
        }
    }

    /// Chip numbers for the fractional code phase `fraction` (of 2^32) at the first sample.
    #[inline(always)]
    pub(super) fn row(&self, fraction: u32) -> &[u8; BLOCK_SAMPLES] {
        let sum = self.cells[(fraction >> 23) as usize].wrapping_add(i64::from(fraction));
        let mut rank = (sum >> 32) as u8;
        if sum < 0 {
            cold_path();
            while fraction.overflowing_add(self.falling[usize::from(rank)]).1 {
                rank += 1;
            }
        }
        &self.rows[usize::from(rank)].0
    }

    /// From which chip, counted from that of sample 0, byte `byte` of a row counts.
    #[cfg_attr(
        not(target_arch = "x86_64"),
        allow(dead_code, reason = "only vector look-ups count from several origins")
    )]
    pub(super) fn origin_chips(&self, byte: usize) -> usize {
        self.origins.get(byte).map_or(0, |&chips| chips.into())
    }
}

/// The cell of that number.
fn cell(number: u32, falling: &[u32]) -> Cell {
    let smallest = number << 23;
    let largest = smallest | ((1 << 23) - 1);
    let carry = |f: u32| {
        falling
            .iter()
            .take_while(|&&n| f.overflowing_add(n).1)
            .count()
    };
    let rank = carry(smallest);
    let known = ((rank as Cell) << 32) + Cell::from(falling[rank]);
    if carry(largest) > rank + 1 {
        known + CROWDED
    } else {
        known
    }
}

/// The tables last used, the current one first.
#[derive(Debug)]
pub(super) struct LaneTables {
    origin: [u8; BLOCK_SAMPLES],
    recent: Vec<(u64, LaneTable)>,
}

impl LaneTables {
    /// Tables for rows whose byte k counts chips from sample `origin[k]`.
    pub(super) fn new(origin: [u8; BLOCK_SAMPLES]) -> Self {
        Self {
            origin,
            recent: Vec::with_capacity(TABLES_KEPT),
        }
    }

    /// Makes the table for `step_chips` a sample the current one.
    pub(super) fn select(&mut self, step_chips: f64) {
        let key = (step_chips / STEP_QUANTUM_CHIPS).round() as u64;
        match self.recent.iter().position(|(known, _)| *known == key) {
            Some(0) => {}
            Some(at) => self.recent[..=at].rotate_right(1),
            None => {
                let step_chips = key as f64 * STEP_QUANTUM_CHIPS;
                let table = LaneTable::new(step_chips, &self.origin);
                self.recent.truncate(TABLES_KEPT - 1);
                self.recent.insert(0, (key, table));
            }
        }
    }

    /// The table last selected.
    pub(super) fn current(&self) -> Option<&LaneTable> {
        self.recent.first().map(|(_, table)| table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_count_the_chips_of_every_sample() {
        let mut tables = LaneTables::new([0; BLOCK_SAMPLES]);
        for step in [
            1.0 / 16.0,
            0.25,
            1.023e6 / 2.6e6,
            1.023e6 / 16.368_001e6,
            0.9,
        ] {
            tables.select(step);
            let step = (step / STEP_QUANTUM_CHIPS).round() * STEP_QUANTUM_CHIPS;
            let step = (step * 4_294_967_296.0) as u64;
            for i in 0..50_000_u32 {
                let fraction = i.wrapping_mul(2_654_435_761);
                let row = tables.current().unwrap().row(fraction);
                for (chip, n) in row.iter().zip(0_u64..) {
                    let expected = (u64::from(fraction) + n * step) >> 32;
                    assert_eq!(u64::from(*chip), expected);
                }
            }
        }
    }

    #[test]
    fn the_oldest_table_is_given_up() {
        let mut tables = LaneTables::new([0; BLOCK_SAMPLES]);
        for i in 0..100 {
            tables.select(0.1 + f64::from(i) * 1e-3);
        }
        assert_eq!(tables.recent.len(), TABLES_KEPT);
        let front = tables.recent[0].0;
        tables.select(0.199);
        assert_eq!(tables.recent[0].0, front);
    }
}
