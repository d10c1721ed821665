//! Interference, an automatic gain and lost samples together: the same bytes on any number of
//! threads, and every fault still on its sample.

use std::num::NonZeroUsize;

use gnss_signal::sample::SampleFormat;

use super::{Options, TwoRays, bytes, emitters, scene};
use crate::scenario::antenna::{Emitter, Gain, Gap, Interference, Pulses, Scene, Waveform};
use crate::scenario::profile::Profile;

/// Samples 4000 to 6800 and 18 000 to 20 000 of the antenna are lost.
const GAPS: [Gap; 2] = [
    Gap {
        begin_s: 1e-3,
        duration_s: 0.7e-3,
    },
    Gap {
        begin_s: 4.5e-3,
        duration_s: 0.5e-3,
    },
];

fn interference(waveform: Waveform, span_s: (f64, f64), pulses: Option<Pulses>) -> Interference {
    Interference {
        waveform,
        level_dbhz: Profile::new(vec![(span_s.0, 58.0), (span_s.1, 61.0)]).unwrap(),
        pulses,
    }
}

/// Everything at once: satellites that are silent over `silent_s`, a tone over `tone_s`.
fn everything(
    format: SampleFormat,
    bandwidth_hz: Option<f64>,
    silent_s: [f64; 2],
    tone_s: (f64, f64),
) -> Scene {
    let sweep = Waveform::Chirp {
        from_hz: -400e3,
        to_hz: 700e3,
        period_s: 0.31e-3,
    };
    let pulses = Pulses {
        period_s: 0.37e-3,
        duty: 0.4,
    };
    let tone = Waveform::Tone { offset_hz: 222e3 };
    let noise = Waveform::Broadband { width_hz: 1e6 };
    let mut scene = scene(format, bandwidth_hz, GAPS.to_vec());
    scene.reception.gain = Gain::Automatic { time_s: 1e-3 };
    scene.interference = vec![
        interference(tone, tone_s, None),
        interference(sweep, (0.2e-3, 9.1e-3), Some(pulses)),
        interference(noise, (3.3e-3, 20e-3), None),
    ];
    let silent = |emitter| TwoRays {
        silent_s,
        ..emitter
    };
    let boxed = |emitter: TwoRays| Box::new(silent(emitter)) as Box<dyn Emitter>;
    scene.emitters = emitters().into_iter().map(boxed).collect();
    scene
}

fn on_threads(scene: Scene, threads: usize, piece: usize) -> Vec<u8> {
    let options = Options {
        threads: NonZeroUsize::new(threads),
        ..Options::default()
    };
    bytes(scene, options, piece)
}

#[test]
fn threads_give_the_same_bytes_with_interference_gain_and_gaps() {
    for (format, bandwidth_hz) in [
        (SampleFormat::Ci8, Some(3.2e6)),
        (SampleFormat::R2Lsb, None),
        (SampleFormat::C1Msb, Some(2e6)),
    ] {
        let scene = || everything(format, bandwidth_hz, [4.000_1e-3, 6.3e-3], (2e-3, 7.1e-3));
        let one = on_threads(scene(), 1, 4096);
        let as_one = one == on_threads(scene(), 2, 777) && one == on_threads(scene(), 5, 100_000);
        assert!(as_one, "{format}");
    }
}

/// Number of the first sample (of 8 bytes) that differs.
fn first_difference(a: &[u8], b: &[u8]) -> Option<usize> {
    assert_eq!(a.len(), b.len());
    a.chunks(8).zip(b.chunks(8)).position(|(a, b)| a != b)
}

const NEVER_S: f64 = 1.0;
const SILENT_S: [f64; 2] = [4.000_1e-3, 6.3e-3];
const TONE_S: (f64, f64) = (5.000_03e-3, 7.1e-3);

fn made(silent_s: [f64; 2], tone_s: (f64, f64)) -> Vec<u8> {
    let scene = everything(SampleFormat::Cf32Le, None, silent_s, tone_s);
    on_threads(scene, 2, 4096)
}

#[test]
fn faults_keep_to_the_sample_with_interference_gain_and_gaps() {
    let faulty = made(SILENT_S, TONE_S);
    // Tick 16 000.4, after 2800 lost ones.
    let never_silent = made([NEVER_S, NEVER_S + 1.0], TONE_S);
    assert_eq!(
        first_difference(&faulty, &never_silent),
        Some(16_001 - 2_800)
    );
    // Tick 25 200, after 4800.
    let silent_on = made([SILENT_S[0], NEVER_S], TONE_S);
    assert_eq!(first_difference(&faulty, &silent_on), Some(25_200 - 4_800));
}

#[test]
fn interference_keeps_to_the_sample_with_gain_and_gaps() {
    let steady = |tone_s: (f64, f64)| {
        let mut scene = everything(SampleFormat::Cf32Le, None, SILENT_S, tone_s);
        // Levels that do not depend on where the profile ends.
        scene.interference[0].level_dbhz =
            Profile::new(vec![(tone_s.0, 60.0), (tone_s.1, 60.0)]).unwrap();
        on_threads(scene, 2, 4096)
    };
    let (with, without) = (steady(TONE_S), steady((NEVER_S, NEVER_S + 1.0)));
    // Tick 20 000.12.
    assert_eq!(first_difference(&with, &without), Some(20_001 - 4_800));
    let endless = steady((TONE_S.0, NEVER_S));
    assert_eq!(first_difference(&with, &endless), Some(28_400 - 4_800));
}

#[test]
fn samples_are_lost_behind_the_gain() {
    // Single precision differs by its last bit where a block is cut otherwise; signs do not.
    let scene = || everything(SampleFormat::C1Msb, None, SILENT_S, TONE_S);
    let mut whole = scene();
    whole.gaps.truncate(1);
    let (whole, holed) = (on_threads(whole, 2, 4096), on_threads(scene(), 2, 4096));
    // Four samples a byte.
    let [begin, end, last] = [18_000 - 2_800, 20_000 - 2_800, 40_000].map(|tick| tick / 4);
    assert!(holed[..begin] == whole[..begin]);
    assert!(holed[begin..last - (end - begin)] == whole[end..last]);
}
