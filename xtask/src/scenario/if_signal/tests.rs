//! Samples against their definition in `f64`, sample by sample.

mod faults;
mod front_end;
mod interference;

use std::f64::consts::TAU;
use std::io::Read;
use std::num::NonZeroUsize;

use anyhow::Result;
use gnss_nav::GpsTime;
use gnss_signal::sample::{SampleDescription, SampleFormat, SampleSource};
use gnss_signal::{SignalId, ranging_code};

use super::{Options, Synthesiser, ThermalNoise};
use crate::scenario::antenna::{Arrival, Emitter, Gain, Gap, Ray, Reception, Scene};

const RATE_HZ: f64 = 4e6;

/// Two rays of constant Doppler and a bit a second, silent between two instants.
#[derive(Clone)]
struct TwoRays {
    prn: u8,
    doppler_hz: f64,
    silent_s: [f64; 2],
}

impl Emitter for TwoRays {
    fn signal(&self) -> SignalId {
        SignalId::gps_l1_ca(self.prn).unwrap()
    }

    fn edges_s(&self) -> &[f64] {
        &self.silent_s
    }

    fn rays(&mut self, elapsed_s: f64, within_s: f64, rays: &mut Vec<Ray>) -> Result<()> {
        if (self.silent_s[0]..self.silent_s[1]).contains(&within_s) {
            return Ok(());
        }
        let start = GpsTime::new(2350, 17.998_765);
        let advance_s = elapsed_s * (1.0 + self.doppler_hz / 1.575_42e9);
        for (amplitude, delay_s, cycles) in [(200.0, 0.0, 0.0), (90.0, 0.37e-6, 0.3)] {
            rays.push(Ray {
                amplitude,
                arrival: Arrival {
                    code_time: start + (advance_s - delay_s),
                    carrier_cycles: self.doppler_hz * elapsed_s + cycles,
                },
            });
        }
        Ok(())
    }

    fn bit_sign(&mut self, second: GpsTime, _index: usize) -> Result<f32> {
        Ok(if second.second() % 2 == 0 { 1.0 } else { -1.0 })
    }
}

fn emitters() -> Vec<TwoRays> {
    [(3, 3210.0), (17, -4999.0), (31, 20.0)]
        .map(|(prn, doppler_hz)| TwoRays {
            prn,
            doppler_hz,
            silent_s: [4.000_1e-3, 6.3e-3],
        })
        .to_vec()
}

fn scene(format: SampleFormat, bandwidth_hz: Option<f64>, gaps: Vec<Gap>) -> Scene {
    let boxed = |emitter: TwoRays| Box::new(emitter) as Box<dyn Emitter>;
    Scene {
        reception: Reception {
            samples: SampleDescription {
                format,
                sample_rate_hz: RATE_HZ,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            bits: None,
            bandwidth_hz,
            gain: Gain::Fixed,
        },
        duration_s: 10e-3,
        emitters: emitters().into_iter().map(boxed).collect(),
        interference: vec![],
        gaps,
        seed: 4,
    }
}

fn bytes(scene: Scene, options: Options, piece: usize) -> Vec<u8> {
    struct Reader(Synthesiser);
    impl Read for Reader {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            SampleSource::read(&mut self.0, bytes)
        }
    }
    let mut reader = Reader(Synthesiser::with_options(scene, options).unwrap());
    let mut all = Vec::new();
    let mut buffer = vec![0; piece];
    loop {
        match reader.read(&mut buffer).unwrap() {
            0 => return all,
            read => all.extend_from_slice(&buffer[..read]),
        }
    }
}

const NOISELESS: Options = Options {
    threads: NonZeroUsize::new(1),
    thermal_noise: ThermalNoise::Absent,
};

/// I and Q of each sample.
fn samples(scene: Scene) -> Vec<[f64; 2]> {
    let bytes = bytes(scene, NOISELESS, 4096);
    let number = |four: &[u8]| f64::from(f32::from_le_bytes(four.try_into().unwrap()));
    let values: Vec<f64> = bytes.chunks_exact(4).map(number).collect();
    values.chunks_exact(2).map(|iq| [iq[0], iq[1]]).collect()
}

/// Sum of all rays at tick `k`, and whether a chip ends within 1e-5 chips (3 mm) of it.
fn ideal(emitters: &mut [TwoRays], k: usize) -> ([f64; 2], bool) {
    sum_of_rays(emitters, k as f64 / RATE_HZ)
}

fn sum_of_rays(emitters: &mut [TwoRays], elapsed_s: f64) -> ([f64; 2], bool) {
    let (mut sum, mut at_edge) = ([0.0, 0.0], false);
    for emitter in emitters {
        let mut rays = Vec::new();
        emitter.rays(elapsed_s, elapsed_s, &mut rays).unwrap();
        for ray in rays {
            let time = ray.arrival.code_time;
            let chips = time.fraction_s() * 1.023e6;
            at_edge |= !(1e-5..1.0 - 1e-5).contains(&chips.fract());
            let second = GpsTime::from_parts(time.week(), time.second().into(), 0.0);
            let chip = f64::from(ranging_code(emitter.signal())[chips as usize % 1023]);
            let level = ray.amplitude * chip * f64::from(emitter.bit_sign(second, 0).unwrap());
            let (sin, cos) = (TAU * ray.arrival.carrier_cycles).sin_cos();
            sum = [sum[0] + level * cos, sum[1] + level * sin];
        }
    }
    (sum, at_edge)
}

#[test]
fn every_sample_is_what_the_definition_says() {
    let made = samples(scene(SampleFormat::Cf32Le, None, vec![]));
    let mut emitters = emitters();
    assert_eq!(made.len(), 40_000);
    // The level at which samples are delivered is one factor throughout.
    let (mut across, mut power) = (0.0, 0.0);
    let all: Vec<_> = (0..made.len()).map(|k| ideal(&mut emitters, k)).collect();
    for ((ideal, _), made) in all.iter().zip(&made) {
        across += ideal[0] * made[0] + ideal[1] * made[1];
        power += ideal[0] * ideal[0] + ideal[1] * ideal[1];
    }
    let factor = across / power;
    let mut at_edges = 0;
    for (k, ((ideal, at_edge), made)) in all.iter().zip(&made).enumerate() {
        at_edges += usize::from(*at_edge);
        for (ideal, made) in ideal.iter().zip(made) {
            // 3e-5 of the largest sum, 870: single precision of the carriers.
            let error = (factor * ideal - made).abs() / factor;
            assert!(*at_edge || error < 0.026, "{error} at {k}");
        }
    }
    assert!(at_edges < 40, "{at_edges}");
}

#[test]
fn rays_begin_and_end_on_the_sample() {
    let made = samples(scene(SampleFormat::Cf32Le, None, vec![]));
    let silent = |k: usize| made[k] == [0.0, 0.0];
    // 4.0001 ms is tick 16000.4, 6.3 ms is tick 25200.
    assert!(!silent(16_000) && silent(16_001) && silent(25_199) && !silent(25_200));
}

#[test]
fn lost_samples_leave_the_others_as_they_were() {
    let gap = Gap {
        begin_s: 1e-3,
        duration_s: 2.5e-3,
    };
    let whole = bytes(
        scene(SampleFormat::Ci8, None, vec![]),
        Options::default(),
        512,
    );
    let holed = bytes(
        scene(SampleFormat::Ci8, None, vec![gap]),
        Options::default(),
        512,
    );
    // Complex samples of two bytes; the length delivered stays.
    assert_eq!(holed.len(), whole.len());
    assert_eq!(holed[..8_000], whole[..8_000]);
    assert_eq!(holed[8_000..60_000], whole[28_000..80_000]);
}

#[test]
fn a_level_that_follows_needs_no_whole_gap_in_memory_and_no_whole_bytes_before_it() {
    // The gap begins after 4001 samples and is longer than a block.
    let gap = Gap {
        begin_s: 4001.0 / RATE_HZ,
        duration_s: 13.3e-3,
    };
    let with = |format, threads, gaps| {
        let mut scene = scene(format, Some(2e6), gaps);
        scene.reception.gain = Gain::Automatic { time_s: 1e-3 };
        let options = Options {
            threads: NonZeroUsize::new(threads),
            ..Options::default()
        };
        bytes(scene, options, 1000)
    };
    for (format, length, before) in [
        (SampleFormat::C1Msb, 10_000, 1_000),
        (SampleFormat::R2Lsb, 10_000, 1_000),
        (SampleFormat::Ci8, 80_000, 8_002),
    ] {
        let holed = with(format, 1, vec![gap]);
        assert_eq!(holed.len(), length, "{format}");
        assert!(holed == with(format, 3, vec![gap]), "{format}");
        assert!(
            holed[..before] == with(format, 1, vec![])[..before],
            "{format}"
        );
    }
}

#[test]
fn threads_and_reads_of_any_size_give_the_same_bytes() {
    for (format, bandwidth_hz) in [
        (SampleFormat::Ci8, Some(3.2e6)),
        (SampleFormat::R2Lsb, None),
        (SampleFormat::C1Msb, Some(2e6)),
    ] {
        let with = |threads, piece| {
            let options = Options {
                threads: NonZeroUsize::new(threads),
                ..Options::default()
            };
            bytes(scene(format, bandwidth_hz, vec![]), options, piece)
        };
        let one = with(1, 4096);
        assert!(one == with(2, 777) && one == with(5, 100_000), "{format}");
    }
}
