//! Scores of monitors over sequences, whichever monitor it is.

use anyhow::Result;
use fault_ml::learned::{Dataset, HealthyScores, LearnedModel, LearnedMonitor, Sequence};
use fault_ml::{ChannelMonitor, InnovationTest};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Exceedances closer than this belong to one alarm, s.
const ALARM_S: f64 = 2.0;

/// A monitor under examination.
#[derive(Debug, Clone)]
pub enum Examinee {
    /// The innovation test.
    Innovation(InnovationTest),
    /// A trained model.
    Learned(Arc<LearnedModel>),
}

impl Examinee {
    /// Its score at every step of `sequence`; `None` where it does not judge.
    ///
    /// # Errors
    /// Where a step holds no numbers.
    pub fn scores(&self, sequence: &Sequence) -> Result<Vec<Option<f64>>> {
        match self {
            Self::Innovation(test) => {
                let mut test = test.clone();
                let steps = sequence.steps.iter().map(|s| {
                    let verdict = test.step(&s.step.innovation)?;
                    Ok(verdict.judgement().map(fault_ml::Judgement::score))
                });
                steps.collect()
            }
            Self::Learned(model) => {
                let mut monitor = LearnedMonitor::new(Arc::clone(model));
                let steps = sequence.steps.iter().map(|s| {
                    let verdict = monitor.step(&s.step)?;
                    Ok(verdict.judgement().map(fault_ml::Judgement::score))
                });
                steps.collect()
            }
        }
    }

    /// Its scores at every step of every sequence of `data`.
    ///
    /// # Errors
    /// As [`Examinee::scores`].
    pub fn all_scores(&self, data: &Dataset) -> Result<Vec<Vec<Option<f64>>>> {
        data.sequences
            .iter()
            .map(|sequence| self.scores(sequence))
            .collect()
    }
}

/// Adds to `healthy` the scores of all channels of each scenario until a fault befalls one of them: what is false can
/// only be told while nothing is wrong, for an error that is not found yet lies in the innovations of all.
pub fn add_healthy(
    healthy: &mut HealthyScores,
    data: &Dataset,
    scores: &[Vec<Option<f64>>],
    interval_s: f64,
) {
    let mut onsets_s: BTreeMap<u32, f64> = BTreeMap::new();
    for sequence in data.sequences.iter().filter(|s| !s.fault.is_empty()) {
        let first = sequence.steps.iter().find(|s| s.label.is_faulty());
        let begin_s = first.map_or(f64::NEG_INFINITY, |s| s.time_s);
        let onset_s = onsets_s.entry(sequence.scenario).or_insert(begin_s);
        // A satellite's signal may be lost and come back: the part of it with the fault counts.
        *onset_s = onset_s.max(begin_s);
    }
    for (sequence, scores) in data.sequences.iter().zip(scores) {
        let onset_s = onsets_s.get(&sequence.scenario).copied();
        let onset_s = onset_s.unwrap_or(f64::INFINITY);
        let steps = sequence.steps.iter().zip(scores);
        let before = steps.take_while(|(s, _)| s.time_s < onset_s);
        let judged: Vec<f64> = before.filter_map(|(_, score)| *score).collect();
        healthy.add(&judged, interval_s, (ALARM_S / interval_s) as usize);
    }
}
