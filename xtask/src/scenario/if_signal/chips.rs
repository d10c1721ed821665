//! A ranging code as the inner loops read it: numbers, and its edges.

use super::lanes::LANES;

/// Code periods in a table, so that one that begins anywhere reaches [`MOST_CHIPS`] further.
const PERIODS: usize = 4;
pub(super) const CODE_CHIPS: usize = 1023;
/// Chips behind the last that a sample holds: what a vector reads beyond.
const GUARD_CHIPS: usize = LANES + 4;
/// Chips that one pass of an inner loop may run through.
pub(super) const MOST_CHIPS: usize = (PERIODS - 1) * CODE_CHIPS - GUARD_CHIPS;
/// Chips in a table: a power of two at which a vector may begin, and the rest of the last one.
const LENGTH: usize = PERIODS * CODE_CHIPS + GUARD_CHIPS;
const BEGINS: usize = 4096;
const _: () = assert!(LENGTH >= BEGINS - 1 + LANES);

/// One number for each chip.
pub(super) type Table = [f32; LENGTH];

/// The entries of eight chips, from number `first` on.
#[inline(always)]
pub(super) fn window(table: &Table, first: usize) -> &[f32; LANES] {
    // No chip lies beyond: the remainder only shows that none is read outside the table.
    let first = first % BEGINS;
    table[first..first + LANES]
        .as_chunks()
        .0
        .first()
        .unwrap_or(&[0.0; LANES])
}

/// Chips of +1 and -1, each with the edge before it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChipTable {
    /// The chips.
    pub(super) chips: Box<Table>,
    /// Mean of a chip and the one before it.
    pub(super) middles: Box<Table>,
    /// Half their difference.
    pub(super) halves: Box<Table>,
}

impl ChipTable {
    /// Zeros.
    pub(super) fn empty() -> Self {
        let zeros = || Box::new([0.0; LENGTH]);
        Self {
            chips: zeros(),
            middles: zeros(),
            halves: zeros(),
        }
    }

    /// A few periods of `code`.
    pub(super) fn of(code: &[i8; CODE_CHIPS]) -> Self {
        let mut table = Self::empty();
        for period in table.chips.chunks_mut(CODE_CHIPS) {
            for (place, chip) in period.iter_mut().zip(code) {
                *place = f32::from(*chip);
            }
        }
        table.find_edges();
        // The chip before the first is the last of a period.
        (table.middles[0], table.halves[0]) = (table.middles[CODE_CHIPS], table.halves[CODE_CHIPS]);
        table
    }

    /// Finds the edges of the chips; the first is taken to have none.
    fn find_edges(&mut self) {
        let edges = self.middles.iter_mut().zip(self.halves.iter_mut()).skip(1);
        for ((middle, half), pair) in edges.zip(self.chips.windows(2)) {
            *middle = 0.5 * (pair[1] + pair[0]);
            *half = 0.5 * (pair[1] - pair[0]);
        }
    }

    /// Holds `count` chips of a code from now on, those `first` and more after chip `at` of a
    /// period, with the signs of `bits`: runs of chips from that chip on.
    pub(super) fn refill_signed(
        &mut self,
        code: &Self,
        at: usize,
        bits: &[(usize, f32)],
        first: usize,
        count: usize,
    ) {
        let chips = &code.chips[(at + first) % CODE_CHIPS..];
        let (mut skip, mut filled) = (first, 0);
        for &(run, sign) in bits {
            let passed = skip.min(run);
            skip -= passed;
            let end = filled + (run - passed).min(count - filled);
            let places = self.chips[filled..end].iter_mut();
            for (place, chip) in places.zip(&chips[filled..end]) {
                *place = chip * sign;
            }
            filled = end;
        }
        // Older chips that follow are read with the last ones, and never seen.
        self.find_edges();
    }
}

#[cfg(test)]
mod tests {
    use gnss_signal::{SignalId, ranging_code};

    use super::*;

    fn code() -> &'static [i8; CODE_CHIPS] {
        ranging_code(SignalId::gps_l1_ca(11).unwrap())
    }

    #[test]
    fn edges_are_those_of_neighbours_round_the_period() {
        let table = ChipTable::of(code());
        for k in [0, 1, 500, 1022, 1023, MOST_CHIPS + CODE_CHIPS] {
            let chip = |n: usize| f32::from(code()[n % CODE_CHIPS]);
            let (this, before) = (chip(k), chip(k + CODE_CHIPS - 1));
            assert_eq!(window(&table.chips, k)[0], this);
            assert_eq!(table.middles[k] + table.halves[k], this);
            assert_eq!(table.middles[k] - table.halves[k], before);
        }
    }

    #[test]
    fn bits_turn_their_chips_over() {
        let table = ChipTable::of(code());
        let mut signed = ChipTable::empty();
        let bits = [(4, -1.0), (6, 1.0), (100, -1.0)];
        signed.refill_signed(&table, 1020, &bits, 2, 20);
        for k in 0..20 {
            let chip = f32::from(code()[(1022 + k) % CODE_CHIPS]);
            let sign = if (2..8).contains(&k) { 1.0 } else { -1.0 };
            assert_eq!(signed.chips[k], sign * chip, "{k}");
            if k > 0 {
                assert_eq!(signed.middles[k] + signed.halves[k], signed.chips[k]);
                assert_eq!(signed.middles[k] - signed.halves[k], signed.chips[k - 1]);
            }
        }
    }
}
