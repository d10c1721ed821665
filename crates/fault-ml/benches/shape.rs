//! What a channel pays for the chart on its shape, an epoch: `cargo bench -p fault-ml --bench shape`.
#![allow(clippy::expect_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use fault_ml::ChannelMonitor;
use fault_ml::shape::{
    ChartSettings, EwmaChart, SHAPE_TAPS_CHIPS, Shape, ShapeMonitor, ShapeSettings, largest_tap,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;

/// Shapes as a tracked signal has them, each with its noise: what never changes would leave the monitor with a variance
/// that is no normal number.
fn noisy_shapes() -> Vec<Shape> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut noisy = |x: f64| 100.0 * (1.0 - (x + 0.03).abs()) + random.random_range(-5.0..5.0);
    let shape = |_| Shape {
        magnitudes: SHAPE_TAPS_CHIPS.map(&mut noisy),
    };
    (0..1024).map(shape).collect()
}

fn shapes(c: &mut Criterion) {
    let shapes = noisy_shapes();
    let mut all = shapes.iter().cycle();
    let mut next = move || all.next();
    let mut monitor = ShapeMonitor::new(ShapeSettings::default()).expect("default settings");
    c.bench_function("shape/monitor", |b| {
        b.iter(|| next().map(|shape| monitor.step(black_box(shape))));
    });
    let mut all = shapes.iter().cycle();
    let mut next = move || all.next();
    let mut chart = EwmaChart::new(ChartSettings::default()).expect("default settings");
    c.bench_function("shape/largest-tap-and-chart", |b| {
        b.iter(|| {
            let observed =
                next().and_then(|s| largest_tap(&SHAPE_TAPS_CHIPS, &black_box(s).magnitudes));
            chart.step(observed.unwrap_or(0.0));
            chart.is_outside()
        });
    });
}

criterion_group!(benches, shapes);
criterion_main!(benches);
