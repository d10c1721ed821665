//! Sums of the bank against those of samples: means, variances and correlations of the taps.

use gnss_signal::sample::SampleFormat;
use gnss_signal::{CorrelatorBank, IfCorrelatorBank, InstructionSet, Replica, TapOffsets, Taps};
use nalgebra::{SMatrix, SVector};
use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::support::{Mismatch, Reflection, TestEmitter, lnav, path, reception, replica, scene};
use crate::scenario::antenna::{Gap, Reception, Scene};
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::correlator_level::noise::complex_normal;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::message::Message;
use crate::scenario::path::UniformPath;

const TAPS: usize = 4;
const TAPS_CHIPS: [f64; TAPS] = [-0.5, -0.25, 0.0, 0.4];

fn taps() -> TapOffsets {
    TapOffsets::new(&TAPS_CHIPS).unwrap()
}

/// Sums of both banks, over the root of samples times sample power.
struct Both {
    /// By replica and tap.
    drawn: Vec<Vec<Complex64>>,
    sampled: Vec<Vec<Complex64>>,
    /// Mean sample power of each.
    powers: [f64; 2],
    samples: f64,
}

fn sums(mut bank: impl CorrelatorBank, replicas: &[Replica]) -> (Vec<Vec<Complex64>>, f64) {
    let mut all = Vec::new();
    let mut power = 0.0;
    let mut taps: Vec<Taps> = Vec::new();
    for replica in replicas {
        bank.advance_to(replica.end_tick).unwrap();
        bank.correlate(&[*replica], &mut taps).unwrap();
        let white = f64::from(taps[0].samples) * taps[0].sample_power;
        all.push(
            taps[0]
                .as_slice()
                .iter()
                .map(|s| s / white.sqrt())
                .collect(),
        );
        power += taps[0].sample_power / replicas.len() as f64;
    }
    (all, power)
}

fn both(scene: impl Fn() -> Scene, replicas: &[Replica]) -> Both {
    let drawn = CorrelatorLevelBank::new(scene()).unwrap();
    let source = Synthesiser::new(scene()).unwrap();
    let sampled = IfCorrelatorBank::new(source, 0.1, InstructionSet::detect()).unwrap();
    let ((drawn, p), (sampled, q)) = (sums(drawn, replicas), sums(sampled, replicas));
    Both {
        drawn,
        sampled,
        powers: [p, q],
        samples: replicas
            .iter()
            .map(|r| (r.end_tick - r.start_tick) as f64)
            .sum(),
    }
}

type Vector = SVector<Complex64, TAPS>;
type Matrix = SMatrix<Complex64, TAPS, TAPS>;

/// Mean of each tap, and covariance of all pairs.
fn moments(sums: &[Vec<Complex64>]) -> (Vector, Matrix) {
    let n = sums.len() as f64;
    let vectors: Vec<Vector> = sums.iter().map(|s| Vector::from_column_slice(s)).collect();
    let mean = vectors.iter().sum::<Vector>() / Complex64::from(n);
    let products = vectors.iter().map(|v| (v - mean) * (v - mean).adjoint());
    (mean, products.sum::<Matrix>() / Complex64::from(n - 1.0))
}

/// What two sets of complex Gaussian vectors differ in, as chi-squares: their means (two degrees of
/// freedom a tap) and their covariances, real and imaginary parts (the square of the taps).
///
/// The second is twice the logarithm of the likelihood ratio of one covariance against two; the
/// terms beyond the chi-square are below 1 % with 400 vectors.
fn differences(a: &[Vec<Complex64>], b: &[Vec<Complex64>]) -> [f64; 2] {
    let n = a.len() as f64;
    let ((mean_a, cov_a), (mean_b, cov_b)) = (moments(a), moments(b));
    let both = cov_a + cov_b;
    let difference = mean_a - mean_b;
    let weighted = both.lu().solve(&difference).unwrap();
    let means = 2.0 * n * difference.dotc(&weighted).re;
    let log_determinant = |matrix: &Matrix| matrix.determinant().re.ln();
    let pooled = both / Complex64::from(2.0);
    let ratio = 2.0 * log_determinant(&pooled) - log_determinant(&cov_a) - log_determinant(&cov_b);
    [means, 2.0 * (n - 1.0) * ratio]
}

/// What a chi-square exceeds as seldom as a normal number leaves three standard errors.
fn three_standard_errors(degrees: usize) -> f64 {
    let distribution = ChiSquared::new(degrees as f64).unwrap();
    distribution.inverse_cdf(0.997_300_2)
}

/// Means, variances and correlations within three standard errors, jointly: each of two dozen
/// by itself would leave them in one case of sixteen.
fn assert_agreement(name: &str, both: &Both) {
    let [means, covariances] = differences(&both.drawn, &both.sampled);
    let limit = three_standard_errors(2 * TAPS + TAPS * TAPS);
    assert!(
        means + covariances < limit,
        "{name}: chi-squares {means} of means, {covariances} of covariances; limit {limit}"
    );
    // The mean of N squares of nearly Gaussian numbers errs by 1.5 / sqrt(N), twice.
    let [p, q] = both.powers;
    let error = 3.0 * 1.5 * 2f64.sqrt() / both.samples.sqrt();
    assert!(
        (p / q - 1.0).abs() < error.max(1e-4),
        "{name}: sample power {p} and {q}"
    );
}

#[test]
fn differences_are_those_of_their_definition() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut draw = |gain: f64, shift: f64, turn: Complex64| -> Vec<Vec<Complex64>> {
        let mut one = || {
            let z: [Complex64; TAPS] = std::array::from_fn(|_| complex_normal(&mut random));
            vec![gain * z[0] + shift, z[1], z[2] + turn * z[1], z[3]]
        };
        (0..400).map(|_| one()).collect()
    };
    let plain = draw(1.0, 0.0, Complex64::ZERO);
    let limit = three_standard_errors(TAPS * TAPS);
    let [means, covariances] = differences(&plain, &draw(1.0, 0.0, Complex64::ZERO));
    assert!(means < three_standard_errors(2 * TAPS) && covariances < limit);
    // Half a deviation of a mean is seven of its standard errors; 1.5 dB of power and an
    // imaginary correlation of 0.3 are five and six.
    assert!(differences(&plain, &draw(1.0, 0.5, Complex64::ZERO))[0] > 40.0);
    assert!(differences(&plain, &draw(1.19, 0.0, Complex64::ZERO))[1] > limit);
    assert!(differences(&plain, &draw(1.0, 0.0, 0.3 * Complex64::I))[1] > limit);
}

/// Replicas one after the other, each `periods` of a millisecond, all with the same mismatch.
fn successive(
    reception: &Reception,
    path: &UniformPath,
    count: u64,
    ticks: u64,
    mismatch: Mismatch,
) -> Vec<Replica> {
    (0..count)
        .map(|k| {
            replica(
                reception,
                path,
                (k * ticks, k * ticks),
                ticks,
                taps(),
                mismatch,
            )
        })
        .collect()
}

struct Case {
    name: &'static str,
    format: SampleFormat,
    bits: Option<u8>,
    rate_hz: f64,
    bandwidth: Option<f64>,
    cn0_dbhz: f64,
    reflections: Vec<Reflection>,
    mismatch: Mismatch,
}

const NEAR: Mismatch = Mismatch {
    code_chips: 0.13,
    frequency_hz: 0.0,
    phase_cycles: 0.1,
};

fn compare(case: &Case) {
    let reception = Reception {
        bits: case.bits,
        ..reception(case.format, case.rate_hz, case.bandwidth)
    };
    let path = path(1_234.0);
    let replicas = successive(
        &reception,
        &path,
        400,
        (case.rate_hz * 1e-3) as u64,
        case.mismatch,
    );
    let scene = || {
        let mut emitter = TestEmitter::new(case.cn0_dbhz, path, Message::Unmodulated);
        emitter.reflections.clone_from(&case.reflections);
        scene(reception, 0.41, vec![emitter])
    };
    assert_agreement(case.name, &both(scene, &replicas));
}

fn case(name: &'static str, format: SampleFormat) -> Case {
    Case {
        name,
        format,
        bits: None,
        rate_hz: 2.6e6,
        bandwidth: None,
        cn0_dbhz: 45.0,
        reflections: vec![],
        mismatch: NEAR,
    }
}

#[test]
fn direct_signals_agree_in_every_number_of_bits() {
    use SampleFormat::{C1Msb, Ci8, R1Msb, R2Lsb, Ri8};
    for format in [Ci8, C1Msb, Ri8, R2Lsb, R1Msb] {
        compare(&case(format.name(), format));
    }
    for bits in [1, 2, 4] {
        compare(&Case {
            bits: Some(bits),
            ..case("fewer bits", Ci8)
        });
    }
}

#[test]
fn filtered_signals_agree() {
    for (format, bandwidth) in [
        (SampleFormat::Ci8, 0.8),
        (SampleFormat::C1Msb, 0.8),
        (SampleFormat::Ri8, 0.5),
        (SampleFormat::R2smMsb, 0.8),
    ] {
        compare(&Case {
            bandwidth: Some(bandwidth),
            ..case(format.name(), format)
        });
    }
}

#[test]
fn reflections_agree() {
    let reflections = vec![
        Reflection {
            amplitude: 0.5,
            delay_chips: 0.3,
            phase_cycles: 0.5,
        },
        Reflection {
            amplitude: 0.7,
            delay_chips: 1.4,
            phase_cycles: 0.2,
        },
    ];
    for bandwidth in [None, Some(0.8)] {
        compare(&Case {
            reflections: reflections.clone(),
            bandwidth,
            ..case("reflections", SampleFormat::Ci8)
        });
    }
}

#[test]
fn weak_and_absent_signals_agree() {
    for cn0_dbhz in [25.0, -100.0] {
        compare(&Case {
            cn0_dbhz,
            ..case("weak", SampleFormat::R2Lsb)
        });
    }
}

#[test]
fn frequency_offsets_agree() {
    let mismatch = Mismatch {
        frequency_hz: 430.0,
        ..NEAR
    };
    compare(&Case {
        mismatch,
        ..case("430 Hz", SampleFormat::Ci8)
    });
}

#[test]
fn whole_samples_in_a_chip_agree() {
    for bandwidth in [None, Some(0.8)] {
        compare(&Case {
            rate_hz: 4.092e6,
            bandwidth,
            ..case("4.092 Msps", SampleFormat::Ci8)
        });
    }
}

/// Each sum against the same of samples: all differences are noise of both.
fn assert_same_signal(name: &str, both: &Both, noise: f64) {
    let pairs = both.drawn.iter().zip(&both.sampled);
    for tap in 0..TAPS {
        let squares: f64 = pairs
            .clone()
            .map(|(a, b)| (a[tap] - b[tap]).norm_sqr())
            .sum();
        let n = both.drawn.len() as f64;
        let mean = squares / n / (2.0 * noise);
        // The mean of n exponential numbers.
        assert!(
            (mean - 1.0).abs() < 3.0 / n.sqrt(),
            "{name}: tap {tap}: {mean}"
        );
    }
}

#[test]
fn bits_edges_and_gaps_fall_on_the_same_samples() {
    let reception = reception(SampleFormat::Ci8, 2.6e6, None);
    let path = path(-2_345.0);
    let gap = Gap {
        begin_s: 0.3,
        duration_s: 0.011_3,
    };
    let scene = |gaps: Vec<Gap>| {
        let mut emitter = TestEmitter::new(52.0, path, lnav(path.code_time));
        emitter.edges_s = vec![0.1, 0.133, 0.2, 0.201_7];
        Scene {
            gaps,
            ..scene(reception, 0.5, vec![emitter])
        }
    };
    // 7 ms, out of step with the bits.
    let ticks = 18_200;
    let replicas = successive(&reception, &path, 70, ticks, NEAR);
    let both = both(|| scene(vec![]), &replicas);
    // Noise of unit density lies 52 dB-Hz below a signal that adds 0.12 of its power.
    let signal_part = 10f64.powf(5.2) / 2.6e6;
    assert_same_signal("bits", &both, 1.0 / (1.0 + signal_part));
    let (mut whole, mut cut) = (
        CorrelatorLevelBank::new(scene(vec![])).unwrap(),
        CorrelatorLevelBank::new(scene(vec![gap])).unwrap(),
    );
    whole.advance_to(1_300_000).unwrap();
    cut.advance_to(1_300_000).unwrap();
    let (mut a, mut b) = (Vec::new(), Vec::new());
    // 0.0113 s are 29 380 samples; nothing changes before them.
    let (before, after) = (750_000, 900_000);
    for (tick, at) in [(before, before), (after, after + 29_380)] {
        let one = replica(&reception, &path, (tick, at), 26_000, taps(), NEAR);
        let other = replica(&reception, &path, (at, at), 26_000, taps(), NEAR);
        cut.correlate(&[one], &mut a).unwrap();
        whole.correlate(&[other], &mut b).unwrap();
        let difference = a[0].as_slice()[2] - b[0].as_slice()[2];
        let deviation = (26_000.0 * a[0].sample_power).sqrt();
        // Noise of both, four deviations; the prompt sum has 40.
        assert!(difference.norm() < 4.0 * 2f64.sqrt() * deviation);
    }
}

#[test]
fn an_interval_correlated_again_has_the_same_sums() {
    let (reception, path) = (reception(SampleFormat::Ci8, 2.6e6, Some(0.8)), path(-800.0));
    let emitter = || TestEmitter::new(45.0, path, lnav(path.code_time));
    let bank = || {
        let mut bank = CorrelatorLevelBank::new(scene(reception, 1.5, vec![emitter()])).unwrap();
        bank.advance_to(2_600_000).unwrap();
        bank
    };
    let replicas = successive(&reception, &path, 8, 26_000, NEAR);
    let correlated = |bank: &mut CorrelatorLevelBank, replicas: &[Replica]| {
        let mut taps = Vec::new();
        bank.correlate(replicas, &mut taps).unwrap();
        taps.iter()
            .map(|t| (t.as_slice().to_vec(), t.sample_power))
            .collect::<Vec<_>>()
    };
    let mut one = bank();
    let first = correlated(&mut one, &replicas);
    // Again, after time has gone on, and by another bank that is asked the other way round.
    one.advance_to(3_000_000).unwrap();
    assert!(correlated(&mut one, &replicas) == first);
    let backwards: Vec<Replica> = replicas.iter().rev().copied().collect();
    let mut other = correlated(&mut bank(), &backwards);
    other.reverse();
    assert!(other == first);
}
