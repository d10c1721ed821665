//! What goes into the decoder and what comes out.

use super::frame_sync::Polarity;
use super::subframe::almanac::Almanac;
use super::subframe::hand_over::HandOver;
use super::subframe::health::{Configuration, HealthReference};
use super::subframe::ionosphere_utc::IonosphereUtc;
use crate::{Ephemeris, GpsTime};

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
