//! Acquisition of synthetic signals: every kind of front end, false alarms, threads, bad requests.
#![allow(clippy::print_stdout)] // measured figures

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::ca_code::ranging_code;

struct Satellite {
    prn: u8,
    code_phase_chips: f64,
    doppler_hz: f64,
    cn0_dbhz: f64,
}

/// Standard deviation of the noise, 8-bit values: quantisation adds 0.02 dB.
const NOISE: f64 = 4.0;

/// Samples of `satellites` in white noise, every second data bit (of 20 ms, the first edge after
/// 7 ms) negative.
fn samples(front_end: FrontEnd, satellites: &[Satellite], periods: u32, seed: u64) -> Vec<i8> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let rate_hz = front_end.sample_rate_hz;
    let count = (f64::from(periods) * 1e-3 * rate_hz).ceil() as usize;
    let mut out = Vec::new();
    for n in 0..count {
        let time_s = n as f64 / rate_hz;
        let signal: Complex64 = satellites
            .iter()
            .map(|s| signal(s, front_end, time_s))
            .sum();
        let mut noisy = |value: f64| {
            let noise: f64 = StandardNormal.sample(&mut generator);
            (NOISE * (noise + value)).round().clamp(-127.0, 127.0) as i8
        };
        out.push(noisy(signal.re));
        if front_end.complex {
            out.push(noisy(signal.im));
        }
    }
    out
}

/// The signal in units of the noise of one component.
fn signal(satellite: &Satellite, front_end: FrontEnd, time_s: f64) -> Complex64 {
    let code = ranging_code(SignalId::gps_l1_ca(satellite.prn).unwrap());
    let chips_per_s = 1.023e6 * (1.0 + satellite.doppler_hz / 1575.42e6);
    let chip = (satellite.code_phase_chips + chips_per_s * time_s).rem_euclid(1023.0);
    let bit = (((time_s - 0.007) / 0.020).floor() as i64).rem_euclid(2);
    let sign = f64::from(code[chip as usize]) * if bit == 0 { 1.0 } else { -1.0 };
    // Complex: noise power 2 over the sample rate. Real: the signal sqrt(2) cos(..) has unit
    // power, and noise of unit power fills half the sample rate.
    let scale = if front_end.complex { 2.0 } else { 4.0 };
    let power = scale * 10_f64.powf(satellite.cn0_dbhz / 10.0) / front_end.sample_rate_hz;
    let cycles = (front_end.intermediate_frequency_hz + satellite.doppler_hz) * time_s;
    Complex64::from_polar(power.sqrt() * sign, std::f64::consts::TAU * cycles)
}

fn front_end(sample_rate_hz: f64, intermediate_frequency_hz: f64, complex: bool) -> FrontEnd {
    FrontEnd {
        sample_rate_hz,
        intermediate_frequency_hz,
        complex,
    }
}

fn request(prns: &[u8], half_width_hz: f64, plan: (u32, u32), probability: f64) -> SearchRequest {
    SearchRequest {
        signals: prns
            .iter()
            .map(|prn| SignalId::gps_l1_ca(*prn).unwrap())
            .collect(),
        start_tick: 123,
        doppler_centre_hz: 0.0,
        doppler_half_width_hz: half_width_hz,
        coherent_periods: plan.0,
        noncoherent_sums: plan.1,
        false_alarm_probability: probability,
    }
}

fn search(front_end: FrontEnd, samples: &[i8], request: &SearchRequest) -> SearchReport {
    let mut engine = AcquisitionEngine::new(front_end).unwrap();
    engine.search(samples, request).unwrap()
}

#[test]
fn any_front_end_gives_code_phase_doppler_and_strength() {
    let front_ends = [
        front_end(16.369e6, 3.996e6, false),
        front_end(16.368e6, 4.092e6, false),
        front_end(20.48e6, 5.5e6, false),
        front_end(62.5e6, 15.42e6, false),
        front_end(5.456e6, 4.092e6, false),
        front_end(5e6, -0.4e6, true),
        front_end(4.092e6, 0.0, true),
        front_end(2.6e6, 20e3, true),
        front_end(2.048e6, 0.0, true),
    ];
    for (index, front_end) in front_ends.into_iter().enumerate() {
        // Off every grid: 0.137 chip, 4.1 kHz.
        let satellite = Satellite {
            prn: 7,
            code_phase_chips: 411.137 + index as f64 / 9.0,
            doppler_hz: -4100.0 - 31.0 * index as f64,
            cn0_dbhz: 45.0,
        };
        let request = request(&[7, 8], 5e3, (1, 20), 1e-3);
        let due = (satellite.code_phase_chips, satellite.doppler_hz);
        let found = search(
            front_end,
            &samples(front_end, &[satellite], 20, 5),
            &request,
        );
        assert_eq!(found.hits.len(), 1, "{front_end:?}");
        let hit = found.hits[0];
        assert_eq!((hit.signal.prn(), hit.tick), (7, 123));
        // Over 20 ms at 45 dB-Hz the bounds of a coherent estimate are 0.013 chip and 0.6 Hz, the
        // phase grid adds 1/32 chip. Samples that fall on the same points of every chip do not
        // tell where between them an unfiltered chip begins: half a sample.
        let per_chip = front_end.sample_rate_hz / 1.023e6;
        let blind_chips = if per_chip.fract() == 0.0 {
            0.5 / per_chip
        } else {
            0.0
        };
        let code_error = hit.code_phase_chips - due.0;
        let allowed = 0.08 + blind_chips;
        assert!(
            code_error.abs() < allowed,
            "{front_end:?}: {code_error} chip"
        );
        assert!(
            (hit.doppler_hz - due.1).abs() < 4.0,
            "{front_end:?}: {hit:?}"
        );
        // 1 dB is asked for; noise over 20 ms is 0.25 dB. The aliased sidelobes of an unfiltered
        // code count as signal at low rates.
        assert!((hit.cn0_dbhz - 45.0).abs() < 1.0, "{front_end:?}: {hit:?}");
    }
}

#[test]
fn strength_is_unbiased_from_33_to_50_dbhz() {
    let front_end = front_end(4.092e6, 0.0, true);
    for cn0_dbhz in [33.0, 38.0, 44.0, 50.0] {
        let satellites = [Satellite {
            prn: 3,
            code_phase_chips: 1022.9,
            doppler_hz: 2345.0,
            cn0_dbhz,
        }];
        let raw = samples(front_end, &satellites, 60, 8);
        let found = search(front_end, &raw, &request(&[3], 3e3, (4, 15), 1e-3));
        // At 33 dB-Hz 60 ms hold a power of 120 times the noise of one: 0.6 dB of it is noise.
        let error = found.hits[0].cn0_dbhz - cn0_dbhz;
        assert!(error.abs() < 1.0, "{cn0_dbhz}: {error}");
    }
}

#[test]
fn worst_cell_offsets_cost_less_than_a_decibel() {
    // An eighth of a bin and of a chip off the fine grid, at next to no noise: the statistic
    // against that of a signal on the grid.
    let front_end = front_end(8.184e6, 0.0, true);
    let statistic = |code_phase_chips: f64, doppler_hz: f64| {
        let satellites = [Satellite {
            prn: 11,
            code_phase_chips,
            doppler_hz,
            cn0_dbhz: 60.0,
        }];
        let raw = samples(front_end, &satellites, 4, 1);
        let found = search(front_end, &raw, &request(&[11], 1e3, (1, 4), 1e-3));
        found.hits[0].statistic
    };
    let on_grid = statistic(0.0, 0.0);
    let loss_db = 10.0 * (on_grid / statistic(0.125, 125.0)).log10();
    let band_db = -10.0 * code_spectrum::band_gain(|_| 1.0).log10();
    println!("grid loss {loss_db:.2} dB, band loss {band_db:.2} dB");
    assert!(loss_db + band_db < 1.0, "{loss_db} {band_db}");
}

#[test]
fn false_alarms_come_as_often_as_stated() {
    let front_end = front_end(2.6e6, 0.0, true);
    let probability = 0.1;
    for (plan, runs) in [((1, 1), 300_u32), ((1, 2), 300), ((2, 8), 100)] {
        let mut engine = AcquisitionEngine::new(front_end).unwrap();
        let request = request(&[1, 9, 17, 30], 1e3, plan, probability);
        let alarms = (0..runs)
            .filter(|seed| {
                let noise = samples(front_end, &[], plan.0 * plan.1, u64::from(*seed) + 1000);
                !engine.search(&noise, &request).unwrap().hits.is_empty()
            })
            .count() as f64;
        println!("{plan:?}: {alarms} false alarms in {runs} runs, {probability} stated");
        let mean = f64::from(runs) * probability;
        let sigma = (mean * (1.0 - probability)).sqrt();
        // Not more often than stated (3 sigma); over one or two periods at most three times less
        // often. Longer sums reach below the least C/N0 of a hit, which drops most false alarms.
        assert!(alarms < mean + 3.0 * sigma, "{plan:?}: {alarms}");
        let short = plan.0 * plan.1 <= 2;
        assert!(!short || alarms > mean / 3.0, "{plan:?}: {alarms}");
    }
}

#[test]
fn a_strong_satellite_is_not_found_under_other_numbers() {
    let front_end = front_end(4e6, 0.0, true);
    let satellites = [Satellite {
        prn: 21,
        code_phase_chips: 500.2,
        doppler_hz: 1234.0,
        cn0_dbhz: 52.0,
    }];
    let raw = samples(front_end, &satellites, 60, 3);
    let all: Vec<u8> = (1..=32).collect();
    let found = search(front_end, &raw, &request(&all, 4e3, (4, 15), 1e-3));
    let prns: Vec<u8> = found.hits.iter().map(|hit| hit.signal.prn()).collect();
    assert_eq!(prns, [21]);
}

#[test]
fn a_tone_is_no_satellite() {
    let front_end = front_end(4e6, 0.0, true);
    let mut generator = ChaCha8Rng::seed_from_u64(4);
    let raw: Vec<i8> = (0..4000 * 20)
        .flat_map(|n| {
            // 20 dB below the noise of the band, 46 dB-Hz.
            let turn = Complex64::from_polar(0.14, std::f64::consts::TAU * 0.0305 * f64::from(n));
            [turn.re, turn.im].map(|value| {
                let noise: f64 = StandardNormal.sample(&mut generator);
                (NOISE * (noise + value)).round() as i8
            })
        })
        .collect();
    let all: Vec<u8> = (1..=32).collect();
    let found = search(front_end, &raw, &request(&all, 5e3, (4, 5), 1e-3));
    assert_eq!(found.hits, []);
}

#[test]
fn threads_change_nothing() {
    let front_end = front_end(2.6e6, 0.0, true);
    let satellites = [Satellite {
        prn: 2,
        code_phase_chips: 10.0,
        doppler_hz: 700.0,
        cn0_dbhz: 44.0,
    }];
    let raw = samples(front_end, &satellites, 8, 2);
    let request = request(&[1, 2, 3, 4, 5], 2e3, (2, 4), 1e-3);
    let one = search(front_end, &raw, &request);
    for threads in [2, 3, 64] {
        let engine = AcquisitionEngine::new(front_end).unwrap();
        let many = engine.with_threads(threads).search(&raw, &request).unwrap();
        assert_eq!(format!("{one:?}"), format!("{many:?}"));
    }
}

#[test]
fn samples_a_little_short_or_long_are_searched() {
    let front_end = front_end(2.6e6, 0.0, true);
    let satellites = [Satellite {
        prn: 2,
        code_phase_chips: 10.0,
        doppler_hz: 700.0,
        cn0_dbhz: 48.0,
    }];
    let raw = samples(front_end, &satellites, 11, 2);
    let request = request(&[2], 2e3, (1, 10), 1e-3);
    let needed = AcquisitionEngine::samples_needed(front_end, &request) as usize;
    assert_eq!(needed, 26_000);
    for count in [needed - 2600, needed - 50, needed, needed + 2000] {
        let found = search(front_end, &raw[..2 * count], &request);
        assert!((found.hits[0].code_phase_chips - 10.0).abs() < 0.1);
    }
    let mut engine = AcquisitionEngine::new(front_end).unwrap();
    assert!(engine.search(&raw[..2000], &request).is_err());
    assert!(engine.search(&[], &request).is_err());
}

#[test]
fn silence_and_a_request_for_nothing_give_no_hits() {
    let front_end = front_end(2.6e6, 0.0, true);
    let silent = vec![0; 2 * 2600];
    let report = search(front_end, &silent, &request(&[1, 2], 1e3, (1, 1), 1e-3));
    assert_eq!(report.hits, []);
    let report = search(front_end, &silent, &request(&[], 1e3, (1, 1), 1e-3));
    assert_eq!((report.hits.len(), report.best_missed), (0, None));
}

#[test]
fn absurd_values_are_refused() {
    let good = front_end(2.6e6, 0.0, true);
    for bad in [
        front_end(f64::NAN, 0.0, true),
        front_end(0.0, 0.0, true),
        front_end(-2e6, 0.0, false),
        front_end(f64::INFINITY, 0.0, true),
        front_end(2.6e6, f64::NAN, true),
        front_end(2.6e6, 1e9, true),
    ] {
        assert!(AcquisitionEngine::new(bad).is_err(), "{bad:?}");
    }
    let base = request(&[1], 1e3, (1, 1), 1e-3);
    let with = |change: fn(&mut SearchRequest)| {
        let mut request = base.clone();
        change(&mut request);
        request
    };
    let mut engine = AcquisitionEngine::new(good).unwrap();
    for bad in [
        with(|r| r.coherent_periods = 0),
        with(|r| r.coherent_periods = 21),
        with(|r| r.noncoherent_sums = 0),
        with(|r| r.noncoherent_sums = u32::MAX),
        with(|r| r.false_alarm_probability = 0.0),
        with(|r| r.false_alarm_probability = f64::NAN),
        with(|r| r.doppler_half_width_hz = -1.0),
        with(|r| r.doppler_half_width_hz = f64::INFINITY),
        with(|r| r.doppler_centre_hz = f64::NAN),
    ] {
        assert!(engine.search(&[1; 5200], &bad).is_err(), "{bad:?}");
    }
}

#[test]
fn default_plans_fit_their_duration() {
    for duration_ms in 1..200 {
        let (coherent, sums) = default_search(duration_ms);
        assert!(coherent >= 1 && sums >= 1 && coherent * sums <= duration_ms);
    }
    assert_eq!(default_search(0), (1, 1));
}
