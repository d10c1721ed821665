//! What the encoder sends is what the decoder tells.

use proptest::prelude::*;

use super::{assert_times, decoder};
use crate::lnav::test_support::{
    amplitude, decode, encode, ephemerides, ephemerides_in, sample_ephemeris, sample_start,
};
use crate::lnav::{
    Almanac, Configuration, HealthReference, IonosphereUtc, LnavEncoder, LnavEvent, NavBit,
    UtcParameters, nearest_time, quantise,
};
use crate::{Ephemeris, GpsTime, Klobuchar, NavError, SatelliteId};

#[test]
fn pages_come_with_their_time() {
    let ionosphere_utc = IonosphereUtc {
        klobuchar: Klobuchar {
            alpha: [12.0, 16.0, -64.0, -128.0].map(|a| a * 2_f64.powi(-30)),
            beta: [96_256.0, 131_072.0, -65_536.0, -589_824.0],
        },
        utc: UtcParameters {
            a0_s: -2_f64.powi(-30) * 7.0,
            a1: 2_f64.powi(-50) * -3.0,
            tot_s: 61_440,
            wnt: 142,
            delta_tls_s: 18,
            wn_lsf: 137,
            dn: 7,
            delta_tlsf_s: -18,
        },
    };
    let almanac = |prn| {
        Almanac {
            satellite: SatelliteId::gps(prn),
            health: 0,
            toa_s: 61_440,
            eccentricity: 0.01,
            delta_i_rad: -0.01,
            omega_dot_rad_s: -8e-9,
            sqrt_a: 5153.6,
            omega0_rad: f64::from(prn) / 10.0,
            omega_rad: -1.0,
            m0_rad: 2.0,
            af0_s: 1e-5,
            af1: -1e-11,
        }
        .quantise()
        .unwrap()
    };
    let reference = HealthReference {
        toa_s: 61_440,
        wna: 142,
        health: [63; 24],
    };
    let configuration = Configuration {
        configuration: [9; 32],
        health: [0; 8],
    };
    let mut encoder = LnavEncoder::new(&sample_ephemeris())
        .unwrap()
        .with_ionosphere_utc(&ionosphere_utc)
        .unwrap()
        .with_health_reference(&reference)
        .unwrap()
        .with_configuration(&configuration)
        .unwrap();
    for prn in 1..=31 {
        encoder = encoder.with_almanac(&almanac(prn)).unwrap();
    }
    let bits = encode(&encoder, sample_start(), 25 * 1500);
    let events = decode(&mut decoder(), 0, bits.into_iter().map(amplitude));
    let at = |wanted: LnavEvent| {
        events
            .iter()
            .find(|(_, event)| *event == wanted)
            .map(|e| e.0)
    };
    assert_eq!(
        at(LnavEvent::IonosphereUtc(ionosphere_utc)),
        Some(17 * 1500 + 1199)
    );
    assert_eq!(
        at(LnavEvent::Configuration(configuration)),
        Some(24 * 1500 + 1199)
    );
    assert_eq!(
        at(LnavEvent::HealthReference(reference)),
        Some(24 * 1500 + 1499)
    );
    assert_eq!(at(LnavEvent::Almanac(almanac(25))), Some(1500 + 1199));
    let almanacs = events
        .iter()
        .filter(|(_, event)| matches!(event, LnavEvent::Almanac(_)));
    assert_eq!(almanacs.count(), 31);
    assert_eq!(ephemerides_in(&events).len(), 1);
}

#[test]
fn impossible_orbits_are_refused_by_name() {
    let good = sample_ephemeris();
    let cases = [
        (
            Ephemeris {
                eccentricity: 0.5,
                ..good
            },
            "eccentricity",
        ),
        (
            Ephemeris {
                sqrt_a: 6000.0,
                ..good
            },
            "sqrt_a",
        ),
        (
            Ephemeris {
                i0_rad: f64::NAN,
                ..good
            },
            "i0_rad",
        ),
        (Ephemeris { af0_s: 0.1, ..good }, "af0_s"),
        (
            Ephemeris {
                toe: good.toe + 1.0,
                ..good
            },
            "toe",
        ),
        (
            Ephemeris {
                toc: good.toc + 302_400.0,
                ..good
            },
            "toc",
        ),
        (
            Ephemeris {
                iodc: 0x1FF,
                ..good
            },
            "iodc",
        ),
        (
            Ephemeris {
                ura_index: 16,
                ..good
            },
            "ura_index",
        ),
    ];
    for (bad, expected) in cases {
        let error = quantise(&bad).unwrap_err();
        assert!(
            matches!(error, NavError::Value { name, .. } if name == expected),
            "{error}"
        );
    }
    let encoder = LnavEncoder::new(&good).unwrap();
    assert!(encoder.subframe(good.toe + 302_410.0).is_err());
}

#[test]
fn reference_times_are_the_nearest() {
    let ephemeris = sample_ephemeris();
    assert_eq!(nearest_time(7200, ephemeris.toe - 300_000.0), ephemeris.toe);
}

/// An ephemeris of which words 3 and 4 of subframe 3 look like words 1 and 2, for one of four values of `low`, which
/// makes word 4 end in zeros. Found by proptest.
fn like_a_hand_over(low: u32) -> Ephemeris {
    let (count, id) = (12_345, 1);
    let word_4 = (count + 1) << 7 | id << 2 | low;
    let (cic, omega0) = (0x8B46_u16 as i16, (0x8A << 24 | word_4) as i32);
    Ephemeris {
        sqrt_a: 5150.0,
        eccentricity: 0.049,
        cic_rad: f64::from(cic) * 2_f64.powi(-29),
        omega0_rad: std::f64::consts::PI * f64::from(omega0) * 2_f64.powi(-31),
        ..sample_ephemeris()
    }
}

/// Of which words 3 and 4 of subframe 2 do: an issue of data whose number is that of the preamble.
fn issue_like_a_preamble(low: u32) -> Ephemeris {
    let word_4 = (12_345 + 1) << 7 | 1 << 2 | low;
    let (delta_n, m0) = ((word_4 >> 8) as i16, (word_4 << 24) as i32);
    Ephemeris {
        iodc: 0x8B,
        iode: 0x8B,
        delta_n_rad_s: std::f64::consts::PI * f64::from(delta_n) * 2_f64.powi(-43),
        m0_rad: std::f64::consts::PI * f64::from(m0) * 2_f64.powi(-31),
        ..sample_ephemeris()
    }
}

#[test]
fn data_that_look_like_the_start_of_a_subframe_do_not_end_sync() {
    for low in 0..4 {
        for ephemeris in [like_a_hand_over(low), issue_like_a_preamble(low)] {
            let ephemeris = quantise(&ephemeris).unwrap();
            let encoder = LnavEncoder::new(&ephemeris).unwrap();
            let bits = encode(&encoder, sample_start(), 3000);
            for skipped in [0, 300, 600] {
                let late = bits[skipped..].iter().copied();
                let events = decode(&mut decoder(), 0, late.map(amplitude));
                assert_times(&events, skipped, 0);
                let losses = events
                    .iter()
                    .filter(|(_, event)| matches!(event, LnavEvent::SyncLost { .. }));
                // Where reception begins with the very subframe, the next one has to tell.
                let most = usize::from(skipped > 0);
                assert!(losses.count() <= most, "{low} {skipped}");
                let last = if skipped == 0 { 899 } else { 2399 - skipped };
                // Parts from before the second frame count as well.
                let found = ephemerides_in(&events);
                assert_eq!(found.len(), 1);
                assert!(
                    found[0].0 <= last && found[0].1 == ephemeris,
                    "{low} {skipped}"
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn encoded_ephemerides_come_back_quantised(
        ephemeris in ephemerides(),
        ahead in -302_000_i32..302_000,
        inverted in any::<bool>(),
    ) {
        let quantised = quantise(&ephemeris).unwrap();
        prop_assert_eq!(quantise(&quantised).unwrap(), quantised);
        let encoder = LnavEncoder::new(&ephemeris).unwrap();
        let start = ephemeris.toe.second() + ahead;
        let start = GpsTime::from_parts(ephemeris.toe.week(), i64::from(start) / 30 * 30, 0.0);
        let reach = (start + 18.0 - ephemeris.toc).abs().max((start - ephemeris.toc).abs());
        prop_assume!(reach < 302_390.0);
        let sign = if inverted { -1.0 } else { 1.0 };
        let bits = encode(&encoder, start, 900).into_iter().map(|bit| sign * amplitude(bit));
        let found = ephemerides_in(&decode(&mut decoder(), 0, bits));
        prop_assert_eq!(found, [(899, quantised)]);
    }

    #[test]
    fn rounding_stays_within_half_a_step(ephemeris in ephemerides()) {
        let quantised = quantise(&ephemeris).unwrap();
        let pi = std::f64::consts::PI;
        // Half the step of each field, IS-GPS-200 tables 20-I and 20-III, and rounding of pi.
        let near = |a: f64, b: f64, step: f64| (a - b).abs() <= 0.5 * step + 1e-12 * a.abs();
        prop_assert!(near(ephemeris.af0_s, quantised.af0_s, 2_f64.powi(-31)));
        prop_assert!(near(ephemeris.sqrt_a, quantised.sqrt_a, 2_f64.powi(-19)));
        prop_assert!(near(ephemeris.omega_rad, quantised.omega_rad, pi * 2_f64.powi(-31)));
        prop_assert!(near(ephemeris.idot_rad_s, quantised.idot_rad_s, pi * 2_f64.powi(-43)));
        prop_assert!(near(ephemeris.crs_m, quantised.crs_m, 2_f64.powi(-5)));
    }

    #[test]
    fn arbitrary_bits_yield_no_time_out_of_the_week_and_no_absurd_orbit(
        bits in prop::collection::vec((any::<f32>(), any::<u64>(), 0_u8..4), 0..500),
    ) {
        let mut decoder = decoder();
        let mut code_period = 0_u64;
        for (soft, jump, kind) in bits {
            code_period = match kind {
                0 => jump,
                1 => code_period.wrapping_add(jump % 64 * 20),
                _ => code_period.wrapping_add(20),
            };
            for event in decoder.push(NavBit { soft, code_period }) {
                match event {
                    // The time of week counts from 0 to the last second of a week.
                    LnavEvent::Sync { tow_s, .. } => prop_assert!(tow_s < 604_800),
                    LnavEvent::Ephemeris(found) => prop_assert!(quantise(&found).is_ok()),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn bit_at_is_the_bit_of_the_subframe(second in 0_u32..302_000, bit in 0_u32..300) {
        let encoder = LnavEncoder::new(&sample_ephemeris()).unwrap();
        let start = GpsTime::from_parts(2190, i64::from(second / 6 * 6), 0.0);
        let bits = encoder.subframe(start).unwrap();
        // The middle of the bit: its edges are subject to rounding.
        let time = start + (f64::from(bit) + 0.5) * 0.02;
        prop_assert_eq!(encoder.bit_at(time).unwrap(), bits[bit as usize]);
    }
}
