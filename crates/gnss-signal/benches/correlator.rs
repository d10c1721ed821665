//! Throughput of the correlator: samples a second of one channel on one core, carrier wipe-off,
//! code replica and all taps included.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use gnss_signal::{Correlator, FrontEnd, InstructionSet, Replica, SignalId, TapOffsets};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SETS: [InstructionSet; 4] = [
    InstructionSet::Avx512,
    InstructionSet::Avx2,
    InstructionSet::Portable,
    InstructionSet::Reference,
];

fn replica(front_end: FrontEnd, samples: u64, taps: TapOffsets) -> Option<Replica> {
    Some(Replica {
        signal: SignalId::gps_l1_ca(7).ok()?,
        start_tick: 0,
        end_tick: samples,
        code_phase_chips: 500.3,
        code_rate_hz: 1.023e6 + 1.7,
        carrier_phase_cycles: 0.1,
        carrier_frequency_hz: front_end.intermediate_frequency_hz + 2_617.0,
        tap_offsets: taps,
    })
}

fn eleven_taps() -> Option<TapOffsets> {
    let chips: [f64; 11] = std::array::from_fn(|k| (k as f64 - 5.0) / 10.0);
    TapOffsets::new(&chips).ok()
}

fn bench(criterion: &mut Criterion) {
    let fronts = [
        ("real_16.368_Msps", 16.368e6, 4.092e6, false),
        // Changes of the code lie anywhere between samples.
        ("real_16.369_Msps", 16.369e6, 4.092e6, false),
        ("real_12_Msps", 12e6, 3e6, false),
        ("complex_2.6_Msps", 2.6e6, 0.0, true),
    ];
    for (name, sample_rate_hz, intermediate_frequency_hz, complex) in fronts {
        let front_end = FrontEnd {
            sample_rate_hz,
            intermediate_frequency_hz,
            complex,
        };
        for (taps, offsets) in [
            (
                "early_prompt_late",
                Some(TapOffsets::early_prompt_late(0.5)),
            ),
            ("11_taps", eleven_taps()),
        ] {
            let mut group = criterion.benchmark_group(format!("{name}/{taps}"));
            for ms in [1, 20] {
                let samples = (sample_rate_hz * 1e-3) as u64 * ms;
                let replica = offsets.and_then(|taps| replica(front_end, samples, taps));
                group.throughput(Throughput::Elements(samples));
                for set in SETS {
                    let correlator = Correlator::new(front_end, set).ok();
                    let (Some(mut correlator), Some(replica)) = (correlator, replica) else {
                        continue;
                    };
                    let values = noise(samples as usize * if complex { 2 } else { 1 });
                    group.bench_function(BenchmarkId::new(set.name(), format!("{ms}_ms")), |b| {
                        b.iter(|| correlator.correlate(black_box(&values), 800.0, &replica));
                    });
                }
            }
            group.finish();
        }
    }
}

fn noise(count: usize) -> Vec<i8> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    (0..count).map(|_| rng.random_range(-48..=48)).collect()
}

criterion_group!(benches, bench);
criterion_main!(benches);
