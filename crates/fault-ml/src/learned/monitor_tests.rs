//! Model files and the monitors made of them: made whole again, or refused.

use std::sync::Arc;

use serde_json::json;

use super::lstm::LstmCell;
use super::svm::SvmPredictor;
use super::*;
use crate::{ChannelMonitor, ChannelVerdict, Health};

fn card(kind: ModelKind, mode: Mode, window: usize) -> Card {
    Card {
        format: FORMAT.to_owned(),
        version: VERSION,
        kind,
        features: FeatureSet::Paper,
        window,
        mode,
        interval_s: 0.02,
        decide_every: 1,
        calibration: Calibration {
            slope: 2.0,
            offset: 0.5,
        },
        evidence: None,
        operating_point: OperatingPoint {
            threshold: 1.0,
            false_alarms_per_hour: 0.01,
            channel_hours: 3.0,
            extrapolated: true,
        },
        weights_fnv1a: String::new(),
        training: json!({"seed": 1}),
    }
}

fn scaler() -> Scaler {
    Scaler::new(vec![0.0, 0.0], vec![8.0, 0.2]).unwrap()
}

/// Faulty where a step of the window is far from zero.
fn svm(window: usize) -> LearnedModel {
    let zeros = vec![0.0; 2 * window];
    let machine = SvmPredictor::new(2 * window, &zeros, &[-2.0], 1.0, 0.1).unwrap();
    let card = card(ModelKind::Svm, Mode::Window, window);
    LearnedModel::new(card, scaler(), Network::Svm(machine)).unwrap()
}

fn lstm(mode: Mode) -> LearnedModel {
    let cell = LstmCell::new(lstm::test_weights(2, 9, 5)).unwrap();
    LearnedModel::new(
        card(ModelKind::Lstm, mode, 4),
        scaler(),
        Network::Lstm(cell),
    )
    .unwrap()
}

fn scores(monitor: &mut LearnedMonitor, steps: &[ChannelStep]) -> Vec<Option<f64>> {
    let score = |step| monitor.step(step).unwrap().judgement().map(|j| j.score());
    steps.iter().map(score).collect()
}

fn steps(count: u32) -> Vec<ChannelStep> {
    let wave = |k: u32, by: f64| (f64::from(k) * by).sin();
    let step = |k| ChannelStep::normal(7, wave(k, 0.7), wave(k, 1.3));
    (0..count).map(step).collect()
}

#[test]
fn a_model_is_read_as_it_was_written() {
    for model in [svm(3), lstm(Mode::Window), lstm(Mode::Streaming)] {
        let (weights, card) = model.save().unwrap();
        assert_eq!(LearnedModel::load(&weights, &card).unwrap(), model);
    }
}

#[test]
fn files_that_are_no_models_are_refused_by_what_is_wrong() {
    let (weights, card) = svm(3).save().unwrap();
    let refused = |weights: &[u8], card: &str, text: &str| {
        let error = LearnedModel::load(weights, card).unwrap_err().to_string();
        assert!(error.starts_with(text), "{error}");
    };
    let with = |key: &str, value: serde_json::Value| {
        let mut object: serde_json::Value = serde_json::from_str(&card).unwrap();
        object[key] = value;
        object.to_string()
    };
    refused(&weights, "{", "model card: damaged: ");
    refused(&weights, "{}", "model card: format is \"\"");
    refused(
        &weights,
        &with("format", json!("onnx")),
        "model card: format is \"onnx\"",
    );
    refused(
        &weights,
        &with("version", json!(VERSION + 1)),
        &format!("model card: version is {}: expected {VERSION}", VERSION + 1),
    );
    refused(
        &weights,
        &with("window", json!(0)),
        "model card: window: expected",
    );
    refused(
        &weights,
        &with("evidence", json!({"offset": 2.0, "most": 1.0})),
        "model card: evidence: expected an offset below",
    );
    refused(
        &weights,
        &with("colour", json!(0)),
        "model card: damaged: unknown field",
    );
    refused(
        &weights,
        &with("mode", json!("streaming")),
        "model card: mode: a support-vector",
    );
    refused(
        &weights,
        &with("window", json!(4)),
        "model weights: length of support vectors is 6",
    );
    refused(
        &weights,
        &with("kind", json!("lstm")),
        "model weights: no array \"lstm",
    );
    refused(&weights[..40], &card, "model weights: damaged");
    refused(b"", &card, "model weights: damaged");
    let mut damaged = weights.clone();
    *damaged.last_mut().unwrap() ^= 1;
    refused(&damaged, &card, "model weights: check sum");
    let (others, _) = lstm(Mode::Window).save().unwrap();
    refused(&others, &card, "model weights: check sum");
}

#[test]
fn any_cut_or_flipped_byte_is_refused_or_read() {
    let (weights, card) = svm(2).save().unwrap();
    for at in 0..weights.len() {
        assert!(LearnedModel::load(&weights[..at], &card).is_err());
        let mut flipped = weights.clone();
        flipped[at] ^= 0x11;
        assert!(LearnedModel::load(&flipped, &card).is_err(), "byte {at}");
    }
}

#[test]
fn it_warms_up_judges_and_starts_again_with_another_satellite() {
    let mut monitor = LearnedMonitor::new(Arc::new(svm(3)));
    let healths = [0.0, 0.0, 0.0, 9.0, 0.0].map(|code| {
        monitor
            .step(&ChannelStep::normal(7, code, 0.0))
            .unwrap()
            .health()
    });
    use Health::{Faulty, Healthy, WarmingUp};
    assert_eq!(healths, [WarmingUp, WarmingUp, Healthy, Faulty, Faulty]);
    let verdict = monitor.step(&ChannelStep::normal(8, 0.0, 0.0)).unwrap();
    assert_eq!(verdict, ChannelVerdict::WarmingUp { remaining_steps: 2 });
    monitor.reset();
    let again = scores(&mut monitor, &steps(5));
    let fresh = scores(&mut LearnedMonitor::new(Arc::new(svm(3))), &steps(5));
    assert_eq!(again, fresh);
}

#[test]
fn a_step_that_holds_no_numbers_leaves_no_trace() {
    for model in [svm(3), lstm(Mode::Window), lstm(Mode::Streaming)] {
        let model = Arc::new(model);
        let (mut one, mut other) = (
            LearnedMonitor::new(Arc::clone(&model)),
            LearnedMonitor::new(model),
        );
        let mut bad = ChannelStep::normal(7, f64::NAN, 0.0);
        for step in steps(8) {
            assert!(one.step(&bad).is_err());
            // Of another satellite, too.
            bad.satellite += 1;
            assert_eq!(one.step(&step), other.step(&step));
        }
    }
}

#[test]
fn streaming_remembers_what_a_window_has_forgotten() {
    let steps = steps(20);
    let window = scores(
        &mut LearnedMonitor::new(Arc::new(lstm(Mode::Window))),
        &steps,
    );
    let streaming = scores(
        &mut LearnedMonitor::new(Arc::new(lstm(Mode::Streaming))),
        &steps,
    );
    assert_eq!(window[..3], [None; 3]);
    assert_eq!(
        streaming[..4],
        window[..4],
        "the first window is all there is"
    );
    assert_ne!(streaming[4], window[4]);
    let late = scores(
        &mut LearnedMonitor::new(Arc::new(lstm(Mode::Window))),
        &steps[10..],
    );
    assert_eq!(late[3..], window[13..]);
}

#[test]
fn it_judges_as_often_as_its_card_says() {
    let model = svm(3);
    let mut card = model.card().clone();
    card.decide_every = 4;
    let rare = Arc::new(model.clone().with_card(card).unwrap());
    let all = scores(&mut LearnedMonitor::new(Arc::new(model)), &steps(12));
    let few = scores(&mut LearnedMonitor::new(rare), &steps(12));
    for (k, score) in few.iter().enumerate().skip(2) {
        assert_eq!(*score, all[2 + (k - 2) / 4 * 4], "step {k}");
    }
}
