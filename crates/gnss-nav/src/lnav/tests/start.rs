//! Sync and ephemeris as early as they can be, from any first bit.

use super::{assert_times, decoder, sample_bits, sync_count};
use crate::GpsTime;
use crate::lnav::test_support::{amplitude, decode, encode, ephemerides_in, sample_ephemeris};
use crate::lnav::{LnavEncoder, LnavEvent, Polarity};

#[test]
fn ephemeris_is_out_with_the_last_bit_of_subframe_3() {
    for skipped in 0..=60 {
        for sign in [1.0, -1.0] {
            let bits = sample_bits(skipped, 900 - skipped);
            let events = decode(&mut decoder(), 13, bits.iter().map(|bit| sign * bit));
            let expected = (899 - skipped, sample_ephemeris());
            assert_eq!(ephemerides_in(&events), [expected], "{skipped} bits late");
            assert_times(&events, skipped, 13);
        }
    }
}

#[test]
fn sync_comes_with_the_third_word_after_words_1_and_2() {
    let events = decode(&mut decoder(), 0, sample_bits(0, 150));
    let sync = LnavEvent::Sync {
        start_code_period: 0,
        tow_s: 0,
        polarity: Polarity::Normal,
    };
    assert_eq!(events, [(149, sync)]);
}

#[test]
fn sync_comes_with_word_2_where_words_before_are_good() {
    let events = decode(
        &mut decoder(),
        0,
        sample_bits(200, 160).iter().map(|bit| -bit),
    );
    let sync = LnavEvent::Sync {
        start_code_period: 2000,
        tow_s: 6,
        polarity: Polarity::Inverted,
    };
    assert_eq!(events[0], (159, sync));
}

#[test]
fn starts_anywhere_in_the_frame() {
    for skipped in (0..1500).step_by(37) {
        let events = decode(&mut decoder(), 5, sample_bits(skipped, 2600));
        assert_times(&events, skipped, 5);
        assert_eq!(sync_count(&events), 1);
        let found = ephemerides_in(&events);
        assert_eq!(found.len(), 1, "{skipped}");
        assert_eq!(found[0].1, sample_ephemeris());
        // Whatever was cut at the start comes again within a frame, and its subframe then ends.
        assert!(found[0].0 < 1500 + 300, "{skipped}: {}", found[0].0);
    }
}

#[test]
fn week_ends_are_crossed() {
    let start = GpsTime::new(2189, 604_788.0);
    let encoder = LnavEncoder::new(&sample_ephemeris()).unwrap();
    let bits = encode(&encoder, start, 2 * 300 + 900);
    let events = decode(&mut decoder(), 0, bits.into_iter().map(amplitude));
    assert_eq!(ephemerides_in(&events), [(1499, sample_ephemeris())]);
    let week = events.iter().find_map(|(_, event)| match event {
        LnavEvent::Week {
            sent,
            start_code_period,
        } => Some((*sent, *start_code_period)),
        _ => None,
    });
    assert_eq!(week, Some((GpsTime::new(2190, 0.0), 2 * 6000)));
    assert!(
        !events
            .iter()
            .any(|(_, event)| matches!(event, LnavEvent::SyncLost { .. }))
    );
}
