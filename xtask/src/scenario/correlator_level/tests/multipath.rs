//! The receiver's own code loop under a reflection, against the envelope of an ideal one.

use gnss_signal::sample::SampleFormat;
use gnss_signal::tracking::{Channel, Lock, NoiseFloor, TrackingSettings};
use gnss_signal::{AcquisitionHit, CorrelatorBank, SignalId, ranging_code};

use super::support::{PRN, Reflection, TestEmitter, lnav, path, reception, scene};
use crate::scenario::antenna::Emitter;
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::multipath::tracking_error_chips;
use crate::scenario::path::SignalPath;

/// Noise of the loop below: 2e-5 chips.
const CN0_DBHZ: f64 = 90.0;
const RATE_HZ: f64 = 2.6e6;
/// Ten time constants of the loop, and a second of pull-in.
const SETTLED_S: f64 = 4.0;
const AMPLITUDE: f64 = 0.5;

/// The whole channel, early to late a chip.
fn tracking() -> TrackingSettings {
    let settings = TrackingSettings {
        spacing_chips: 1.0,
        code_locked_hz: 2.0,
        code_unlocked_hz: 2.0,
        ..TrackingSettings::default()
    };
    settings.check().unwrap()
}

/// How late the channel follows a signal with one reflection in the end, and what theory says.
fn found_and_expected_chips(delay_chips: f64, phase_cycles: f64) -> (f64, f64) {
    let path = path(1_234.0);
    let emitter = || {
        let mut emitter = TestEmitter::new(CN0_DBHZ, path, lnav(path.code_time));
        emitter.reflections = vec![Reflection {
            amplitude: AMPLITUDE,
            delay_chips,
            phase_cycles,
        }];
        emitter
    };
    let reception = reception(SampleFormat::Ci8, RATE_HZ, None);
    let scene = scene(reception, SETTLED_S + 0.1, vec![emitter()]);
    let mut bank = CorrelatorLevelBank::new(scene).unwrap();
    let chips = |elapsed_s: f64| path.arrival(elapsed_s).unwrap().code_time.fraction_s() * 1.023e6;
    let hit = AcquisitionHit {
        signal: SignalId::gps_l1_ca(PRN).unwrap(),
        tick: 0,
        code_phase_chips: chips(0.0).rem_euclid(1023.0),
        doppler_hz: path.doppler_hz,
        statistic: 0.0,
        threshold: 0.0,
        cn0_dbhz: CN0_DBHZ,
    };
    let mut channel = Channel::new(&hit, bank.front_end(), tracking());
    let unused = SignalId::gps_l1_ca(37).unwrap();
    let mut noise = NoiseFloor::new(unused, bank.front_end()).unwrap();
    let mut taps = Vec::new();
    let end = (SETTLED_S * RATE_HZ) as u64;
    for tick in (0..=end).step_by((0.1 * RATE_HZ) as usize).skip(1) {
        bank.advance_to(tick).unwrap();
        for back in 1..=5 {
            noise.measure(&mut bank, tick - back * 2601).unwrap();
        }
        while let Some(replica) = channel.replica().filter(|r| r.end_tick <= tick) {
            bank.correlate(&[replica], &mut taps).unwrap();
            channel.update(&replica, &taps[0], &noise);
        }
    }
    let epoch = channel.epoch(end).unwrap();
    assert_eq!(epoch.lock, Lock::Carrier);
    let followed = epoch.code_phase_chips;
    let late = chips(SETTLED_S) - followed;
    let mut rays = Vec::new();
    emitter().rays(SETTLED_S, SETTLED_S, &mut rays).unwrap();
    (
        (late + 511.5).rem_euclid(1023.0) - 511.5,
        tracking_error_chips(&rays),
    )
}

/// The theory's triangle has no side lobes: the code's are a thousandth up to four chips away.
#[test]
fn the_code_is_as_good_as_a_triangle() {
    let code = ranging_code(SignalId::gps_l1_ca(PRN).unwrap());
    for shift in 1..=4 {
        let products = (0..1023).map(|k| i32::from(code[k]) * i32::from(code[(k + shift) % 1023]));
        assert_eq!(products.sum::<i32>(), -1, "{shift} chips");
    }
}

#[test]
fn our_code_loop_errs_as_the_envelope_says() {
    let (mut most, mut least) = (0.0f64, 0.0f64);
    for eighth in 1..=13 {
        let delay_chips = 0.125 * f64::from(eighth);
        for phase_cycles in [0.0, 0.15, 0.25, 0.35, 0.5, 0.8] {
            let (found, expected) = found_and_expected_chips(delay_chips, phase_cycles);
            let error = found - expected;
            // 0.01 is asked for; there is no noise to speak of.
            assert!(
                error.abs() < 0.001,
                "{delay_chips} chips, {phase_cycles} cycles: {found}, not {expected} chips"
            );
            (most, least) = (most.max(found), least.min(found));
        }
    }
    // Half the reflection's amplitude, at 0.75 chips in phase and at 0.25 in opposition.
    assert!(
        (most - 0.25).abs() < 0.001 && (least + 0.25).abs() < 0.001,
        "{least} to {most}"
    );
}
