//! Ranging codes as the kernels read them.

use std::ops::Range;
use std::sync::LazyLock;

use crate::{CA_CODE_LENGTH_CHIPS, Signal, SignalId, ranging_code};

/// Chips beyond a period that the kernels may read: those of a chunk, then a window.
pub(super) const AHEAD_CHIPS: usize = 1024 + 256;

/// A ranging code, 1 where the chip is +1 and 0 where it is -1, continued into the next period so
/// that windows from all chips of a chunk that begins in the first are contiguous.
pub(super) type CodeBits = [u8; CA_CODE_LENGTH_CHIPS + 1 + AHEAD_CHIPS];

static CA_CODE_BITS: LazyLock<Vec<CodeBits>> = LazyLock::new(|| {
    let spec = Signal::GpsL1Ca.spec();
    (spec.first_prn..=spec.last_prn)
        .filter_map(|prn| SignalId::new(Signal::GpsL1Ca, prn).ok())
        .map(|signal| {
            let code = ranging_code(signal);
            std::array::from_fn(|chip| u8::from(code[chip % CA_CODE_LENGTH_CHIPS] > 0))
        })
        .collect()
});

/// The code of `signal`.
pub(super) fn code_bits(signal: SignalId) -> &'static CodeBits {
    &CA_CODE_BITS[usize::from(signal.prn() - signal.spec().first_prn)]
}

/// Chips at which a code changes, over as many as [`CodeBits`] holds.
#[derive(Debug)]
pub(super) struct CodeChanges {
    /// Twice the chip, and one more where the code changes to 1.
    changes: Vec<u16>,
    /// By chip, how many changes come before it.
    before: Vec<u16>,
}

impl CodeChanges {
    fn of(code: &CodeBits) -> Self {
        let mut all = Self {
            changes: Vec::new(),
            before: Vec::new(),
        };
        let mut last = code[CA_CODE_LENGTH_CHIPS - 1];
        for (chip, bit) in (0..).zip(code) {
            all.before.push(all.changes.len() as u16);
            if *bit != last {
                all.changes.push(2 * chip + u16::from(*bit));
            }
            last = *bit;
        }
        all
    }

    /// Changes at `chips`, in batches from the first on: how many there are, and twice the chip of each, and one more where
    /// the code changes to 1. The last batch goes on beyond them.
    #[inline(always)]
    pub(super) fn within<const BATCH: usize>(
        &self,
        chips: Range<usize>,
    ) -> (&[[u16; BATCH]], usize) {
        let before = |chip: usize| self.before.get(chip).map_or(usize::MAX, |n| (*n).into());
        let (first, end) = (before(chips.start), before(chips.end));
        let (batches, _) = self.changes.get(first..).unwrap_or_default().as_chunks();
        (batches, end.saturating_sub(first))
    }
}

static CA_CODE_CHANGES: LazyLock<Vec<CodeChanges>> =
    LazyLock::new(|| CA_CODE_BITS.iter().map(CodeChanges::of).collect());

/// The changes of the code of `signal`.
pub(super) fn code_changes(signal: SignalId) -> &'static CodeChanges {
    &CA_CODE_CHANGES[usize::from(signal.prn() - signal.spec().first_prn)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_where_a_bit_is_not_the_one_before() {
        for prn in 1..=37 {
            let signal = SignalId::gps_l1_ca(prn).unwrap();
            let (code, changes) = (code_bits(signal), code_changes(signal));
            for (start, end) in [(1, 2), (1, 80), (500, 640), (1023, 1100), (1030, 1180)] {
                let (batches, count) = changes.within::<16>(start..end);
                let found = batches.as_flattened()[..count].iter().copied();
                let expected = (start..end).filter(|chip| code[*chip] != code[*chip - 1]);
                assert!(found.eq(expected.map(|chip| 2 * chip as u16 + u16::from(code[chip]))));
            }
        }
    }
}
