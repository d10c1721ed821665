//! Every instruction set against the reference.
#![allow(
    clippy::print_stdout,
    reason = "measured figures, for the documentation"
)]

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::{SignalId, TapOffsets, ranging_code};

/// With AVX2 a block takes one window of the code from 9.1 MHz on, four from 2.22 MHz on, and below eight.
const RATES_HZ: [f64; 12] = [
    1.16e6, 2e6, 2.23e6, 2.6e6, 4e6, 4.092e6, 9.15e6, 12e6, 16.368e6, 16.369e6, 20.48e6, 62.5e6,
];

fn fast_sets() -> Vec<InstructionSet> {
    let sets = [
        InstructionSet::Portable,
        InstructionSet::Avx2,
        InstructionSet::Avx512,
    ];
    sets.into_iter().filter(|set| set.is_supported()).collect()
}

fn front_end(sample_rate_hz: f64, complex: bool) -> FrontEnd {
    FrontEnd {
        sample_rate_hz,
        intermediate_frequency_hz: 0.0,
        complex,
    }
}

fn random_replica(rng: &mut ChaCha8Rng, rate_hz: f64, samples: u64, taps: &[f64]) -> Replica {
    Replica {
        signal: SignalId::gps_l1_ca(rng.random_range(1..=37)).unwrap(),
        start_tick: 1000,
        end_tick: 1000 + samples,
        code_phase_chips: rng.random_range(0.0..1023.0),
        code_rate_hz: 1.023e6 + rng.random_range(-8.0..8.0),
        carrier_phase_cycles: rng.random_range(-5.0..5.0),
        carrier_frequency_hz: rng.random_range(-0.5..0.5) * rate_hz,
        tap_offsets: TapOffsets::new(taps).unwrap(),
    }
}

/// Gaussian noise, as an analog-to-digital converter of `bits` bits gives it.
fn noise(rng: &mut ChaCha8Rng, values: usize, bits: u32) -> Vec<i8> {
    let normal = rand_distr::Normal::new(0.0, 1.0).unwrap();
    (0..values)
        .map(|_| {
            let x: f64 = rng.sample(normal);
            match bits {
                1 => x.signum() as i8,
                2 => (x.signum() * if x.abs() > 1.0 { 3.0 } else { 1.0 }) as i8,
                _ => (x * 28.0).round().clamp(-127.0, 127.0) as i8,
            }
        })
        .collect()
}

/// The signal a replica describes, in 8 bits.
fn signal(front_end: FrontEnd, replica: &Replica, amplitude: f64) -> Vec<i8> {
    let code = ranging_code(replica.signal);
    let samples = replica.end_tick - replica.start_tick;
    (0..samples)
        .flat_map(|n| {
            let seconds = n as f64 / front_end.sample_rate_hz;
            let chip = replica.code_phase_chips + seconds * replica.code_rate_hz;
            let chip = f64::from(code[chip.rem_euclid(1023.0) as usize]);
            let cycles = replica.carrier_phase_cycles + seconds * replica.carrier_frequency_hz;
            let x = Complex64::cis(TAU * cycles) * chip * amplitude;
            let parts = [x.re.round() as i8, x.im.round() as i8];
            parts
                .into_iter()
                .take(if front_end.complex { 2 } else { 1 })
        })
        .collect()
}

fn power(samples: &[i8], front_end: FrontEnd) -> f64 {
    let sum: f64 = samples.iter().map(|&v| f64::from(v).powi(2)).sum();
    let components = if front_end.complex { 2.0 } else { 1.0 };
    sum / (samples.len() as f64 / components).max(1.0)
}

fn taps(set: InstructionSet, front_end: FrontEnd, samples: &[i8], replica: &Replica) -> Taps {
    let mut correlator = Correlator::new(front_end, set).unwrap();
    correlator
        .correlate(samples, power(samples, front_end), replica)
        .unwrap()
}

/// Root mean square over all taps of the difference to the reference, in standard deviations of
/// the sums under noise.
fn deviation(set: InstructionSet, front_end: FrontEnd, samples: &[i8], replica: &Replica) -> f64 {
    let exact = taps(InstructionSet::Reference, front_end, samples, replica);
    let fast = taps(set, front_end, samples, replica);
    let noise = (f64::from(exact.samples) * exact.sample_power).max(1.0);
    let pairs = fast.as_slice().iter().zip(exact.as_slice());
    let squares: f64 = pairs.map(|(a, b)| (a - b).norm_sqr()).sum();
    (squares / exact.as_slice().len() as f64 / noise).sqrt()
}

/// Taps so close that all but one are summed by what they differ by.
#[test]
fn close_taps_are_what_they_are_one_by_one() {
    let eleven: Vec<f64> = (-5..=5).map(|k| f64::from(k) / 10.0).collect();
    let scattered = [
        0.3, -0.2, 0.0, 0.45, -0.5, 0.6, 0.44, -0.1, 0.3, 0.11, -0.37, 0.2,
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for set in fast_sets() {
        let (mut squares, mut cases) = (0.0, 0);
        for rate_hz in [8.192e6, 12.5e6, 16.368e6, 16.369e6, 20.48e6, 25e6] {
            for (offsets, complex) in [(&eleven[..], false), (&scattered, true)] {
                let random_chips = rng.random_range(0.0..1023.0);
                for (code_phase_chips, ms) in [(0.01, 2.2), (1022.99, 2.2), (random_chips, 20.3)] {
                    let front_end = front_end(rate_hz, complex);
                    let count = (rate_hz * 1e-3 * ms) as usize + rng.random_range(0..64);
                    let together = Replica {
                        code_phase_chips,
                        ..random_replica(&mut rng, rate_hz, count as u64, offsets)
                    };
                    let samples = noise(&mut rng, count * if complex { 2 } else { 1 }, 8);
                    let together_sums = taps(set, front_end, &samples, &together);
                    let deviation = (count as f64 * together_sums.sample_power).sqrt();
                    for (sum, offset) in together_sums.as_slice().iter().zip(offsets) {
                        let alone = Replica {
                            tap_offsets: TapOffsets::new(&[*offset]).unwrap(),
                            ..together
                        };
                        let alone = taps(set, front_end, &samples, &alone).as_slice()[0];
                        let difference = (sum - alone).norm() / deviation;
                        // A sample or two for the wrong side of a change.
                        assert!(difference < 0.1, "{set} {rate_hz} {offset}: {difference}");
                        squares += difference * difference;
                        cases += 1;
                    }
                }
            }
        }
        // A change is placed to 2^-13 sample. Each of half the chips then moves that part of the square of a sample's sum,
        // twice its value, to the wrong side: 0.004 deviations at 8 MHz.
        let rms = (squares / f64::from(cases)).sqrt();
        println!("{set}: {rms:.5} deviations");
        assert!(rms < 0.006, "{set}: {rms}");
    }
}

/// So many samples of a chip that changes beyond a chunk lie beyond what 32 bits count.
#[test]
fn close_taps_are_summed_at_the_highest_rates() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for set in fast_sets() {
        for rate_hz in [250e6, 1e9] {
            let front_end = front_end(rate_hz, false);
            let replica = random_replica(&mut rng, rate_hz, 40_000, &[-0.01, 0.0, 0.01]);
            let samples = noise(&mut rng, 40_000, 8);
            let deviation = deviation(set, front_end, &samples, &replica);
            assert!(deviation < 0.1, "{set} {rate_hz}: {deviation}");
        }
    }
}

#[test]
fn noise_sums_agree_at_every_rate_and_resolution() {
    let wide: Vec<f64> = (-8..8).map(|k| f64::from(k) * 0.37).collect();
    let tap_sets: [&[f64]; 3] = [&[-0.05, 0.0, 0.05], &[-0.5, -0.1, 0.0, 0.1, 0.5], &wide];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for set in fast_sets() {
        let (mut squares, mut cases) = (0.0, 0);
        for rate_hz in RATES_HZ {
            for (complex, bits) in [(false, 1), (false, 2), (false, 8), (true, 1), (true, 8)] {
                let front_end = front_end(rate_hz, complex);
                let ms = [1.0, 1.0, 3.3][cases % 3];
                let count = (rate_hz * 1e-3 * ms) as usize + rng.random_range(0..64);
                let replica = random_replica(&mut rng, rate_hz, count as u64, tap_sets[cases % 3]);
                let samples = noise(&mut rng, count * if complex { 2 } else { 1 }, bits);
                let deviation = deviation(set, front_end, &samples, &replica);
                // Rounding and dither of the baseband to 8 bits have an rms of up to 0.03; 0.1 is
                // exceeded by one such (Rayleigh) deviation in 60 000.
                assert!(
                    deviation < 0.1,
                    "{set} {rate_hz} {complex} {bits}: {deviation}"
                );
                squares += deviation * deviation;
                cases += 1;
            }
        }
        // 10 log10(1 + d^2) is the loss of signal-to-noise ratio.
        let loss_db = 10.0 * (1.0 + squares / cases as f64).log10();
        println!("{set}: loss {loss_db:.5} dB");
        assert!(loss_db < 0.01, "{set}: {loss_db} dB");
    }
}

/// Commensurate carriers, and ones that hardly turn, are where rounding in phase or amplitude
/// would show as a bias.
#[test]
fn amplitude_and_phase_have_no_bias() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for set in fast_sets() {
        let mut worst = (0.0_f64, 0.0_f64);
        for rate_hz in RATES_HZ {
            let frequencies_hz = [rate_hz / 4.0, 0.0, 3.0, rate_hz / 3.0, 0.123 * rate_hz];
            for (i, frequency_hz) in frequencies_hz.into_iter().enumerate() {
                // A real carrier at rest has no quadrature.
                let complex = i != 0;
                let front_end = front_end(rate_hz, complex);
                let mut replica =
                    random_replica(&mut rng, rate_hz, (rate_hz * 4e-3) as u64, &[0.0]);
                replica.carrier_frequency_hz = frequency_hz;
                let mut samples = signal(front_end, &replica, 20.0);
                let added = noise(&mut rng, samples.len(), 8);
                let clipped = |x: i8, n: i8| x.saturating_add(n).max(-127);
                samples
                    .iter_mut()
                    .zip(added)
                    .for_each(|(x, n)| *x = clipped(*x, n));
                let exact = taps(InstructionSet::Reference, front_end, &samples, &replica);
                let fast = taps(set, front_end, &samples, &replica);
                let ratio = fast.as_slice()[0] / exact.as_slice()[0];
                worst.0 = worst.0.max((ratio.norm() - 1.0).abs());
                worst.1 = worst.1.max(ratio.arg().to_degrees().abs());
            }
        }
        println!(
            "{set}: worst amplitude error {:.5}, phase {:.4} degrees",
            worst.0, worst.1
        );
        // The tolerances this module states. Rounding noise, 0.03 of that of the samples, has a
        // standard deviation of 0.03 degrees here (10 400 samples at least).
        assert!(worst.0 < 0.003 && worst.1 < 0.1, "{set}: {worst:?}");
    }
}

/// The same for one-bit samples, which hold a signal only by the noise they come with.
#[test]
fn one_bit_samples_have_no_bias() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for set in fast_sets() {
        for (rate_hz, frequency_hz, complex) in [
            (2.6e6, 0.0, true),
            (2.6e6, 7.0, true),
            (16.368e6, 4.092e6, false),
        ] {
            let front_end = front_end(rate_hz, complex);
            let mut replica = random_replica(&mut rng, rate_hz, (rate_hz * 10e-3) as u64, &[0.0]);
            replica.carrier_frequency_hz = frequency_hz;
            let clean = signal(front_end, &replica, 20.0);
            let added = noise(&mut rng, clean.len(), 8);
            let sum = clean
                .iter()
                .zip(added)
                .map(|(&x, n)| i16::from(x) + i16::from(n));
            let samples: Vec<i8> = sum.map(|x| if x >= 0 { 1 } else { -1 }).collect();
            let exact = taps(InstructionSet::Reference, front_end, &samples, &replica);
            let fast = taps(set, front_end, &samples, &replica);
            let ratio = fast.as_slice()[0] / exact.as_slice()[0];
            // As above.
            assert!(
                (ratio.norm() - 1.0).abs() < 0.003,
                "{set} {rate_hz} {frequency_hz}: {ratio}"
            );
            assert!(
                ratio.arg().to_degrees().abs() < 0.1,
                "{set} {rate_hz} {frequency_hz}: {ratio}"
            );
        }
    }
}

#[test]
fn every_length_is_correlated_to_its_end() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for set in fast_sets() {
        for complex in [false, true] {
            let front_end = front_end(4e6, complex);
            for count in (0..200).chain([1023, 1024, 1025, 8192, 8193, 80_000]) {
                let replica = random_replica(&mut rng, 4e6, count as u64, &[-0.3, 0.0, 0.3, 0.9]);
                let samples = noise(&mut rng, count * if complex { 2 } else { 1 }, 8);
                let deviation = deviation(set, front_end, &samples, &replica);
                // As above; with few samples a single rounding error weighs more.
                assert!(deviation < 0.12, "{set} {complex} {count}: {deviation}");
            }
        }
    }
}

#[test]
fn pieces_add_up_to_the_whole() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for set in fast_sets() {
        let front_end = front_end(2.6e6, true);
        let whole = random_replica(&mut rng, 2.6e6, 52_000, &[-0.5, 0.0, 0.5]);
        let samples = noise(&mut rng, 2 * 52_000, 1);
        let expected = taps(set, front_end, &samples, &whole);
        let mut sums = [Complex64::default(); 3];
        for piece in 0..20 {
            let (start, end) = (
                piece * 2600 - piece % 7,
                (piece + 1) * 2600 - (piece + 1) % 7,
            );
            let (start, end) = (start.min(52_000), if piece == 19 { 52_000 } else { end });
            let seconds = start as f64 / 2.6e6;
            let mut replica = whole;
            replica.start_tick += start;
            replica.end_tick = 1000 + end;
            replica.code_phase_chips =
                (whole.code_phase_chips + seconds * whole.code_rate_hz) % 1023.0;
            replica.carrier_phase_cycles += seconds * whole.carrier_frequency_hz;
            let part = taps(
                set,
                front_end,
                &samples[2 * start as usize..2 * end as usize],
                &replica,
            );
            sums.iter_mut()
                .zip(part.as_slice())
                .for_each(|(sum, part)| *sum += part);
        }
        for (sum, expected) in sums.iter().zip(expected.as_slice()) {
            // Both are rounded, at different places: twice 0.03 standard deviations.
            assert!((sum - expected).norm() < 0.15 * (52_000.0_f64 * 2.0).sqrt());
        }
    }
}

#[test]
fn vector_sets_agree_with_the_portable_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for set in fast_sets() {
        for rate_hz in RATES_HZ {
            let front_end = front_end(rate_hz, true);
            let count = (rate_hz * 4e-3) as u64;
            let replica = random_replica(&mut rng, rate_hz, count, &[-0.5, 0.0, 0.5]);
            let samples = noise(&mut rng, 2 * count as usize, 8);
            let portable = taps(InstructionSet::Portable, front_end, &samples, &replica);
            let vector = taps(set, front_end, &samples, &replica);
            let scale = (portable.sample_power * count as f64).sqrt();
            for (a, b) in vector.as_slice().iter().zip(portable.as_slice()) {
                // The same baseband to the bit; f32 sums, carrier tables that differ by fused
                // rounding, and a few samples within 2e-6 chips of a chip edge remain.
                assert!((a - b).norm() < 0.02 * scale, "{set} {rate_hz}: {a} {b}");
            }
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let good = random_replica(&mut rng, 4e6, 4000, &[0.0]);
    let samples = noise(&mut rng, 4000, 8);
    let change: [fn(&mut Replica); 6] = [
        |r| r.code_phase_chips = f64::NAN,
        |r| r.code_rate_hz = 0.0,
        |r| r.code_rate_hz = f64::NAN,
        |r| r.carrier_frequency_hz = f64::INFINITY,
        |r| r.carrier_phase_cycles = f64::NAN,
        |r| r.end_tick += 1,
    ];
    for set in fast_sets().into_iter().chain([InstructionSet::Reference]) {
        let mut correlator = Correlator::new(front_end(4e6, false), set).unwrap();
        assert!(correlator.correlate(&samples, 800.0, &good).is_ok());
        assert!(correlator.correlate(&samples, f64::NAN, &good).is_ok());
        for change in change {
            let mut bad = good;
            change(&mut bad);
            assert!(correlator.correlate(&samples, 800.0, &bad).is_err());
        }
    }
}

#[test]
fn full_scale_samples_do_not_overflow() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let sixteen: Vec<f64> = (0..16).map(|k| f64::from(k) * 0.06).collect();
    for set in fast_sets() {
        for (complex, value) in [(false, -127_i8), (false, 127), (true, -127), (true, 127)] {
            for (rate_hz, ms, offsets) in [
                (16.368e6, 1.0, &[0.0][..]),
                (5.5e6, 1.0, &sixteen),
                (8.4e6, 20.0, &sixteen),
            ] {
                let front_end = front_end(rate_hz, complex);
                let count = (rate_hz * 1e-3 * ms) as usize;
                let mut replica = random_replica(&mut rng, rate_hz, count as u64, offsets);
                replica.carrier_frequency_hz = 0.0;
                let samples = vec![value; count * if complex { 2 } else { 1 }];
                let exact = taps(InstructionSet::Reference, front_end, &samples, &replica);
                // A claim of hardly any power, so that samples are scaled up and clipped.
                let mut correlator = Correlator::new(front_end, set).unwrap();
                let clipped = correlator.correlate(&samples, 1e-3, &replica).unwrap();
                let fast = taps(set, front_end, &samples, &replica);
                let exact = exact.as_slice().iter();
                for ((exact, fast), clipped) in exact.zip(fast.as_slice()).zip(clipped.as_slice()) {
                    assert!(clipped.norm() <= 1.01 * exact.norm() + count as f64);
                    assert!((fast - exact).norm() < count as f64);
                }
            }
        }
    }
}

#[test]
fn rates_too_low_for_an_instruction_set_are_correlated_by_another() {
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    for set in fast_sets() {
        for rate_hz in [1e5, 1.03e6, 1.2e6, 1.81e6] {
            let front_end = front_end(rate_hz, true);
            let replica = random_replica(&mut rng, rate_hz, 4000, &[-0.5, 0.0, 0.5]);
            let samples = noise(&mut rng, 8000, 8);
            let deviation = deviation(set, front_end, &samples, &replica);
            // As in `noise_sums_agree_at_every_rate_and_resolution`.
            assert!(deviation < 0.1, "{set} {rate_hz}: {deviation}");
        }
    }
}
