//! Filtered, real, shifted and exchanged samples against their definition in `f64`; the level
//! control; and one instruction set against another.

use std::f64::consts::TAU;

use gnss_signal::sample::SampleFormat;

use super::{NOISELESS, Options, RATE_HZ, TwoRays, bytes, emitters, ideal, samples, scene};
use crate::scenario::antenna::{Gain, Interference, Scene, Waveform};
use crate::scenario::if_signal::filter_response;
use crate::scenario::if_signal::lanes::PORTABLE_ALONE;
use crate::scenario::profile::Profile;

/// Largest sum of all rays.
const LARGEST: f64 = 870.0;

fn with_if(format: SampleFormat, bandwidth_hz: Option<f64>, if_hz: f64) -> Scene {
    let mut scene = scene(format, bandwidth_hz, vec![]);
    scene.reception.samples.intermediate_frequency_hz = if_hz;
    scene
}

/// Numbers of a format of floats.
fn numbers(scene: Scene) -> Vec<f64> {
    let bytes = bytes(scene, NOISELESS, 4096);
    let (four, _) = bytes.as_chunks::<4>();
    four.iter()
        .map(|b| f64::from(f32::from_le_bytes(*b)))
        .collect()
}

fn turned([i, q]: [f64; 2], cycles: f64) -> [f64; 2] {
    let (sin, cos) = (TAU * cycles).sin_cos();
    [i * cos - q * sin, i * sin + q * cos]
}

/// The root mean square difference of what was made, but for a factor, and what was meant, over the
/// root mean square of that.
fn misfit(made: &[f64], meant: &[f64]) -> f64 {
    let across: f64 = made.iter().zip(meant).map(|(a, b)| a * b).sum();
    let power: f64 = meant.iter().map(|b| b * b).sum();
    let factor = across / power;
    let errors = made.iter().zip(meant);
    let left: f64 = errors.map(|(a, b)| (a / factor - b).powi(2)).sum();
    (left / power).sqrt()
}

#[test]
fn an_intermediate_frequency_turns_the_samples() {
    let if_hz = -1.1e6;
    let complex = samples(with_if(SampleFormat::Cf32Le, None, if_hz));
    let real = numbers(with_if(SampleFormat::Rf32Le, None, 0.9e6));
    let mut emitters = emitters();
    let (mut factors, mut errors) = ([0.0; 2], [0.0f64; 2]);
    for k in 0..complex.len() {
        let (sum, at_edge) = ideal(&mut emitters, k);
        if at_edge {
            continue;
        }
        let time_s = k as f64 / RATE_HZ;
        let shifted = turned(sum, if_hz * time_s);
        let [i, _] = turned(sum, 0.9e6 * time_s);
        if k == 0 {
            factors = [complex[0][0] / shifted[0], real[0] / i];
        }
        let of = |a: f64, b: f64| (a - b).abs() / LARGEST;
        errors[0] = errors[0]
            .max(of(complex[k][0] / factors[0], shifted[0]))
            .max(of(complex[k][1] / factors[0], shifted[1]));
        errors[1] = errors[1].max(of(real[k] / factors[1], i));
    }
    // Single precision of carriers and of the turn.
    assert!(errors.iter().all(|e| *e < 6e-5), "{errors:?}");
    // Without a filter real samples hold both sides of the spectrum: the signal is stronger by the
    // root of two against noise of the same variance.
    let ratio = factors[1] / factors[0];
    assert!((ratio / 2f64.sqrt() - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn exchanged_samples_are_exchanged() {
    let plain = samples(with_if(SampleFormat::Cf32Le, Some(2e6), 0.3e6));
    let mut scene = with_if(SampleFormat::Cf32Le, Some(2e6), 0.3e6);
    scene.reception.samples.swap_iq = true;
    let exchanged = samples(scene);
    assert!(
        plain
            .iter()
            .zip(&exchanged)
            .all(|(a, b)| *a == [b[1], b[0]])
    );
}

/// What a filter makes of all rays at tick `k`, sampled [`FINE`] times as often.
fn filtered(emitters: &mut [TwoRays], bandwidth: f64, k: usize) -> [f64; 2] {
    const FINE: i64 = 64;
    let reach = 32 * FINE;
    let (mut sum, mut weights) = ([0.0; 2], 0.0);
    for n in -reach..=reach {
        let ticks = n as f64 / FINE as f64;
        let weight = filter_response(bandwidth, ticks);
        let [i, q] = ideal_at(emitters, (k as f64 - ticks) / RATE_HZ);
        sum = [sum[0] + weight * i, sum[1] + weight * q];
        weights += weight;
    }
    sum.map(|x| x / weights)
}

fn ideal_at(emitters: &mut [TwoRays], elapsed_s: f64) -> [f64; 2] {
    super::sum_of_rays(emitters, elapsed_s).0
}

#[test]
fn filtered_samples_are_those_of_a_filter_ahead_of_the_sampler() {
    let bandwidth_hz = 2.4e6;
    let complex = samples(with_if(SampleFormat::Cf32Le, Some(bandwidth_hz), 0.0));
    let mut emitters = emitters();
    let (mut made, mut meant) = (Vec::new(), Vec::new());
    for (k, sample) in complex.iter().enumerate().take(640).skip(500) {
        made.extend(sample);
        meant.extend(filtered(&mut emitters, bandwidth_hz / RATE_HZ, k));
    }
    let error = misfit(&made, &meant);
    // The edges of chips lose 0.4 dB (5 %) towards 0.43 of the sample rate, where less than a
    // twentieth of the power lies.
    assert!(error < 0.01, "{error}");
}

#[test]
fn every_instruction_set_gives_the_same_bytes() {
    for (format, bandwidth_hz) in [
        (SampleFormat::Ci8, Some(3.2e6)),
        (SampleFormat::R2Lsb, None),
        (SampleFormat::Cf32Le, Some(2e6)),
    ] {
        let one_thread = |portable| {
            PORTABLE_ALONE.set(portable);
            let mut scene = with_if(format, bandwidth_hz, 0.7e6);
            scene.interference = vec![broadband(55.0, (1e-3, 8e-3))];
            let thread = Options {
                thermal_noise: super::ThermalNoise::White,
                ..NOISELESS
            };
            let made = bytes(scene, thread, 4096);
            PORTABLE_ALONE.set(false);
            made
        };
        assert!(one_thread(false) == one_thread(true), "{format}");
    }
}

fn broadband(level_dbhz: f64, (begin_s, end_s): (f64, f64)) -> Interference {
    Interference {
        waveform: Waveform::Broadband { width_hz: 2e6 },
        level_dbhz: Profile::new(vec![(begin_s, level_dbhz), (end_s, level_dbhz)]).unwrap(),
        pulses: None,
    }
}

/// Rms of the components of samples `from` to `to`.
fn rms(made: &[[f64; 2]], from: usize, to: usize) -> f64 {
    let squares = made[from..to].iter().map(|[i, q]| 0.5 * (i * i + q * q));
    (squares.sum::<f64>() / (to - from) as f64).sqrt()
}

#[test]
fn an_automatic_gain_brings_interference_back_to_the_level() {
    let mut scene = scene(SampleFormat::Cf32Le, None, vec![]);
    scene.emitters.clear();
    scene.reception.gain = Gain::Automatic { time_s: 0.5e-3 };
    // Ten times the noise of 4 MHz.
    scene.interference = vec![broadband(76.02, (3e-3, 7e-3))];
    let options = Options {
        thermal_noise: super::ThermalNoise::White,
        ..NOISELESS
    };
    let bytes = bytes(scene, options, 4096);
    let (four, _) = bytes.as_chunks::<4>();
    let all: Vec<f64> = four
        .iter()
        .map(|b| f64::from(f32::from_le_bytes(*b)))
        .collect();
    let made: Vec<[f64; 2]> = all.chunks_exact(2).map(|iq| [iq[0], iq[1]]).collect();
    // 8000 samples of noise know their rms to 0.6 %, and the gain comes from 2000.
    assert!((rms(&made, 4_000, 12_000) - 1.0).abs() < 0.04);
    // At its onset the power is 11 times as large, and 5 time constants later as before.
    assert!((rms(&made, 12_000, 12_200).powi(2) / 11.0 - 1.0).abs() < 0.25);
    assert!((rms(&made, 22_000, 28_000) - 1.0).abs() < 0.04);
    // Gone, it leaves the gain too low.
    assert!((rms(&made, 28_000, 28_200).powi(2) * 11.0 - 1.0).abs() < 0.25);
}
