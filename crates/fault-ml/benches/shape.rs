//! What a channel pays for the chart on its shape, an epoch: `cargo bench -p fault-ml --bench shape`.
#![allow(clippy::expect_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use fault_ml::ChannelMonitor;
use fault_ml::shape::{
    ChartSettings, EwmaChart, SHAPE_TAPS_CHIPS, Shape, ShapeMonitor, ShapeSettings, largest_tap,
};
use std::hint::black_box;

fn shapes(c: &mut Criterion) {
    let magnitudes = SHAPE_TAPS_CHIPS.map(|x| 100.0 * (1.0 - (x + 0.03).abs()));
    let mut monitor = ShapeMonitor::new(ShapeSettings::default()).expect("default settings");
    c.bench_function("shape/monitor", |b| {
        b.iter(|| {
            let magnitudes = black_box(magnitudes);
            monitor.step(&Shape { magnitudes })
        });
    });
    let mut chart = EwmaChart::new(ChartSettings::default()).expect("default settings");
    c.bench_function("shape/largest-tap-and-chart", |b| {
        b.iter(|| {
            let observed = largest_tap(&SHAPE_TAPS_CHIPS, black_box(&magnitudes));
            chart.step(observed.unwrap_or(0.0));
            chart.is_outside()
        });
    });
}

criterion_group!(benches, shapes);
criterion_main!(benches);
