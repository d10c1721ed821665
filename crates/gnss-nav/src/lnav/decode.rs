//! The LNAV decoder of one channel: navigation bits in, time, ephemeris and almanac out.

use super::assembly::Assembly;
use super::bit_buffer::BitBuffer;
use super::frame_sync::{self, Candidate, Polarity};
use super::reading::Reading;
use super::subframe::almanac::Almanac;
use super::subframe::hand_over::HandOver;
use super::subframe::health::{Configuration, HealthReference};
use super::subframe::ionosphere_utc::IonosphereUtc;
use super::subframe::page::Page;
use super::{CODE_PERIODS_PER_BIT, SUBFRAME_BITS, SUBFRAMES_PER_WEEK};
use crate::{Ephemeris, GpsTime, SatelliteId};

/// A navigation bit as tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavBit {
    /// Amplitude; its sign is the bit up to the unknown polarity of the channel. Zero and NaN mark
    /// an erased bit.
    pub soft: f32,
    /// Code period, counted from the start of the channel, with which the bit begins.
    pub code_period: u64,
}

/// Why frame synchronisation was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LossReason {
    /// Bit boundaries moved, code periods ran backwards, or more than 30 s are missing.
    Discontinuity,
    /// Words 1 and 2 passed parity and tell another time.
    Contradiction,
    /// No hand-over word passed for a minute.
    Silence,
}

/// What the decoder found out.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LnavEvent {
    /// Transmit time is known: the signal of code period `start_code_period + n` left the
    /// satellite at `tow_s + n * 1 ms`.
    Sync {
        /// Code period with which the subframe begins.
        start_code_period: i64,
        /// Time of week at the start of the subframe, s.
        tow_s: u32,
        /// Polarity of the channel.
        polarity: Polarity,
    },
    /// A subframe ended; also those received before sync, oldest first.
    Subframe {
        /// Subframe 1 to 5.
        id: u8,
        /// Time of week at its start, s.
        tow_s: u32,
        /// Code period with which it begins; negative where that was before the channel.
        start_code_period: i64,
        /// Words that passed parity, word 1 in the least significant of ten bits.
        words_valid: u16,
        /// Polarity of its preamble, where word 1 passed.
        polarity: Option<Polarity>,
        /// Its hand-over word, where that passed.
        hand_over: Option<HandOver>,
    },
    /// The week is known.
    Week {
        /// When the latest subframe 1 started, in GPS time of transmission.
        sent: GpsTime,
        /// Code period with which it begins.
        start_code_period: i64,
    },
    /// A complete ephemeris, once for every new content.
    Ephemeris(Ephemeris),
    /// Page 18 of subframe 4.
    IonosphereUtc(IonosphereUtc),
    /// An almanac page.
    Almanac(Almanac),
    /// Page 25 of subframe 5.
    HealthReference(HealthReference),
    /// Page 25 of subframe 4.
    Configuration(Configuration),
    /// Transmit time is no longer known.
    SyncLost {
        /// Why.
        reason: LossReason,
    },
}

/// Erased bits up to which a gap is bridged: the rest of the buffer keeps a started subframe.
const LONGEST_GAP_BITS: i64 = (BitBuffer::CAPACITY - SUBFRAME_BITS) as i64;

/// Bits without a hand-over word after which the time is no longer trusted (one minute).
const LONGEST_SILENCE_BITS: i64 = 10 * SUBFRAME_BITS as i64;

/// Which bit was sent when.
#[derive(Debug, Clone, Copy)]
struct Timebase {
    /// First bit of a subframe.
    start: i64,
    /// Subframes since the start of the week at that bit.
    subframe_count: u32,
    polarity: Polarity,
    /// First bit of the next subframe to read.
    next: i64,
    /// First bit of the latest subframe whose hand-over word agreed.
    confirmed: i64,
}

impl Timebase {
    fn new(found: &Candidate, first_bit: i64) -> Self {
        let length = SUBFRAME_BITS as i64;
        let started_before = (found.start - first_bit + length - 1).div_euclid(length);
        Self {
            start: found.start,
            subframe_count: found.hand_over.subframe_count,
            polarity: found.polarity,
            next: found.start - started_before * length,
            confirmed: found.start,
        }
    }

    /// The hand-over word, flags aside, of the subframe that starts at bit `start`.
    fn hand_over_at(&self, start: i64) -> HandOver {
        let ahead = (start - self.start).div_euclid(SUBFRAME_BITS as i64);
        let count = i64::from(self.subframe_count) + ahead;
        HandOver::at(count.rem_euclid(SUBFRAMES_PER_WEEK.into()) as u32)
    }

    fn agrees_with(&self, found: &Candidate) -> bool {
        let offset = (found.start - self.start).rem_euclid(SUBFRAME_BITS as i64);
        let expected = self.hand_over_at(found.start);
        offset == 0 && expected.subframe_count == found.hand_over.subframe_count
    }
}

/// LNAV decoder of one channel.
///
/// Subframes are decoded backwards as soon as the frame is known: the last 36 s of bits are kept.
#[derive(Debug, Clone)]
pub struct LnavDecoder {
    satellite: SatelliteId,
    pivot_week: i32,
    bits: BitBuffer,
    /// Code period of every bit, modulo a bit.
    phase: Option<u64>,
    timebase: Option<Timebase>,
    assembly: Assembly,
}

impl LnavDecoder {
    /// A decoder for `satellite`; week numbers are unrolled around `pivot_week`
    /// ([`DEFAULT_PIVOT_WEEK`] where nothing better is known).
    ///
    /// [`DEFAULT_PIVOT_WEEK`]: super::DEFAULT_PIVOT_WEEK
    #[must_use]
    pub fn new(satellite: SatelliteId, pivot_week: i32) -> Self {
        Self {
            satellite,
            pivot_week,
            bits: BitBuffer::default(),
            phase: None,
            timebase: None,
            assembly: Assembly::default(),
        }
    }

    /// Whether the transmit time is known.
    #[must_use]
    pub const fn is_synchronised(&self) -> bool {
        self.timebase.is_some()
    }

    /// Takes the next bit and returns what it completes.
    ///
    /// Bits come every 20 code periods; a step by more multiples of 20 erases the bits between.
    #[must_use = "events are reported once"]
    pub fn push(&mut self, bit: NavBit) -> Vec<LnavEvent> {
        let mut events = Vec::new();
        self.make_room(bit.code_period, &mut events);
        let known = bit.soft != 0.0 && !bit.soft.is_nan();
        self.bits.push(known.then_some(bit.soft < 0.0));
        self.synchronise(&mut events);
        while self.read_next_subframe(&mut events) {}
        events
    }

    /// Brings the buffer to the place of a bit that begins with `code_period`.
    fn make_room(&mut self, code_period: u64, events: &mut Vec<LnavEvent>) {
        let number = (code_period / CODE_PERIODS_PER_BIT) as i64;
        let phase = Some(code_period % CODE_PERIODS_PER_BIT);
        let missing = number - self.bits.end();
        if phase == self.phase && (0..=LONGEST_GAP_BITS).contains(&missing) {
            (0..missing).for_each(|_| self.bits.push(None));
            return;
        }
        self.lose(LossReason::Discontinuity, events);
        self.bits.restart(number);
        self.phase = phase;
    }

    fn synchronise(&mut self, events: &mut Vec<LnavEvent>) {
        let Some(found) = frame_sync::search(&self.bits) else {
            return;
        };
        if let Some(timebase) = self.timebase {
            if timebase.agrees_with(&found) {
                return;
            }
            self.lose(LossReason::Contradiction, events);
            self.bits.forget_before(timebase.next.min(found.start));
        }
        self.timebase = Some(Timebase::new(&found, self.bits.first()));
        events.push(LnavEvent::Sync {
            start_code_period: self.code_period(found.start),
            tow_s: found.hand_over.tow_s(),
            polarity: found.polarity,
        });
    }

    /// Reads the next subframe, if its last bit is there.
    fn read_next_subframe(&mut self, events: &mut Vec<LnavEvent>) -> bool {
        let Some(timebase) = &mut self.timebase else {
            return false;
        };
        let start = timebase.next;
        if self.bits.end() < start + SUBFRAME_BITS as i64 {
            return false;
        }
        timebase.next += SUBFRAME_BITS as i64;
        let expected = timebase.hand_over_at(start);
        let reading = Reading::of(&self.bits, start, timebase.polarity);
        match check_time(timebase, start, &reading) {
            Ok(()) => self.report(start, expected, &reading, events),
            Err(reason) => {
                self.lose(reason, events);
                self.bits.forget_before(start);
            }
        }
        true
    }

    fn report(
        &mut self,
        start: i64,
        expected: HandOver,
        reading: &Reading,
        events: &mut Vec<LnavEvent>,
    ) {
        if reading.passed() == 0 {
            return;
        }
        let start_code_period = self.code_period(start);
        events.push(LnavEvent::Subframe {
            id: expected.id,
            tow_s: expected.tow_s(),
            start_code_period,
            words_valid: reading.passed(),
            polarity: reading.polarity,
            hand_over: reading.hand_over(),
        });
        if expected.id > 3 {
            events.extend(read_page(expected.id, reading));
            return;
        }
        let sent_before = self.assembly.sent(self.pivot_week);
        self.assembly
            .add(expected.id, reading, start, expected.tow_s());
        let sent = self.assembly.sent(self.pivot_week);
        if let Some(sent) = sent.filter(|_| sent != sent_before) {
            events.push(LnavEvent::Week {
                sent,
                start_code_period,
            });
        }
        let ephemeris = self.assembly.ephemeris(self.satellite, self.pivot_week);
        events.extend(ephemeris.map(LnavEvent::Ephemeris));
    }

    fn lose(&mut self, reason: LossReason, events: &mut Vec<LnavEvent>) {
        if self.timebase.take().is_some() {
            events.push(LnavEvent::SyncLost { reason });
        }
    }

    /// Code period with which the bit of that number begins.
    fn code_period(&self, number: i64) -> i64 {
        number
            .saturating_mul(CODE_PERIODS_PER_BIT as i64)
            .saturating_add(self.phase.unwrap_or(0) as i64)
    }
}

/// Holds the hand-over word of a subframe against the time expected.
fn check_time(timebase: &mut Timebase, start: i64, reading: &Reading) -> Result<(), LossReason> {
    let expected = timebase.hand_over_at(start).subframe_count;
    let agrees = |found: HandOver| found.subframe_count == expected;
    if reading.hand_over().is_some_and(agrees) {
        timebase.confirmed = timebase.confirmed.max(start);
        timebase.polarity = reading.polarity.unwrap_or(timebase.polarity);
        return Ok(());
    }
    if reading.words[0].is_some() && reading.words[1].is_some() {
        return Err(LossReason::Contradiction);
    }
    if start - timebase.confirmed >= LONGEST_SILENCE_BITS {
        return Err(LossReason::Silence);
    }
    Ok(())
}

fn read_page(id: u8, reading: &Reading) -> Option<LnavEvent> {
    Some(match Page::read(id, &reading.complete()?)? {
        Page::Almanac(almanac) => LnavEvent::Almanac(almanac),
        Page::IonosphereUtc(parameters) => LnavEvent::IonosphereUtc(parameters),
        Page::HealthReference(reference) => LnavEvent::HealthReference(reference),
        Page::Configuration(configuration) => LnavEvent::Configuration(configuration),
    })
}
