//! Subframes 1 to 3 put together to an ephemeris, words of repeated frames combined.

use super::SUBFRAME_BITS;
use super::reading::Reading;
use super::subframe::{ephemeris, week};
use super::word::DataWords;
use crate::{Ephemeris, GpsTime, SatelliteId};

/// Bits in two hours. An issue of data number comes back no earlier than six hours later, so that
/// parts this close with equal numbers belong together.
const LONGEST_BITS: i64 = 2 * 3600 * 50;

/// Evidence a word needs: one clean reception, or two equal ones with errors around them.
const ENOUGH: u8 = 2;

/// Failed words up to which a reception is clean.
///
/// A word passes parity wrong only with four wrong bits or more: at a bit error rate of 1 % once in
/// 1e5 words, at 3 % once in 2300. At 3 % six of ten words fail, two or fewer once in 80 subframes.
const CLEAN_FAILURES: u32 = 2;

/// The words collected of one subframe of one issue.
#[derive(Debug, Clone, Copy)]
struct Part {
    issue: u32,
    words: [Option<u32>; 10],
    evidence: [u8; 10],
    start: i64,
    tow_s: u32,
}

impl Part {
    /// What one reception says; `None` without the word that holds the issue of data.
    fn new(id: u8, reading: &Reading, start: i64, tow_s: u32) -> Option<Self> {
        let (run, index) = ephemeris::issue_place(id);
        let mut data = DataWords::default();
        data.0[index] = reading.words[index]?;
        let evidence = if reading.failed <= CLEAN_FAILURES {
            ENOUGH
        } else {
            1
        };
        Some(Self {
            issue: data.bits(run),
            words: reading.words,
            evidence: reading
                .words
                .map(|word| if word.is_some() { evidence } else { 0 }),
            start,
            tow_s,
        })
    }

    /// This reception with the words of `earlier` ones, if they are of the same content.
    fn merged(mut self, earlier: &Self) -> Self {
        let same = |index: usize| match (self.words[index], earlier.words[index]) {
            (Some(new), Some(old)) => new == old,
            _ => true,
        };
        // A new week number must not be read with the old time, nor the old one with the new time.
        let same_week = self.tow_s >= earlier.tow_s;
        let recent = self.start - earlier.start < LONGEST_BITS;
        if self.issue == earlier.issue && same_week && recent && (2..10).all(same) {
            for index in 2..10 {
                self.words[index] = self.words[index].or(earlier.words[index]);
                self.evidence[index] = self.evidence[index].saturating_add(earlier.evidence[index]);
            }
        }
        self
    }

    /// Words 3 to 10 where all have enough evidence.
    fn complete(&self) -> Option<DataWords> {
        let mut data = DataWords::default();
        for index in 2..10 {
            data.0[index] = self.settled(index)?;
        }
        Some(data)
    }

    fn settled(&self, index: usize) -> Option<u32> {
        self.words[index].filter(|_| self.evidence[index] >= ENOUGH)
    }
}

/// The collected parts of an ephemeris.
#[derive(Debug, Clone, Default)]
pub(super) struct Assembly {
    parts: [Option<Part>; 3],
    last: Option<Ephemeris>,
}

impl Assembly {
    /// Adds a reception of subframe `id` (1 to 3) that started at bit `start`, `tow_s` into the
    /// week.
    pub(super) fn add(&mut self, id: u8, reading: &Reading, start: i64, tow_s: u32) {
        let Some(part) = Part::new(id, reading, start, tow_s) else {
            return;
        };
        let slot = &mut self.parts[usize::from(id) - 1];
        *slot = Some(slot.as_ref().map_or(part, |earlier| part.merged(earlier)));
    }

    /// When the latest subframe 1 was sent, its week unrolled around `pivot_week`.
    pub(super) fn sent(&self, pivot_week: i32) -> Option<GpsTime> {
        let part = self.parts[0]?;
        let mut data = DataWords::default();
        data.0[2] = part.settled(2)?;
        let week = week::unroll_week(ephemeris::week_number(&data), 10, pivot_week);
        Some(GpsTime::from_parts(week, part.tow_s.into(), 0.0))
    }

    /// The ephemeris of `satellite`, where it is complete and not the last one returned.
    ///
    /// A complete set that no satellite flies holds bit errors: its parts are dropped.
    pub(super) fn ephemeris(
        &mut self,
        satellite: SatelliteId,
        pivot_week: i32,
    ) -> Option<Ephemeris> {
        let [one, two, three] = self.parts.map(|part| part?.complete());
        let parts = [one?, two?, three?];
        if !self.are_of_one_issue() {
            return None;
        }
        let Ok(ephemeris) = ephemeris::read(satellite, &parts, self.sent(pivot_week)?) else {
            self.parts = [None; 3];
            return None;
        };
        let is_new = self.last.replace(ephemeris) != Some(ephemeris);
        is_new.then_some(ephemeris)
    }

    fn are_of_one_issue(&self) -> bool {
        let starts = || self.parts.iter().flatten().map(|part| part.start);
        let span = starts().max().unwrap_or(0) - starts().min().unwrap_or(0);
        let mut issues = self.parts.iter().flatten().map(|part| part.issue);
        let first = issues.next();
        issues.all(|issue| Some(issue) == first) && span < LONGEST_BITS - SUBFRAME_BITS as i64
    }
}
