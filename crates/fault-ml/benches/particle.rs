//! Cost of one epoch of ten filters: `cargo bench -p fault-ml --bench particle`.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use fault_ml::Sight;
use fault_ml::particle::{
    ClockState, Likelihood, Movement, ParticleParameters, ParticleRaim, SwarmOrder, SwarmSettings,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Nine satellites, residuals of about 2 m.
fn sights(random: &mut ChaCha8Rng) -> Vec<Sight> {
    (0..9)
        .map(|id| {
            let azimuth = f64::from(id) * 0.698;
            let elevation = 0.3 + 0.13 * f64::from(id);
            Sight {
                id,
                design: [
                    -azimuth.sin() * elevation.cos(),
                    -azimuth.cos() * elevation.cos(),
                    -elevation.sin(),
                    1.0,
                ],
                residual_m: random.random_range(-4.0..4.0),
                sigma_m: 3.0,
            }
        })
        .collect()
}

fn epoch(c: &mut Criterion, name: &str, parameters: ParticleParameters) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let epochs: Vec<_> = (0..64).map(|_| sights(&mut random)).collect();
    let mut raim = ParticleRaim::new(parameters.check().unwrap(), random);
    let mut time = 0;
    c.bench_function(name, |b| {
        b.iter(|| {
            time += 1;
            raim.epoch(f64::from(time), &epochs[time as usize % 64])
                .unwrap()
        });
    });
}

fn particle(c: &mut Criterion) {
    let swarm = |order| {
        Movement::Swarm(SwarmSettings {
            order,
            ..SwarmSettings::default()
        })
    };
    let pf = ParticleParameters::wang2016(Movement::Bootstrap);
    let pso = ParticleParameters::wang2016(swarm(SwarmOrder::WeighThenMove));
    let corrected = ParticleParameters::wang2016(swarm(SwarmOrder::Corrected));
    let likelihood = Likelihood::HEAVY_TAILED;
    let clock = ClockState::Marginalised;
    epoch(c, "ten filters, N = 50: PF", pf);
    epoch(c, "ten filters, N = 50: PSO-PF", pso);
    epoch(c, "ten filters, N = 50: PSO-PF corrected", corrected);
    epoch(
        c,
        "ten filters, N = 50: PF, mixture",
        ParticleParameters { likelihood, ..pf },
    );
    epoch(
        c,
        "ten filters, N = 50: PSO-PF, mixture",
        ParticleParameters { likelihood, ..pso },
    );
    epoch(
        c,
        "ten filters, N = 50: PF, clock integrated out",
        ParticleParameters { clock, ..pf },
    );
}

criterion_group!(benches, particle);
criterion_main!(benches);
