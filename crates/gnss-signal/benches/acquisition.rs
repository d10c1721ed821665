//! Cost of acquisition: `cargo bench -p gnss-signal --bench acquisition`.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use gnss_signal::{AcquisitionEngine, FrontEnd, SearchRequest, SignalId};
use rand::{RngExt, SeedableRng};

fn search(c: &mut Criterion, name: &str, half_width_hz: f64, plan: (u32, u32)) {
    let front_end = FrontEnd {
        sample_rate_hz: 2.6e6,
        intermediate_frequency_hz: 0.0,
        complex: true,
    };
    let request = SearchRequest {
        signals: (1..=32)
            .map(|prn| SignalId::gps_l1_ca(prn).unwrap())
            .collect(),
        start_tick: 0,
        doppler_centre_hz: 0.0,
        doppler_half_width_hz: half_width_hz,
        coherent_periods: plan.0,
        noncoherent_sums: plan.1,
        false_alarm_probability: 1e-3,
    };
    let count = AcquisitionEngine::samples_needed(front_end, &request);
    let mut generator = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let samples: Vec<i8> = (0..2 * count)
        .map(|_| if generator.random::<bool>() { 1 } else { -1 })
        .collect();
    let mut engine = AcquisitionEngine::new(front_end).unwrap();
    c.bench_function(name, |b| {
        b.iter(|| engine.search(&samples, &request).unwrap());
    });
}

fn acquisition(c: &mut Criterion) {
    search(c, "32 PRN, +-5 kHz, 1 x 1 ms, 2.6 Msps", 5e3, (1, 1));
    search(c, "32 PRN, +-12 kHz, 4 x 15 ms, 2.6 Msps", 12e3, (4, 15));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = acquisition
}
criterion_main!(benches);
