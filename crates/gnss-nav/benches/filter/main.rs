//! Cost of one epoch of the navigation filters by number of satellites, each with a pseudorange
//! and a range rate.
//!
//! `sequential` and `batch` are predict and update of the library's filters, innovations given
//! (`innovations` is what forming these costs besides). The other groups are forms of the same
//! predict and update kept here for comparison: equation (15) of Jiang2017 with a general inverse,
//! Joseph's form with faer's Cholesky, and the information form, whose matrices stay 8 by 8.

mod forms;
mod sky;

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, BenchmarkId, Criterion, criterion_group, criterion_main,
};
use gnss_nav::filter::{BatchFilter, Innovations, NavFilter, SequentialFilter};
use gnss_nav::{GpsTime, Measurement, NavError};

const SATELLITES: [usize; 13] = [4, 5, 6, 7, 8, 9, 10, 12, 16, 20, 24, 28, 32];

/// A filter before an epoch, and the epoch.
struct Epoch<Filter> {
    filter: Filter,
    to: GpsTime,
    measurements: Vec<Measurement>,
    innovations: Innovations,
}

impl<Filter: NavFilter + Clone> Epoch<Filter> {
    fn new(filter: Filter, satellites: usize) -> Result<Self, NavError> {
        let to = filter.state().time + 0.1;
        let mut predicted = filter.clone();
        predicted.predict(to)?;
        let measurements = sky::measurements(predicted.state(), satellites);
        let innovations = predicted.innovations(&measurements)?;
        Ok(Self {
            filter,
            to,
            measurements,
            innovations,
        })
    }

    fn predict_and_update(&self, filter: &mut Filter) -> Result<usize, NavError> {
        filter.predict(black_box(self.to))?;
        Ok(filter.update(black_box(&self.innovations), &[])?.used)
    }
}

fn bench_filter<Filter: NavFilter + Clone>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    satellites: usize,
    filter: Result<Filter, NavError>,
) -> Result<(), NavError> {
    let epoch = Epoch::new(filter?, satellites)?;
    group.bench_function(BenchmarkId::new(name, satellites), |b| {
        b.iter_batched_ref(
            || epoch.filter.clone(),
            |filter| epoch.predict_and_update(filter),
            BatchSize::SmallInput,
        );
    });
    Ok(())
}

fn bench_satellites(criterion: &mut Criterion, satellites: usize) -> Result<(), NavError> {
    let mut group = criterion.benchmark_group("filter");
    let (state, covariance, settings) = (sky::state(), sky::covariance(), sky::settings());
    let sequential = SequentialFilter::new(state, covariance, settings);
    let batch = BatchFilter::new(state, covariance, settings);
    bench_filter(&mut group, "sequential", satellites, sequential.clone())?;
    bench_filter(&mut group, "batch", satellites, batch)?;
    let mut filter = sequential?;
    let epoch = Epoch::new(filter.clone(), satellites)?;
    filter.predict(epoch.to)?;
    group.bench_function(BenchmarkId::new("innovations", satellites), |b| {
        b.iter(|| filter.innovations(black_box(&epoch.measurements)));
    });
    let problem = forms::Problem::new(&covariance, &epoch.measurements, filter.state());
    for (name, form) in forms::ALL {
        group.bench_function(BenchmarkId::new(name, satellites), |b| {
            b.iter(|| form(black_box(&problem)));
        });
    }
    group.finish();
    Ok(())
}

#[allow(
    clippy::panic,
    reason = "a bench without its filter has nothing to measure"
)]
fn bench(criterion: &mut Criterion) {
    for satellites in SATELLITES {
        if let Err(error) = bench_satellites(criterion, satellites) {
            panic!("{satellites} satellites: {error}");
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
