//! Sync given up when the time is no longer sure.

use super::{assert_times, decoder, sample_bits, sync_count};
use crate::lnav::test_support::{
    amplitude, decode, encode, ephemerides_in, random_bits, sample_ephemeris, sample_start,
};
use crate::lnav::{LnavEncoder, LnavEvent, LossReason, NavBit, Polarity};

#[test]
fn moved_bit_boundaries_and_long_gaps_lose_sync() {
    for jump in [21, 19, 0, 20 * 1600] {
        let bits = sample_bits(0, 900);
        let mut decoder = decoder();
        let _ = decode(&mut decoder, 0, bits[..400].iter().copied());
        assert!(decoder.is_synchronised());
        let code_period = 399 * 20 + jump;
        let events = decoder.push(NavBit {
            soft: 1.0,
            code_period,
        });
        let reason = LossReason::Discontinuity;
        assert_eq!(events, [LnavEvent::SyncLost { reason }], "{jump}");
        // The same decoder starts again.
        let again = decode(&mut decoder, 1_000_003, bits);
        assert_times(&again, 0, 1_000_003);
        assert_eq!(ephemerides_in(&again).len(), 1);
    }
}

#[test]
fn another_time_at_the_same_place_loses_sync() {
    let encoder = LnavEncoder::new(&sample_ephemeris()).unwrap();
    let mut bits = encode(&encoder, sample_start(), 900);
    bits.extend(encode(&encoder, sample_start() + 60.0, 1500));
    let events = decode(&mut decoder(), 0, bits.into_iter().map(amplitude));
    let lost = events.iter().position(|(_, event)| {
        *event
            == LnavEvent::SyncLost {
                reason: LossReason::Contradiction,
            }
    });
    let sync_again = LnavEvent::Sync {
        start_code_period: 900 * 20,
        tow_s: 60,
        polarity: Polarity::Normal,
    };
    let lost = lost.unwrap();
    assert_eq!(events[lost].0, 900 + 59);
    assert_eq!(events[lost + 1].1, sync_again);
    let told = |tow: u32| {
        events[lost..]
            .iter()
            .any(|(_, event)| matches!(event, LnavEvent::Subframe { tow_s, .. } if *tow_s == tow))
    };
    assert!(told(60) && !told(18));
}

#[test]
fn bits_slipped_unnoticed_are_noticed() {
    let mut bits = sample_bits(0, 3000);
    bits.remove(1000);
    let events = decode(&mut decoder(), 0, bits);
    let lost = events
        .iter()
        .position(|(_, event)| matches!(event, LnavEvent::SyncLost { .. }));
    assert!(events[lost.unwrap()].0 <= 1200 + 150);
    assert_eq!(sync_count(&events), 2);
    assert_times(&events[..lost.unwrap()], 0, 0);
    assert_times(&events[lost.unwrap()..], 1, 0);
}

#[test]
fn noise_ends_sync_after_a_minute() {
    let noise = random_bits(5, 6000).into_iter().map(amplitude);
    let bits = sample_bits(0, 900).into_iter().chain(noise);
    let events = decode(&mut decoder(), 0, bits);
    let lost = events
        .iter()
        .find(|(_, event)| matches!(event, LnavEvent::SyncLost { .. }));
    let reason = LossReason::Silence;
    // The last hand-over word came with the subframe at bit 600.
    assert_eq!(
        lost,
        Some(&(600 + 11 * 300 - 1, LnavEvent::SyncLost { reason }))
    );
}
