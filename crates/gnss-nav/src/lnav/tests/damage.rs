//! Bit errors, slips, gaps, erasures.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{assert_times, decoder, sample_bits, sync_count};
use crate::Ephemeris;
use crate::lnav::test_support::{
    amplitude, decode, encode, ephemerides_in, sample_ephemeris, sample_start,
};
use crate::lnav::{LnavEncoder, LnavEvent, Polarity};

#[test]
fn words_of_two_frames_are_combined() {
    let mut bits = sample_bits(0, 3000);
    bits[130] *= -1.0;
    bits[1500 + 250] *= -1.0;
    let found = ephemerides_in(&decode(&mut decoder(), 0, bits));
    assert_eq!(found, [(1799, sample_ephemeris())]);
}

#[test]
fn words_of_two_issues_are_not_combined() {
    let old = sample_ephemeris();
    let new = Ephemeris {
        iodc: 0x25B,
        iode: 0x5B,
        af0_s: 0.0,
        crs_m: 0.0,
        ..old
    };
    let first = encode(&LnavEncoder::new(&old).unwrap(), sample_start(), 1500);
    let then = encode(
        &LnavEncoder::new(&new).unwrap(),
        sample_start() + 30.0,
        1500,
    );
    let mut bits: Vec<f32> = first.into_iter().chain(then).map(amplitude).collect();
    bits[130] *= -1.0;
    assert_eq!(
        ephemerides_in(&decode(&mut decoder(), 0, bits.clone())),
        [(2399, new)]
    );
    bits[130] *= -1.0;
    let found = ephemerides_in(&decode(&mut decoder(), 0, bits));
    assert_eq!(found, [(899, old), (2399, new)]);
}

#[test]
fn a_slip_costs_one_word() {
    for slip in 300..600 {
        let mut bits = sample_bits(0, 1500);
        bits[slip..].iter_mut().for_each(|bit| *bit *= -1.0);
        let events = decode(&mut decoder(), 0, bits);
        assert_eq!(sync_count(&events), 1);
        let valid = events.iter().find_map(|(_, event)| match event {
            LnavEvent::Subframe {
                id: 2, words_valid, ..
            } => Some(*words_valid),
            _ => None,
        });
        let lost = 10 - valid.unwrap().count_ones();
        // Between D29 and D30 of a word it spoils the parity of the next one too.
        let most = if slip % 30 == 29 { 2 } else { 1 };
        assert!(lost <= most, "slip at bit {slip} cost {lost} words");
        let polarity = |wanted| {
            events.iter().find_map(|(_, event)| match event {
                LnavEvent::Subframe { id, polarity, .. } if *id == wanted => *polarity,
                _ => None,
            })
        };
        assert_eq!(polarity(1), Some(Polarity::Normal));
        assert_eq!(polarity(3), Some(Polarity::Inverted));
    }
}

#[test]
fn missing_bits_are_bridged_and_time_stays_right() {
    let bits = sample_bits(0, 3000);
    let mut decoder = decoder();
    let mut events = decode(&mut decoder, 7, bits[..700].iter().copied());
    let later = decode(&mut decoder, 7 + 20 * 1000, bits[1000..].iter().copied());
    assert_times(&later, 0, 7);
    assert!(
        !later
            .iter()
            .any(|(_, event)| matches!(event, LnavEvent::SyncLost { .. }))
    );
    // Subframe 3 was cut; it comes again.
    events.extend(
        later
            .into_iter()
            .map(|(index, event)| (index + 1000, event)),
    );
    assert_eq!(ephemerides_in(&events), [(2399, sample_ephemeris())]);
}

#[test]
fn erased_bits_count_as_missing() {
    let mut bits = sample_bits(0, 2400);
    bits[700] = 0.0;
    bits[730] = f32::NAN;
    let events = decode(&mut decoder(), 0, bits);
    assert_eq!(ephemerides_in(&events), [(2399, sample_ephemeris())]);
}

/// What came out wrong of `runs` minutes at a bit error rate, and how many runs gave an ephemeris.
fn noisy_runs(runs: u64, error_rate: f64) -> (usize, usize) {
    let bits = sample_bits(0, 6000);
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut wrong = 0;
    let mut decoded = 0;
    for _ in 0..runs {
        let noisy = bits.iter().map(|&bit| {
            if random.random_bool(error_rate) {
                -bit
            } else {
                bit
            }
        });
        let events = decode(&mut decoder(), 0, noisy);
        assert_times(&events, 0, 0);
        let found = ephemerides_in(&events);
        wrong += found
            .iter()
            .filter(|(_, found)| *found != sample_ephemeris())
            .count();
        decoded += usize::from(!found.is_empty());
    }
    (wrong, decoded)
}

#[test]
fn bit_errors_give_no_wrong_ephemeris() {
    // 0.5 % (22 dB-Hz): a word fails with 14 %, and with it, if it holds the issue of data, its
    // subframe; measured: 172 of 200 within two minutes. Three sigma of that are 15.
    let (wrong, decoded) = noisy_runs(200, 0.005);
    assert_eq!(wrong, 0);
    assert!(decoded >= 157, "{decoded}");
    let (wrong, _) = noisy_runs(200, 0.03);
    assert_eq!(wrong, 0);
}
