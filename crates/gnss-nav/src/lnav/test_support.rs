//! Ephemerides and bit streams for the tests of this folder.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{LnavDecoder, LnavEncoder, LnavEvent, NavBit};
use crate::{Ephemeris, GpsTime, SatelliteId};

/// Independent fair bits.
pub(super) fn random_bits(seed: u64, count: usize) -> Vec<bool> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| random.random()).collect()
}

/// An ephemeris over the whole range of its fields from numbers in [-1, 1) and whole ones.
fn ephemeris_of(u: [f64; 20], iodc: u16, flags: u16, week: i32, steps: (i32, i32)) -> Ephemeris {
    let pi = std::f64::consts::PI;
    // The whole range of a two's complement field in steps of 2^step.
    let full = |u: f64, bits: i32, step: i32| u * (2_f64.powi(bits - 1) - 1.0) * 2_f64.powi(step);
    let toe = GpsTime::from_parts(week, i64::from(steps.0) * 16, 0.0);
    Ephemeris {
        satellite: SatelliteId::gps(7),
        iodc,
        iode: iodc as u8,
        health: (flags & 0x3F) as u8,
        ura_index: (flags >> 6 & 0xF) as u8,
        codes_on_l2: (flags >> 10 & 3) as u8,
        l2_p_data_off: flags >> 12 & 1 == 1,
        fit_interval_extended: flags >> 13 & 1 == 1,
        toc: toe + f64::from(steps.1) * 16.0,
        af0_s: full(u[0], 22, -31),
        af1: full(u[1], 16, -43),
        af2_per_s: full(u[2], 8, -55),
        tgd_s: full(u[3], 8, -31),
        toe,
        sqrt_a: 5150.0 + 140.0 * u[4],
        eccentricity: 0.049 * (1.0 + u[5]),
        m0_rad: pi * u[6],
        delta_n_rad_s: pi * full(u[7], 16, -43),
        omega0_rad: pi * u[8],
        omega_dot_rad_s: pi * full(u[9], 24, -43),
        i0_rad: 1.0 + 0.29 * u[10],
        idot_rad_s: pi * full(u[11], 14, -43),
        omega_rad: pi * u[12],
        cuc_rad: full(u[13], 16, -29),
        cus_rad: full(u[14], 16, -29),
        crc_m: full(u[15], 16, -5),
        crs_m: full(u[16], 16, -5),
        cic_rad: full(u[17], 16, -29),
        cis_rad: full(u[18], 16, -29),
    }
}

/// Any ephemeris LNAV can hold.
pub(super) fn ephemerides() -> impl Strategy<Value = Ephemeris> {
    (
        prop::array::uniform20(-1.0..1.0),
        0_u16..1024,
        0_u16..1 << 14,
        1700_i32..2600,
        (0_i32..37_800, -450_i32..450),
    )
        .prop_map(|(u, iodc, flags, week, steps)| ephemeris_of(u, iodc, flags, week, steps))
}

/// A fixed ephemeris with all its bits busy, `toe` 7200 s into week 2190.
pub(super) fn sample_ephemeris() -> Ephemeris {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let u = std::array::from_fn(|_| random.random_range(-1.0..1.0));
    super::quantise(&ephemeris_of(u, 0x25A, 0, 2190, (450, 0))).unwrap()
}

/// The subframe starts at which the tests begin: subframe 1, two hours before `toe`.
pub(super) fn sample_start() -> GpsTime {
    GpsTime::new(2190, 0.0)
}

/// `count` bits from `start`, the start of a subframe.
pub(super) fn encode(encoder: &LnavEncoder, start: GpsTime, count: usize) -> Vec<bool> {
    let subframes = (0..count.div_ceil(300)).map(|n| start + 6.0 * n as f64);
    let bits = subframes.flat_map(|time| encoder.subframe(time).unwrap());
    bits.take(count).collect()
}

/// Amplitude of a bit in normal polarity.
pub(super) fn amplitude(bit: bool) -> f32 {
    if bit { -1.0 } else { 1.0 }
}

/// Pushes soft bits, 20 code periods apart from `first`; events with the index of their bit.
pub(super) fn decode(
    decoder: &mut LnavDecoder,
    first: u64,
    bits: impl IntoIterator<Item = f32>,
) -> Vec<(usize, LnavEvent)> {
    let events = bits.into_iter().enumerate().flat_map(|(index, soft)| {
        let code_period = first + 20 * index as u64;
        let events = decoder.push(NavBit { soft, code_period });
        events.into_iter().map(move |event| (index, event))
    });
    events.collect()
}

/// The ephemerides among the events.
pub(super) fn ephemerides_in(events: &[(usize, LnavEvent)]) -> Vec<(usize, Ephemeris)> {
    let found = events.iter().filter_map(|(index, event)| match event {
        LnavEvent::Ephemeris(ephemeris) => Some((*index, *ephemeris)),
        _ => None,
    });
    found.collect()
}
