//! Speed of synthesis: half a second of nine satellites at 2.6 MHz on one thread.

mod cpu_time;

use std::hint::black_box;
use std::num::NonZeroUsize;

use anyhow::{Result, ensure};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gnss_signal::sample::SampleSource;
use xtask::scenario::built::Scenario;
use xtask::scenario::catalogue;
use xtask::scenario::if_signal::{Options, Synthesiser, ThermalNoise};

use cpu_time::CpuTime;

const DURATION_S: f64 = 0.5;

/// The scenario with nine satellites, and these changes.
fn scenario(changes: &[&str]) -> Result<Scenario> {
    let file = catalogue::find("demo")?;
    let mut all = vec![format!("duration_s={DURATION_S:?}")];
    all.extend(changes.iter().map(|change| (*change).to_owned()));
    Scenario::new(&file.with(&all)?, None)
}

fn make(scenario: &Scenario, thermal_noise: ThermalNoise) -> Result<usize> {
    let options = Options {
        threads: NonZeroUsize::new(1),
        thermal_noise,
    };
    let mut source = Synthesiser::with_options(scenario.scene(), options)?;
    let (mut buffer, mut total) = (vec![0; 1 << 16], 0);
    loop {
        match source.read(&mut buffer)? {
            0 => return Ok(total),
            read => total += read,
        }
    }
}

fn all(criterion: &mut Criterion<CpuTime>) -> Result<()> {
    let plain = "front_end={format=\"ci8\", sample_rate_hz=2.6e6}";
    let cases = [
        ("no noise, no filter, 8 bits", plain, ThermalNoise::Absent),
        ("noise, filter, 8 bits", "seed=1", ThermalNoise::White),
        (
            "noise, filter, 1 bit",
            "front_end.format=c1_msb",
            ThermalNoise::White,
        ),
    ];
    let mut group = criterion.benchmark_group("synthesis");
    group.sample_size(20);
    for (name, change, noise) in cases {
        let scenario = scenario(&[change])?;
        let samples = DURATION_S * scenario.reception.samples.sample_rate_hz;
        let work = samples * scenario.heard.len() as f64;
        group.throughput(Throughput::Elements(work as u64));
        let mut failed = None;
        let mut shortest = usize::MAX;
        group.bench_function(name, |bencher| {
            bencher.iter(|| match make(&scenario, noise) {
                Ok(bytes) => shortest = shortest.min(black_box(bytes)),
                Err(error) => failed = Some(error),
            });
        });
        if let Some(error) = failed {
            return Err(error);
        }
        let bits = scenario.reception.samples.format.bits_per_sample() as f64;
        ensure!(
            shortest as f64 >= (samples * bits / 8.0).floor(),
            "{name}: {shortest} bytes of {samples} samples"
        );
    }
    group.finish();
    Ok(())
}

#[allow(clippy::panic)] // A benchmark that cannot run has nothing to report.
fn bench(criterion: &mut Criterion<CpuTime>) {
    if let Err(error) = all(criterion) {
        panic!("{error:#}");
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime);
    targets = bench
}
criterion_main!(benches);
