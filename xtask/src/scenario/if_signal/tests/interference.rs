//! Each kind of interference against its definition: frequency, power, duty and spectrum.

use std::f64::consts::TAU;

use gnss_signal::sample::SampleFormat;
use num_complex::Complex64;

use super::{RATE_HZ, samples, scene};
use crate::scenario::antenna::{Interference, Pulses, Waveform};
use crate::scenario::profile::Profile;

const LEVEL_DBHZ: f64 = 70.0;
/// |x|^2 at that level: a component of the thermal noise has unit variance, so that its density is
/// 2 / fs.
const POWER: f64 = 2.0 * 1e7 / RATE_HZ;
const BEGIN_S: f64 = 1.000_3e-3;
const END_S: f64 = 9.000_2e-3;
/// Samples from 4001.2 to 36 000.8.
const ON: std::ops::Range<usize> = 4_002..36_001;

/// Interference alone.
fn made(waveform: Waveform, pulses: Option<Pulses>) -> Vec<Complex64> {
    let mut scene = scene(SampleFormat::Cf32Le, None, vec![]);
    scene.emitters.clear();
    let level = Profile::new(vec![(BEGIN_S, LEVEL_DBHZ), (END_S, LEVEL_DBHZ)]).unwrap();
    scene.interference = vec![Interference {
        waveform,
        level_dbhz: level,
        pulses,
    }];
    let made = samples(scene);
    made.iter().map(|iq| Complex64::new(iq[0], iq[1])).collect()
}

/// Silence but for [`ON`].
fn assert_silent_outside(made: &[Complex64]) {
    let silent = |k: usize| made[k] == Complex64::ZERO;
    assert!((0..ON.start).chain(ON.end..made.len()).all(silent));
    assert!(!silent(ON.start) && !silent(ON.end - 1));
}

#[test]
fn a_tone_is_a_carrier_of_its_power() {
    let offset_hz = -123_456.7;
    let made = made(Waveform::Tone { offset_hz }, None);
    assert_silent_outside(&made);
    for k in ON {
        let expected = Complex64::from_polar(POWER.sqrt(), TAU * offset_hz * k as f64 / RATE_HZ);
        // Single precision.
        assert!(
            (made[k] - expected).norm() < 1e-6 * POWER.sqrt() * 4.0,
            "{k}"
        );
    }
}

#[test]
fn a_chirp_sweeps_without_a_break() {
    let (from_hz, to_hz, period_s) = (-300e3, 500e3, 0.7e-3);
    let waveform = Waveform::Chirp {
        from_hz,
        to_hz,
        period_s,
    };
    let made = made(waveform, None);
    assert_silent_outside(&made);
    for k in ON.start..ON.end - 1 {
        // Single precision of a square.
        assert!((made[k].norm_sqr() / POWER - 1.0).abs() < 1e-5, "{k}");
        // The phase from one sample to the next is that of the frequency half way. Sweeps begin on samples.
        let into_s = (k % 2800) as f64 / RATE_HZ + 0.5 / RATE_HZ;
        let expected_hz = from_hz + (to_hz - from_hz) * into_s / period_s;
        let hz = (made[k + 1] * made[k].conj()).arg() / TAU * RATE_HZ;
        // 1e-6 rad of single precision, twice.
        assert!(
            (hz - expected_hz).abs() < 2.0,
            "{hz} at {k}, not {expected_hz}"
        );
    }
}

#[test]
fn pulses_are_on_for_their_duty() {
    let (period_s, duty) = (0.5e-3, 0.3);
    let waveform = Waveform::Tone { offset_hz: 50e3 };
    let made = made(waveform, Some(Pulses { period_s, duty }));
    let mut on = 0;
    for (k, x) in made.iter().enumerate() {
        let since_s = k as f64 / RATE_HZ - BEGIN_S;
        let is_on = ON.contains(&k) && since_s.rem_euclid(period_s) < duty * period_s;
        let power = if is_on { POWER } else { 0.0 };
        assert!((x.norm_sqr() - power).abs() < 1e-5 * POWER, "{k}");
        on += usize::from(is_on);
    }
    // 16 whole pulses of 600 samples.
    assert_eq!(on, 9_600);
}

/// Mean power at a frequency over that of white noise of unit power, by windowed segments.
fn density(made: &[Complex64], hz: f64) -> f64 {
    const LENGTH: usize = 256;
    let window = |n: usize| (TAU / 2.0 * (n as f64 + 0.5) / LENGTH as f64).sin().powi(2);
    let norm: f64 = (0..LENGTH).map(|n| window(n).powi(2)).sum();
    let segments = made.chunks_exact(LENGTH);
    let count = segments.len() as f64;
    let power = |segment: &[Complex64]| {
        let turned = segment
            .iter()
            .enumerate()
            .map(|(n, x)| x * window(n) * Complex64::cis(-TAU * hz * n as f64 / RATE_HZ));
        turned.sum::<Complex64>().norm_sqr() / norm
    };
    segments.map(power).sum::<f64>() / count
}

#[test]
fn broadband_noise_fills_its_width() {
    let width_hz = 1.6e6;
    let made = made(Waveform::Broadband { width_hz }, None);
    assert_silent_outside(&made);
    let on = &made[ON];
    let power = on.iter().map(Complex64::norm_sqr).sum::<f64>() / on.len() as f64;
    // 12 800 independent numbers: 0.9 %, three times.
    assert!((power / POWER - 1.0).abs() < 0.027, "{power}");
    // Over its width the density of white noise of the power POWER fs / width.
    let expected = POWER * RATE_HZ / width_hz;
    let within: Vec<f64> = [-600e3, -300e3, 0.0, 300e3, 600e3]
        .map(|hz| density(on, hz))
        .into();
    for found in &within {
        // 125 segments: 9 %, three times.
        assert!((found / expected - 1.0).abs() < 0.27, "{within:?}");
    }
    let mean = within.iter().sum::<f64>() / 5.0;
    assert!((mean / expected - 1.0).abs() < 0.12, "{within:?}");
    for hz in [-1.9e6, -1.2e6, 1.2e6, 1.9e6] {
        // The filter stops by 53 dB (Hamming); leakage of the segments comes on top.
        let found = density(on, hz);
        assert!(found < 1e-4 * expected, "{found} at {hz} Hz");
    }
}

#[test]
fn noise_wider_than_the_band_is_white() {
    let width_hz = 40e6;
    let made = made(Waveform::Broadband { width_hz }, None);
    let on = &made[ON];
    let power = on.iter().map(Complex64::norm_sqr).sum::<f64>() / on.len() as f64;
    // The part of it that is sampled; 32 000 independent numbers.
    let expected = POWER * RATE_HZ / width_hz;
    assert!(
        (power / expected - 1.0).abs() < 3.0 / 32_000f64.sqrt(),
        "{power}"
    );
    let lagged = on.iter().zip(&on[1..]).map(|(a, b)| a * b.conj());
    let correlation = lagged.sum::<Complex64>() / on.len() as f64 / power;
    assert!(correlation.norm() < 3.0 / 32_000f64.sqrt(), "{correlation}");
}
