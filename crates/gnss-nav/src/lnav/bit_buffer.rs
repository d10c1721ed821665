//! The latest navigation bits by number, with gaps.

use std::collections::VecDeque;

use super::WORD_BITS;
use super::parity::Tail;

/// A run of hard bits, each known or erased. Bits are numbered along the channel.
#[derive(Debug, Clone, Default)]
pub(super) struct BitBuffer {
    first: i64,
    bits: VecDeque<Option<bool>>,
}

impl BitBuffer {
    /// Bits kept, 36 s: a whole frame and the subframe before it.
    pub(super) const CAPACITY: usize = 1800;

    /// Number of the oldest bit kept.
    pub(super) const fn first(&self) -> i64 {
        self.first
    }

    /// Number of the next bit.
    pub(super) fn end(&self) -> i64 {
        self.first + self.bits.len() as i64
    }

    /// Forgets everything; the next bit gets the number `first`.
    pub(super) fn restart(&mut self, first: i64) {
        self.bits.clear();
        self.first = first;
    }

    /// Forgets the bits before number `first`.
    pub(super) fn forget_before(&mut self, first: i64) {
        while self.first < first && self.bits.pop_front().is_some() {
            self.first += 1;
        }
    }

    /// Appends a bit, `None` for an erased one.
    pub(super) fn push(&mut self, bit: Option<bool>) {
        self.bits.push_back(bit);
        self.forget_before(self.end() - Self::CAPACITY as i64);
    }

    /// The bit of that number, where it is known.
    pub(super) fn bit(&self, number: i64) -> Option<bool> {
        let index = usize::try_from(number.checked_sub(self.first)?).ok()?;
        self.bits.get(index).copied().flatten()
    }

    /// The `count` (up to 32) bits from number `start`, the first one most significant; `None`
    /// where one is not known.
    pub(super) fn run(&self, start: i64, count: usize) -> Option<u32> {
        (start..start + count as i64).try_fold(0, |run, number| {
            Some(run << 1 | u32::from(self.bit(number)?))
        })
    }

    /// The word that starts at number `start`.
    pub(super) fn word(&self, start: i64) -> Option<u32> {
        self.run(start, WORD_BITS)
    }

    /// The two bits before number `start`.
    pub(super) fn tail_before(&self, start: i64) -> Option<Tail> {
        self.run(start - 2, 2).map(Tail::of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_need_all_their_bits() {
        let mut bits = BitBuffer::default();
        bits.restart(100);
        for bit in [Some(true), Some(false), Some(true), None, Some(true)] {
            bits.push(bit);
        }
        assert_eq!(bits.run(100, 3), Some(0b101));
        assert_eq!(bits.run(101, 3), None);
        assert_eq!(bits.run(99, 2), None);
        assert_eq!(bits.run(104, 2), None);
    }

    #[test]
    fn old_bits_go() {
        let mut bits = BitBuffer::default();
        for number in 0..BitBuffer::CAPACITY + 5 {
            bits.push(Some(number % 2 == 0));
        }
        assert_eq!(bits.first(), 5);
        assert_eq!(bits.bit(4), None);
        assert_eq!(bits.bit(5), Some(false));
    }
}
