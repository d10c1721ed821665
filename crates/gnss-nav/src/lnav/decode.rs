//! The LNAV decoder of one channel: navigation bits in, time, ephemeris and almanac out.

use super::assembly::Assembly;
use super::bit_buffer::BitBuffer;
use super::event::{LnavEvent, LossReason, NavBit};
use super::frame_sync;
use super::reading::Reading;
use super::subframe::hand_over::HandOver;
use super::subframe::page::Page;
use super::timebase::{Bearing, Timebase};
use super::{CODE_PERIODS_PER_BIT, SUBFRAME_BITS};
use crate::SatelliteId;

/// Erased bits up to which a gap is bridged: the rest of the buffer keeps a started subframe.
const LONGEST_GAP_BITS: i64 = (BitBuffer::CAPACITY - SUBFRAME_BITS) as i64;

/// Bit of the hand-over word in `words_valid`.
const HAND_OVER_MASK: u16 = 1 << 1;

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
    /// Whether two starts of subframes contradict one another: then the next one has to count on.
    is_doubtful: bool,
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
            is_doubtful: false,
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
        self.is_doubtful = false;
        self.bits.restart(number);
        self.phase = phase;
    }

    fn synchronise(&mut self, events: &mut Vec<LnavEvent>) {
        let Some(found) = frame_sync::search(&self.bits) else {
            return;
        };
        if let Some(timebase) = &mut self.timebase {
            let bearing = timebase.bearing(&found, &self.bits);
            if matches!(bearing, Bearing::Agrees | Bearing::Data) {
                return;
            }
            let unread = timebase.next;
            self.lose(LossReason::Contradiction, events);
            self.bits.forget_before(unread.min(found.start));
            self.is_doubtful = bearing == Bearing::Either;
        }
        let is_open = self.is_doubtful || frame_sync::has_rival(&self.bits, &found);
        if is_open && !found.counts_on {
            return;
        }
        self.is_doubtful = false;
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
        match timebase.check(start, &reading) {
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
        let is_expected = |found: &HandOver| found.subframe_count == expected.subframe_count;
        let hand_over = reading.hand_over().filter(is_expected);
        // A hand-over word of another time passed by chance.
        let refused = if hand_over.is_none() {
            HAND_OVER_MASK
        } else {
            0
        };
        events.push(LnavEvent::Subframe {
            id: expected.id,
            tow_s: expected.tow_s(),
            start_code_period,
            words_valid: reading.passed() & !refused,
            polarity: reading.polarity,
            hand_over,
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

fn read_page(id: u8, reading: &Reading) -> Option<LnavEvent> {
    Some(match Page::read(id, &reading.complete()?)? {
        Page::Almanac(almanac) => LnavEvent::Almanac(almanac),
        Page::IonosphereUtc(parameters) => LnavEvent::IonosphereUtc(parameters),
        Page::HealthReference(reference) => LnavEvent::HealthReference(reference),
        Page::Configuration(configuration) => LnavEvent::Configuration(configuration),
    })
}
