//! Frame synchronisation: where subframes start, by preamble, parity, time and neighbours.
//!
//! A *candidate* is a preamble of either polarity, parity of words 1 and 2, two zeros at the end of
//! word 2, a time that exists, and the subframe number sent at that time. A random bit starts one
//! with probability 2 * 2^-8 * 2^-6 * 2^-6 * 2^-2 * (100800 / 2^17) / 8 = 4.6e-8.
//!
//! It is *confirmed* by the candidate one subframe earlier, if there is one and it counts one less
//! (another 5e-13), or by three different good words among the three before and the three after it
//! (20 choices of three * 64^-3 = 7.6e-5). False sync: 3.5e-12 per bit, 6e-7 per hour of noise.
//! Words all zero or one count nothing and equal words count once: such filling passes parity, or
//! fails it, at any offset alike.
//!
//! Data are no noise: every word of a message passes parity, and so does a candidate among them. A word starts
//! with a preamble, and the next one tells a time, once in some 2e4 words, for as long as the message stays. The
//! neighbours prove nothing then: such a candidate is told from a real one by whether it counts on
//! (`LnavDecoder`).

use super::bit_buffer::BitBuffer;
use super::parity::{Tail, check_word};
use super::subframe::hand_over::{HandOver, PREAMBLE, PREAMBLE_BITS};
use super::{SUBFRAME_BITS, WORD_BITS};

/// Sign of the carrier phase a channel settled on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Polarity {
    /// A zero bit has positive amplitude.
    Normal,
    /// A zero bit has negative amplitude.
    Inverted,
}

impl Polarity {
    /// Polarity of the preamble at bit `start`, if there is one.
    pub(super) fn of_preamble(bits: &BitBuffer, start: i64) -> Option<Self> {
        match bits.run(start, PREAMBLE_BITS)? {
            PREAMBLE => Some(Self::Normal),
            run if run ^ 0xFF == PREAMBLE => Some(Self::Inverted),
            _ => None,
        }
    }

    /// Two zeros as received, which end words 2 and 10.
    pub(super) const fn zeros(self) -> Tail {
        let inverted = matches!(self, Self::Inverted);
        Tail {
            d29: inverted,
            d30: inverted,
        }
    }
}

/// A likely start of a subframe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Candidate {
    /// Number of its first bit.
    pub(super) start: i64,
    /// Its hand-over word.
    pub(super) hand_over: HandOver,
    /// From its preamble.
    pub(super) polarity: Polarity,
    /// Whether the candidate one subframe earlier counts one less.
    pub(super) counts_on: bool,
}

/// Good words needed beside words 1 and 2.
const NEIGHBOURS_NEEDED: usize = 3;

/// Where neighbouring words start, in bits after the first bit of the subframe.
const NEIGHBOURS: [i64; 6] = [-90, -60, -30, 60, 90, 120];

/// Words of a subframe after which it may become confirmed.
const WORDS_AT_CONFIRMATION: std::ops::RangeInclusive<i64> = 2..=5;

/// The confirmed start of a subframe, if the latest bit of `bits` completes the proof of one; the earliest, if of
/// several.
pub(super) fn search(bits: &BitBuffer) -> Option<Candidate> {
    WORDS_AT_CONFIRMATION
        .rev()
        .filter_map(|words| candidate(bits, bits.end() - 30 * words))
        .find(|found| found.counts_on || good_neighbours(bits, found.start) >= NEIGHBOURS_NEEDED)
}

/// The candidate that starts at bit `start`.
pub(super) fn candidate(bits: &BitBuffer, start: i64) -> Option<Candidate> {
    let (hand_over, polarity) = hand_over(bits, start)?;
    let before = hand_over_count(bits, start - SUBFRAME_BITS as i64);
    Some(Candidate {
        start,
        hand_over,
        polarity,
        counts_on: before.is_some_and(|count| {
            HandOver::at(count + 1).subframe_count == hand_over.subframe_count
        }),
    })
}

/// Whether there is another candidate among the words before `found`: either may be data.
pub(super) fn has_rival(bits: &BitBuffer, found: &Candidate) -> bool {
    let words = 1..(SUBFRAME_BITS / WORD_BITS) as i64;
    words
        .map(|words| found.start - words * WORD_BITS as i64)
        .any(|start| hand_over(bits, start).is_some())
}

fn hand_over_count(bits: &BitBuffer, start: i64) -> Option<u32> {
    hand_over(bits, start).map(|(hand_over, _)| hand_over.subframe_count)
}

/// Words 1 and 2 at bit `start`, if they may be that.
fn hand_over(bits: &BitBuffer, start: i64) -> Option<(HandOver, Polarity)> {
    let polarity = Polarity::of_preamble(bits, start)?;
    let telemetry = bits.word(start)?;
    check_word(telemetry, polarity.zeros())?;
    let word = bits.word(start + 30)?;
    let data = check_word(word, Tail::of(telemetry))?;
    let hand_over = HandOver::read(data)?;
    (Tail::of(word) == polarity.zeros()).then_some((hand_over, polarity))
}

fn good_neighbours(bits: &BitBuffer, start: i64) -> usize {
    let good = |at: i64| {
        let word = bits.word(at)?;
        let data = check_word(word, bits.tail_before(at)?)?;
        (word != 0 && word != 0x3FFF_FFFF).then_some(data)
    };
    let mut found: Vec<u32> = NEIGHBOURS
        .iter()
        .filter_map(|offset| good(start + offset))
        .collect();
    found.sort_unstable();
    found.dedup();
    found.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lnav::test_support::random_bits;

    fn buffer(bits: impl IntoIterator<Item = bool>) -> BitBuffer {
        let mut buffer = BitBuffer::default();
        bits.into_iter().for_each(|bit| buffer.push(Some(bit)));
        buffer
    }

    /// Preamble of either polarity and parity of word 1: 2 * 2^-8 * 2^-6 = 2^-13 a bit, hence
    /// 122.1 +- 11 in a million random bits; four sigma allowed.
    #[test]
    fn preamble_and_first_parity_pass_as_often_as_computed() {
        let mut bits = BitBuffer::default();
        let passes = random_bits(1, 1_000_000).into_iter().filter(|&bit| {
            bits.push(Some(bit));
            let start = bits.end() - 30;
            Polarity::of_preamble(&bits, start).is_some_and(|polarity| {
                bits.word(start)
                    .is_some_and(|word| check_word(word, polarity.zeros()).is_some())
            })
        });
        let passes = passes.count();
        assert!((78..=166).contains(&passes), "{passes}");
    }

    /// At 3.5e-12 a bit, a million bits give none with probability 1 - 3.5e-6.
    #[test]
    fn random_bits_give_no_sync() {
        let mut bits = BitBuffer::default();
        for bit in random_bits(2, 1_000_000) {
            bits.push(Some(bit));
            assert_eq!(search(&bits), None);
        }
    }

    #[test]
    fn constant_and_equal_words_prove_nothing() {
        let mut words = crate::lnav::word::DataWords([0; 10]);
        HandOver::at(7).write(&mut words);
        assert_eq!(
            search(&buffer(
                crate::lnav::encode::transmit(&words)[..150].to_vec()
            )),
            None
        );
        for word in &mut words.0[2..] {
            *word = 0xAA_AAAA;
        }
        assert_eq!(
            search(&buffer(
                crate::lnav::encode::transmit(&words)[..150].to_vec()
            )),
            None
        );
        words.0[2..5].copy_from_slice(&[1, 2, 3]);
        let found = search(&buffer(
            crate::lnav::encode::transmit(&words)[..150].to_vec(),
        ));
        assert_eq!(found.map(|found| found.hand_over), Some(HandOver::at(7)));
    }
}
