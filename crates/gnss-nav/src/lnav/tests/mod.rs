//! Decoder against encoder.

mod content;
mod damage;
mod loss;
mod start;

use super::test_support::{amplitude, encode, sample_ephemeris, sample_start};
use super::{DEFAULT_PIVOT_WEEK, LnavDecoder, LnavEncoder, LnavEvent};
use crate::SatelliteId;

fn decoder() -> LnavDecoder {
    LnavDecoder::new(SatelliteId::gps(7), DEFAULT_PIVOT_WEEK)
}

/// Soft bits of the sample ephemeris, `skipped` bits into subframe 1.
fn sample_bits(skipped: usize, count: usize) -> Vec<f32> {
    let encoder = LnavEncoder::new(&sample_ephemeris()).unwrap();
    let bits = encode(&encoder, sample_start(), skipped + count);
    bits[skipped..].iter().copied().map(amplitude).collect()
}

/// Holds every time the decoder told against the truth: bit `skipped` of the week at `first`.
fn assert_times(events: &[(usize, LnavEvent)], skipped: usize, first: u64) {
    for (_, event) in events {
        let (tow_s, code_period) = match *event {
            LnavEvent::Sync {
                tow_s,
                start_code_period,
                ..
            }
            | LnavEvent::Subframe {
                tow_s,
                start_code_period,
                ..
            } => (tow_s, start_code_period),
            LnavEvent::Week {
                sent,
                start_code_period,
            } => {
                assert_eq!(sent.week(), sample_start().week());
                (sent.second() as u32, start_code_period)
            }
            _ => continue,
        };
        let truth_ms = code_period - first as i64 + 20 * skipped as i64;
        assert_eq!(i64::from(tow_s) * 1000, truth_ms);
    }
}

fn sync_count(events: &[(usize, LnavEvent)]) -> usize {
    events
        .iter()
        .filter(|(_, event)| matches!(event, LnavEvent::Sync { .. }))
        .count()
}
