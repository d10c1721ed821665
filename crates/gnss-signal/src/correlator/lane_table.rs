//! Which chip each sample of a vector falls into.

/// Step of the code steps for which a table is kept, chips a sample. Half of it over 64 samples is
/// 2e-6 chips, 0.6 mm.
const STEP_QUANTUM_CHIPS: f64 = 1.0 / 16_777_216.0;

/// Tables kept: one for each satellite and its recent Doppler.
const TABLES_KEPT: usize = 32;

/// Entries of the first guess at a rank.
const GUESSES: usize = 512;

/// Chip numbers of the samples of a vector of `LANES`, counted from the chip of its first sample.
///
/// Sample n lies floor(f + n step) chips on, where f is the fractional code phase of sample 0: the
/// whole part of n step, plus one where f and the fraction of n step carry. As f grows the samples
/// carry one after the other, in the order of those fractions: so there are only `LANES` + 1
/// different rows of chip numbers, and the rank of f among the fractions selects one.
#[derive(Debug, Clone)]
pub(super) struct LaneTable<const LANES: usize> {
    rows: Box<[Row<LANES>; 128]>,
    /// Fractions of n step in falling order, then zeros.
    falling: [u32; 128],
    /// Chips counted from for each byte of a row.
    origins: [u8; LANES],
    /// By the high bits of 2^32 - 1 - f: a rank that is certainly reached.
    guesses: [u8; GUESSES],
}

#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Row<const LANES: usize>([u8; LANES]);

impl<const LANES: usize> LaneTable<LANES> {
    /// The table for `step_chips` a sample (below 1), with byte k for the sample `order[k]` and its
    /// chip counted from the nominal chip of sample `origin[k]`.
    fn new(step_chips: f64, order: &[u8; LANES], origin: &[u8; LANES]) -> Self {
        let fixed = |n: u8| (step_chips * f64::from(n) * 4_294_967_296.0).round() as u64;
        let mut by_fraction: Vec<(u32, usize)> = (0..LANES)
            .map(|lane| (fixed(order[lane]) as u32, lane))
            .collect();
        by_fraction.sort_unstable_by(|a, b| b.cmp(a));
        let mut row = Row(std::array::from_fn(|lane| {
            ((fixed(order[lane]) >> 32) - (fixed(origin[lane]) >> 32)) as u8
        }));
        let mut rows = Box::new([row; 128]);
        let mut falling = [0; 128];
        for (rank, &(fraction, lane)) in by_fraction.iter().enumerate() {
            falling[rank] = fraction;
            row.0[lane] += 1;
            rows[rank + 1] = row;
        }
        let guesses = std::array::from_fn(|cell| {
            let largest = (cell as u32 + 1).wrapping_mul(1 << 23).wrapping_sub(1);
            falling
                .iter()
                .take_while(|&&fraction| fraction > largest)
                .count() as u8
        });
        Self {
            rows,
            falling,
            origins: origin.map(|n| (fixed(n) >> 32) as u8),
            guesses,
        }
    }

    /// Chip numbers for the fractional code phase `fraction` (of 2^32) at the first sample.
    #[inline(always)]
    pub(super) fn row(&self, fraction: u32) -> &[u8; LANES] {
        let below = !fraction;
        let mut rank = usize::from(self.guesses[(below >> 23) as usize]);
        rank += usize::from(self.falling[rank & 127] > below);
        while self.falling[rank & 127] > below {
            rank += 1;
        }
        &self.rows[rank & 127].0
    }

    /// From which chip, counted from that of sample 0, byte `byte` of a row counts.
    pub(super) fn origin_chips(&self, byte: usize) -> usize {
        self.origins.get(byte).map_or(0, |&chips| chips.into())
    }
}

/// The tables last used, the current one first.
#[derive(Debug)]
pub(super) struct LaneTables<const LANES: usize> {
    order: [u8; LANES],
    origin: [u8; LANES],
    recent: Vec<(u64, LaneTable<LANES>)>,
}

impl<const LANES: usize> LaneTables<LANES> {
    /// Tables for a vector whose byte k belongs to sample `order[k]` and counts chips from sample
    /// `origin[k]`.
    pub(super) fn new(order: [u8; LANES], origin: [u8; LANES]) -> Self {
        Self {
            order,
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
                let table = LaneTable::new(step_chips, &self.order, &self.origin);
                self.recent.truncate(TABLES_KEPT - 1);
                self.recent.insert(0, (key, table));
            }
        }
    }

    /// The table last selected.
    pub(super) fn current(&self) -> Option<&LaneTable<LANES>> {
        self.recent.first().map(|(_, table)| table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_count_the_chips_of_every_sample() {
        let order: [u8; 64] = std::array::from_fn(|k| (k * 37 % 64) as u8);
        let mut tables = LaneTables::new(order, [0; 64]);
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
                for (chip, n) in row.iter().zip(order) {
                    let expected = (u64::from(fraction) + u64::from(n) * step) >> 32;
                    assert_eq!(u64::from(*chip), expected);
                }
            }
        }
    }

    #[test]
    fn the_oldest_table_is_given_up() {
        let mut tables = LaneTables::<64>::new(std::array::from_fn(|k| k as u8), [0; 64]);
        for i in 0..100 {
            tables.select(0.1 + f64::from(i) * 1e-3);
        }
        assert_eq!(tables.recent.len(), TABLES_KEPT);
        let front = tables.recent[0].0;
        tables.select(0.199);
        assert_eq!(tables.recent[0].0, front);
    }
}
