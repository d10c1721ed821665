//! The trained monitors that come with the receiver.

use std::sync::Arc;

use fault_ml::learned::{LearnedError, LearnedModel, ModelKind};

/// Weights and card of the default of each kind.
const SVM: (&[u8], &str) = (
    include_bytes!("../../../assets/models/svm.safetensors"),
    include_str!("../../../assets/models/svm.json"),
);
const LSTM: (&[u8], &str) = (
    include_bytes!("../../../assets/models/lstm.safetensors"),
    include_str!("../../../assets/models/lstm.json"),
);

/// The default model of a kind.
///
/// # Errors
/// [`LearnedError::Model`] where it was damaged before this program was built.
pub fn default_model(kind: ModelKind) -> Result<Arc<LearnedModel>, LearnedError> {
    let (weights, card) = match kind {
        ModelKind::Svm => SVM,
        ModelKind::Lstm => LSTM,
    };
    LearnedModel::load(weights, card).map(Arc::new)
}

#[cfg(test)]
mod tests {
    use fault_ml::learned::{ChannelStep, LearnedMonitor, StrengthChange};
    use fault_ml::{ChannelMonitor, Innovation};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::pipeline::VectorSettings;

    /// A healthy channel as the receiver shows it: C/N0 of an integration within 0.8 dB.
    fn healthy(random: &mut ChaCha8Rng) -> ChannelStep {
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let innovation = Innovation {
            code_m: 0.85 * 5.0 * normal(),
            code_sigma_m: 5.0,
            rate_mps: 0.04 * normal(),
            rate_sigma_mps: 0.05,
        };
        ChannelStep {
            satellite: 7,
            innovation,
            given_others: innovation,
            cn0_dbhz: 42.0 + 0.1 * normal(),
            cn0_now_hz: 10_f64.powf(4.2 + 0.08 * normal()),
            others_change: StrengthChange {
                smoothed_db: 0.05 * normal(),
                now_db: 0.3 * normal(),
            },
            tap_ratios: Some([0.75 + 0.02 * normal(), 0.75 + 0.02 * normal()]),
        }
    }

    #[test]
    fn both_are_whole_and_of_the_filter_s_rate() {
        for kind in [ModelKind::Svm, ModelKind::Lstm] {
            let model = default_model(kind).unwrap();
            let card = model.card();
            assert_eq!(
                (card.kind, card.interval_s),
                (kind, VectorSettings::default().interval_s)
            );
            // Half of what is stated.
            assert_eq!(card.operating_point.false_alarms_per_hour, 0.005);
        }
    }

    #[test]
    fn an_hour_of_a_healthy_channel_does_not_make_them_drift() {
        for kind in [ModelKind::Svm, ModelKind::Lstm] {
            let mut random = ChaCha8Rng::seed_from_u64(9);
            let mut monitor = LearnedMonitor::new(default_model(kind).unwrap());
            // 50 steps a second: the first and the last five minutes.
            let (hour, part) = (180_000, 15_000);
            let mut means = [0.0; 2];
            for step in 0..hour {
                let verdict = monitor.step(&healthy(&mut random)).unwrap();
                assert!(!verdict.is_faulty(), "step {step}");
                let score = verdict.judgement().map_or(0.0, |j| j.score());
                if step < part {
                    means[0] += score / f64::from(part);
                } else if step >= hour - part {
                    means[1] += score / f64::from(part);
                }
            }
            // Scores scatter by about one and repeat themselves over a second: 300 independent ones each.
            assert!((means[0] - means[1]).abs() < 0.4, "{means:?}");
        }
    }
}
