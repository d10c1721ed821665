//! Which bit was sent when, and whether that still holds.

use super::bit_buffer::BitBuffer;
use super::event::LossReason;
use super::frame_sync::{self, Candidate, Polarity};
use super::reading::Reading;
use super::subframe::hand_over::HandOver;
use super::{SUBFRAME_BITS, SUBFRAMES_PER_WEEK, WORD_BITS};

/// Bits without a hand-over word after which the time is no longer trusted (one minute).
const LONGEST_SILENCE_BITS: i64 = 10 * SUBFRAME_BITS as i64;

/// Which bit was sent when.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timebase {
    /// First bit of a subframe.
    start: i64,
    /// Subframes since the start of the week at that bit.
    subframe_count: u32,
    /// Polarity of the latest preamble.
    pub(super) polarity: Polarity,
    /// First bit of the next subframe to read.
    pub(super) next: i64,
    /// First bit of the latest subframe whose hand-over word agreed.
    confirmed: i64,
    /// Whether two hand-over words at least agree on it.
    repeated: bool,
}

/// What a confirmed start of a subframe is to a timebase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bearing {
    /// It is where and when one is expected.
    Agrees,
    /// It lies among the words of a subframe that is known: data that look like it.
    Data,
    /// It lies among the words of a subframe, and either may be the data.
    Either,
    /// It contradicts.
    Contradicts,
}

impl Timebase {
    /// Counts from `found`; reading starts with the subframe that holds bit `first_bit`.
    pub(super) fn new(found: &Candidate, first_bit: i64) -> Self {
        let length = SUBFRAME_BITS as i64;
        let started_before = (found.start - first_bit + length - 1).div_euclid(length);
        Self {
            start: found.start,
            subframe_count: found.hand_over.subframe_count,
            polarity: found.polarity,
            next: found.start - started_before * length,
            confirmed: found.start,
            repeated: found.counts_on,
        }
    }

    /// The hand-over word, flags aside, of the subframe that starts at bit `start`.
    pub(super) fn hand_over_at(&self, start: i64) -> HandOver {
        let ahead = (start - self.start).div_euclid(SUBFRAME_BITS as i64);
        let count = i64::from(self.subframe_count) + ahead;
        HandOver::at(count.rem_euclid(SUBFRAMES_PER_WEEK.into()) as u32)
    }

    /// What `found`, confirmed in `bits`, is to it.
    pub(super) fn bearing(&mut self, found: &Candidate, bits: &BitBuffer) -> Bearing {
        let offset = (found.start - self.start).rem_euclid(SUBFRAME_BITS as i64);
        if offset == 0 {
            let agrees = self.expects(found);
            self.repeated |= agrees && found.start != self.start;
            return if agrees {
                Bearing::Agrees
            } else {
                Bearing::Contradicts
            };
        }
        if offset % WORD_BITS as i64 != 0 {
            return Bearing::Contradicts;
        }
        let own = frame_sync::candidate(bits, found.start - offset);
        if self.repeated && own.is_some_and(|own| self.expects(&own)) {
            Bearing::Data
        } else {
            Bearing::Either
        }
    }

    fn expects(&self, found: &Candidate) -> bool {
        self.hand_over_at(found.start).subframe_count == found.hand_over.subframe_count
    }

    /// Holds the hand-over word of the subframe that starts at bit `start` against its time.
    ///
    /// # Errors
    /// Why this timebase can no longer be trusted.
    pub(super) fn check(&mut self, start: i64, reading: &Reading) -> Result<(), LossReason> {
        let expected = self.hand_over_at(start).subframe_count;
        let agrees = |found: HandOver| found.subframe_count == expected;
        if reading.hand_over().is_some_and(agrees) {
            self.confirmed = self.confirmed.max(start);
            self.polarity = reading.polarity.unwrap_or(self.polarity);
            return Ok(());
        }
        if reading.words[0].is_some() && reading.words[1].is_some() {
            return Err(LossReason::Contradiction);
        }
        if start - self.confirmed >= LONGEST_SILENCE_BITS {
            return Err(LossReason::Silence);
        }
        Ok(())
    }
}
