//! Cost of learned monitors beside the libraries that train them:
//! `cargo bench -p fault-ml --features train --bench learned`.
#![allow(clippy::unwrap_used, missing_docs)]

use std::collections::HashMap;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use candle_core::{DType, Device, Tensor};
use candle_nn::VarBuilder;
use candle_nn::rnn::{LSTMConfig, RNN, lstm};
use criterion::{Criterion, criterion_group, criterion_main};
use fault_ml::learned::lstm::{LstmCell, LstmWeights};
use fault_ml::learned::svm::SvmPredictor;
use fault_ml::learned::{ChannelStep, FeatureSet, LearnedModel, LearnedMonitor, StrengthChange};
use fault_ml::{ChannelMonitor, Innovation};
use linfa::prelude::*;
use linfa_svm::Svm;
use ndarray::{Array1, Array2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HIDDEN: usize = 32;
const INPUTS: usize = FeatureSet::Full.width();
const STEPS: usize = 50;

fn uniform(count: usize, bound: f32) -> Vec<f32> {
    let mut random = ChaCha8Rng::seed_from_u64(count as u64);
    (0..count)
        .map(|_| random.random_range(-bound..bound))
        .collect()
}

fn layer(c: &mut Criterion) {
    let rows = 4 * HIDDEN;
    let weights = LstmWeights {
        inputs: INPUTS,
        hidden: HIDDEN,
        from_input: uniform(rows * INPUTS, 0.3),
        from_hidden: uniform(rows * HIDDEN, 0.3),
        bias: uniform(rows, 0.3),
        head: uniform(HIDDEN, 0.3),
        head_bias: 0.0,
    };
    let tensor = |values: &[f32], shape: (usize, usize)| {
        Tensor::from_vec(values.to_vec(), shape, &Device::Cpu).unwrap()
    };
    let bias = Tensor::from_vec(weights.bias.clone(), rows, &Device::Cpu).unwrap();
    let named = HashMap::from([
        (
            "weight_ih_l0".to_owned(),
            tensor(&weights.from_input, (rows, INPUTS)),
        ),
        (
            "weight_hh_l0".to_owned(),
            tensor(&weights.from_hidden, (rows, HIDDEN)),
        ),
        ("bias_ih_l0".to_owned(), bias),
    ]);
    let config = LSTMConfig {
        b_hh_init: None,
        ..LSTMConfig::default()
    };
    let builder = VarBuilder::from_tensors(named, DType::F32, &Device::Cpu);
    let candle = lstm(INPUTS, HIDDEN, config, builder).unwrap();
    let cell = LstmCell::new(weights).unwrap();
    let window = uniform(STEPS * INPUTS, 2.0);
    let mut state = cell.zero_state();
    c.bench_function("lstm: a step of the fused cell", |b| {
        b.iter(|| cell.step(&mut state, black_box(&window[..INPUTS])));
    });
    c.bench_function("lstm: a window of 50 of the fused cell", |b| {
        b.iter(|| cell.window(&mut state, black_box(&window)));
    });
    let input = Tensor::from_vec(window[..INPUTS].to_vec(), (1, INPUTS), &Device::Cpu).unwrap();
    let start = candle.zero_state(1).unwrap();
    c.bench_function("lstm: a step of candle", |b| {
        b.iter(|| candle.step(black_box(&input), &start).unwrap());
    });
}

fn machine(c: &mut Criterion) {
    for (dimensions, vectors) in [(50, 256), (60, 1700)] {
        let support = uniform(dimensions * vectors, 2.0);
        let weights = uniform(vectors, 1.0);
        let gamma = 0.5 / dimensions as f32;
        let machine = SvmPredictor::new(dimensions, &support, &weights, 0.0, gamma).unwrap();
        let window = uniform(dimensions, 2.0);
        c.bench_function(
            &format!("svm: {vectors} vectors of {dimensions}, flat"),
            |b| {
                b.iter(|| machine.decision(black_box(&window)));
            },
        );
    }
    // Labels without a pattern make nearly every row a support vector.
    let (rows, dimensions) = (600, 60);
    let values = uniform(rows * dimensions, 2.0)
        .into_iter()
        .map(f64::from)
        .collect();
    let records = Array2::from_shape_vec((rows, dimensions), values).unwrap();
    let labels: Array1<bool> = (0..rows).map(|k| (k * 7919) % 13 < 6).collect();
    let svm = Svm::<f64, bool>::params()
        .gaussian_kernel(f64::from(dimensions as u32) / 0.5)
        .fit(&DatasetBase::new(records.clone(), labels))
        .unwrap();
    let window = records.row(0).to_owned();
    let name = format!("svm: {} vectors of {dimensions}, linfa", svm.nsupport());
    c.bench_function(&name, |b| b.iter(|| svm.weighted_sum(black_box(&window))));
}

/// The monitors that come with the receiver, with their features and evidence: a second of signal.
fn product(c: &mut Criterion) {
    const CHANNELS: usize = 9;
    const EPOCHS: usize = 50;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/models");
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut step = || {
        let mut within = |bound: f64| random.random_range(-bound..bound);
        let innovation = Innovation {
            code_m: within(8.0),
            code_sigma_m: 5.0,
            rate_mps: within(0.08),
            rate_sigma_mps: 0.05,
        };
        ChannelStep {
            satellite: 7,
            innovation,
            given_others: innovation,
            cn0_dbhz: 42.0 + within(0.2),
            cn0_now_hz: 10_f64.powf(4.2 + within(0.1)),
            others_change: StrengthChange {
                smoothed_db: within(0.1),
                now_db: within(0.5),
            },
            tap_ratios: Some([0.75 + within(0.03), 0.75 + within(0.03)]),
        }
    };
    let steps: Vec<ChannelStep> = (0..CHANNELS * EPOCHS).map(|_| step()).collect();
    for name in ["svm", "lstm"] {
        let weights = std::fs::read(folder.join(format!("{name}.safetensors"))).unwrap();
        let card = std::fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
        let model = Arc::new(LearnedModel::load(&weights, &card).unwrap());
        let mut monitors = vec![LearnedMonitor::new(model); CHANNELS];
        c.bench_function(
            &format!("{name}: {CHANNELS} channels, {EPOCHS} steps each"),
            |b| {
                b.iter(|| {
                    for epoch in steps.chunks(CHANNELS) {
                        for (monitor, step) in monitors.iter_mut().zip(epoch) {
                            black_box(monitor.step(step).unwrap());
                        }
                    }
                });
            },
        );
    }
}

criterion_group!(benches, layer, machine, product);
criterion_main!(benches);
