//! Words 1 and 2: telemetry and hand-over (IS-GPS-200, 20.3.3.1 and 20.3.3.2).

use crate::lnav::word::{DataWords, Run};
use crate::lnav::{SUBFRAME_S, SUBFRAMES_PER_WEEK};

/// The eight bits every subframe starts with.
pub(in crate::lnav) const PREAMBLE: u32 = 0x8B;

/// Bits in the preamble.
pub(in crate::lnav) const PREAMBLE_BITS: usize = 8;

const PREAMBLE_RUN: Run = (1, 8);
const TOW_COUNT: Run = (31, 17);
const ALERT: Run = (48, 1);
const ANTI_SPOOF: Run = (49, 1);
const SUBFRAME_ID: Run = (50, 3);

/// Hand-over word: when the subframe is sent and which one it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandOver {
    /// Count of subframes since the start of the week at the start of *this* subframe (the word
    /// itself carries that of the next one).
    pub subframe_count: u32,
    /// Subframe 1 to 5.
    pub id: u8,
    /// The signal's range error may exceed what the user range accuracy says.
    pub alert: bool,
    /// Anti-spoofing is on.
    pub anti_spoof: bool,
}

impl HandOver {
    /// The hand-over word of the subframe that starts `subframe_count` subframes into the week,
    /// flags off.
    pub(in crate::lnav) const fn at(subframe_count: u32) -> Self {
        Self {
            subframe_count: subframe_count % SUBFRAMES_PER_WEEK,
            id: (subframe_count % 5) as u8 + 1,
            alert: false,
            anti_spoof: false,
        }
    }

    /// Time of week at the start of this subframe, s.
    #[must_use]
    pub const fn tow_s(self) -> u32 {
        self.subframe_count * SUBFRAME_S
    }

    /// Reads the 24 data bits of word 2. `None` where the time does not exist or the subframe is
    /// not the one sent at that time: frames start every 30 s of the week.
    pub(in crate::lnav) fn read(word: u32) -> Option<Self> {
        let mut words = DataWords::default();
        words.0[1] = word;
        let next = words.bits(TOW_COUNT);
        let this = Self::at((next + SUBFRAMES_PER_WEEK - 1) % SUBFRAMES_PER_WEEK);
        let exists = next < SUBFRAMES_PER_WEEK && words.bits(SUBFRAME_ID) == u32::from(this.id);
        exists.then_some(Self {
            alert: words.bits(ALERT) == 1,
            anti_spoof: words.bits(ANTI_SPOOF) == 1,
            ..this
        })
    }

    /// Writes words 1 and 2, the telemetry message zero.
    pub(in crate::lnav) fn write(self, words: &mut DataWords) {
        words.0[0] = 0;
        words.0[1] = 0;
        words.set_bits(PREAMBLE_RUN, PREAMBLE);
        words.set_bits(TOW_COUNT, (self.subframe_count + 1) % SUBFRAMES_PER_WEEK);
        words.set_bits(ALERT, u32::from(self.alert));
        words.set_bits(ANTI_SPOOF, u32::from(self.anti_spoof));
        words.set_bits(SUBFRAME_ID, u32::from(self.id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comes_back_over_the_whole_week() {
        for count in [0, 1, 4, 5, 90_000, 100_798, 100_799] {
            let hand_over = HandOver {
                alert: count == 1,
                ..HandOver::at(count)
            };
            let mut words = DataWords::default();
            hand_over.write(&mut words);
            assert_eq!(HandOver::read(words.0[1]), Some(hand_over));
            assert_eq!(hand_over.tow_s(), 6 * count);
        }
    }

    #[test]
    fn word_carries_the_time_of_the_next_subframe() {
        let mut words = DataWords::default();
        HandOver::at(90_000).write(&mut words);
        // 540 000 s is a multiple of 30: subframe 1 (001); the next count is 90 001.
        assert_eq!(words.0[1], 90_001 << 7 | 1 << 2);
        HandOver::at(100_799).write(&mut words);
        assert_eq!(words.0[1], 5 << 2);
    }

    #[test]
    fn impossible_words_are_refused() {
        assert_eq!(HandOver::read(100_800 << 7 | 5 << 2), None);
        assert_eq!(HandOver::read(90_001 << 7 | 2 << 2), None);
    }
}
