//! LNAV, the legacy navigation message on GPS L1 C/A: decoder and encoder (IS-GPS-200, 20.3).

pub mod parity;

mod assembly;
mod bit_buffer;
mod decode;
mod encode;
mod event;
mod field;
mod frame_sync;
mod reading;
#[cfg(test)]
mod real_data_tests;
mod subframe;
#[cfg(test)]
mod test_support;
#[cfg(test)]
mod tests;
mod timebase;
mod word;

pub use decode::LnavDecoder;
pub use encode::{LnavEncoder, quantise};
pub use event::{LnavEvent, LossReason, NavBit};
pub use frame_sync::Polarity;
pub use subframe::almanac::Almanac;
pub use subframe::hand_over::HandOver;
pub use subframe::health::{Configuration, HealthReference};
pub use subframe::ionosphere_utc::{IonosphereUtc, UtcParameters};
pub use subframe::week::{DEFAULT_PIVOT_WEEK, nearest_time, unroll_week};

/// Code periods (1 ms each) in a navigation bit.
pub const CODE_PERIODS_PER_BIT: u64 = 20;

/// Bits in a word.
pub const WORD_BITS: usize = 30;

/// Bits in a subframe, which lasts 6 s.
pub const SUBFRAME_BITS: usize = 300;

/// Seconds a subframe lasts.
pub const SUBFRAME_S: u32 = 6;

/// Subframes in a week: the modulus of the TOW count in the hand-over word.
pub(crate) const SUBFRAMES_PER_WEEK: u32 = 100_800;
