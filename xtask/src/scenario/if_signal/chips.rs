//! A ranging code as the inner loops read it: numbers, and its edges.

use super::lanes::LANES;

/// Code periods in a table, so that one that begins anywhere reaches [`MOST_CHIPS`] further.
const PERIODS: usize = 4;
const CODE_CHIPS: usize = 1023;
/// Chips behind the last that a sample holds: what a vector reads beyond.
const GUARD_CHIPS: usize = LANES + 4;
/// Chips that one pass of an inner loop may run through.
pub(super) const MOST_CHIPS: usize = (PERIODS - 1) * CODE_CHIPS - GUARD_CHIPS;

/// Chips of +1 and -1, each with the edge before it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct ChipTable {
    /// The chips.
    pub(super) chips: Vec<f32>,
    /// Mean of a chip and the one before it.
    pub(super) middles: Vec<f32>,
    /// Half their difference.
    pub(super) halves: Vec<f32>,
}

/// Part of a [`ChipTable`], from one of its chips on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chips<'a> {
    pub(super) chips: &'a [f32],
    pub(super) middles: &'a [f32],
    pub(super) halves: &'a [f32],
}

impl ChipTable {
    /// A few periods of `code`.
    pub(super) fn of(code: &[i8; CODE_CHIPS]) -> Self {
        let period = code.map(f32::from);
        let mut table = Self::default();
        for _ in 0..PERIODS {
            table.chips.extend_from_slice(&period);
        }
        table.chips.extend_from_slice(&period[..GUARD_CHIPS]);
        table.find_edges();
        // The chip before the first is the last of a period.
        (table.middles[0], table.halves[0]) = (table.middles[CODE_CHIPS], table.halves[CODE_CHIPS]);
        table
    }

    /// Finds the edges of the chips; the first is taken to have none.
    fn find_edges(&mut self) {
        self.middles.resize(self.chips.len(), 0.0);
        self.halves.resize(self.chips.len(), 0.0);
        let edges = self.middles.iter_mut().zip(&mut self.halves).skip(1);
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
        let chips = code.from((at + first) % CODE_CHIPS).chips;
        self.chips.clear();
        let mut skip = first;
        for &(run, sign) in bits {
            let passed = skip.min(run);
            skip -= passed;
            let filled = self.chips.len();
            let some = &chips[filled..filled + (run - passed).min(count - filled)];
            self.chips.extend(some.iter().map(|chip| chip * sign));
        }
        // Read with the last chips, and never seen.
        self.chips.resize(count + GUARD_CHIPS, 0.0);
        self.find_edges();
    }

    /// The part from chip `at` (of a period) on.
    pub(super) fn from(&self, at: usize) -> Chips<'_> {
        Chips {
            chips: &self.chips[at..],
            middles: &self.middles[at..],
            halves: &self.halves[at..],
        }
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
            let part = table.from(k);
            assert_eq!(part.chips[0], this);
            assert_eq!(part.middles[0] + part.halves[0], this);
            assert_eq!(part.middles[0] - part.halves[0], before);
        }
    }

    #[test]
    fn bits_turn_their_chips_over() {
        let table = ChipTable::of(code());
        let mut signed = ChipTable::default();
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
