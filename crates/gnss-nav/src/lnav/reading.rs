//! One subframe as received: which of its words passed parity.

use super::WORD_BITS;
use super::bit_buffer::BitBuffer;
use super::frame_sync::Polarity;
use super::parity::{Tail, check_word};
use super::subframe::hand_over::{HandOver, PREAMBLE};
use super::word::DataWords;

/// The words of a received subframe.
///
/// Parity is checked against the last two bits of the word before *as received*, so polarity
/// cancels out and a half-cycle slip costs the one word it falls into or just in front of (two where
/// it falls between D29 and D30). That word is not rescued by trying the other polarity: it would pass more often by chance
/// (29/30 * 1/64) than because the slip fell exactly between two words (1/30 against 1/64).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reading {
    /// Data of the words that passed.
    pub(super) words: [Option<u32>; 10],
    /// Words received without a gap that did not pass.
    pub(super) failed: u32,
    /// From the preamble, where word 1 passed.
    pub(super) polarity: Option<Polarity>,
}

impl Reading {
    /// Reads the subframe that starts at bit `start`; `usual` polarity stands in where the end of
    /// word 2 is missing.
    pub(super) fn of(bits: &BitBuffer, start: i64, usual: Polarity) -> Self {
        let preamble = Polarity::of_preamble(bits, start);
        let mut reading = Self {
            words: [None; 10],
            failed: 0,
            polarity: None,
        };
        for index in 0..10 {
            let at = start + (index * WORD_BITS) as i64;
            let before = match index {
                0 => preamble.map(Polarity::zeros),
                2 => bits
                    .tail_before(at)
                    .or_else(|| Some(preamble.unwrap_or(usual).zeros())),
                _ => bits.tail_before(at),
            };
            if let Some(word) = bits.word(at) {
                reading.words[index] = before.and_then(|before| read_word(index, word, before));
                reading.failed += u32::from(reading.words[index].is_none());
            }
        }
        reading.polarity = preamble.filter(|_| reading.words[0].is_some());
        reading
    }

    /// Words that passed, word 1 in the least significant bit.
    pub(super) fn passed(&self) -> u16 {
        (0..10).fold(0, |mask, index| {
            mask | u16::from(self.words[index].is_some()) << index
        })
    }

    /// The hand-over word, where it passed and makes sense.
    pub(super) fn hand_over(&self) -> Option<HandOver> {
        HandOver::read(self.words[1]?)
    }

    /// Words 3 to 10, where no word failed or is missing (words 1 and 2 may be missing).
    pub(super) fn complete(&self) -> Option<DataWords> {
        let mut data = DataWords::default();
        for index in 2..10 {
            data.0[index] = self.words[index]?;
        }
        (self.failed == 0).then_some(data)
    }
}

/// The data of the word with that index, which must have its fixed bits beside its parity.
fn read_word(index: usize, word: u32, before: Tail) -> Option<u32> {
    let data = check_word(word, before)?;
    let tail = Tail::of(word);
    let fixed = match index {
        0 => data >> 16 == PREAMBLE,
        1 | 9 => tail.d29 == tail.d30,
        _ => true,
    };
    fixed.then_some(data)
}
