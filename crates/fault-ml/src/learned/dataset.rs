//! Labelled steps of channels, kept by scenario.

use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::ChannelStep;

/// What is true of a channel at a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Label {
    /// Its signal is what it should be.
    Healthy,
    /// A fault befalls it.
    Faulty,
}

impl Label {
    /// Whether it is [`Label::Faulty`].
    #[must_use]
    pub const fn is_faulty(self) -> bool {
        matches!(self, Self::Faulty)
    }
}

/// A step and what is true of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelledStep {
    /// When, s since the scenario began.
    pub time_s: f64,
    /// What is seen.
    pub step: ChannelStep,
    /// What is true.
    pub label: Label,
}

/// Successive steps of one channel, none missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// The scenario it is from.
    pub scenario: u32,
    /// What befalls the channel in it; empty: nothing.
    pub fault: String,
    /// The steps, by time.
    pub steps: Vec<LabelledStep>,
}

impl Sequence {
    /// Steps since the label last changed before step `index`; `None` where it has not changed yet.
    #[must_use]
    pub fn since_change(&self, index: usize) -> Option<usize> {
        let newest = self.steps.get(index)?.label;
        let before = self.steps.iter().take(index + 1).rev();
        let same = before.take_while(|s| s.label == newest).count();
        (same <= index).then_some(same - 1)
    }
}

/// Sequences of many scenarios.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Dataset {
    /// The sequences.
    pub sequences: Vec<Sequence>,
}

/// A data set in parts that share no scenario.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Split {
    /// To fit to.
    pub training: Dataset,
    /// To stop, calibrate and find thresholds by.
    pub validation: Dataset,
    /// To judge by.
    pub test: Dataset,
}

impl Dataset {
    /// Numbers of its scenarios, each once, ascending.
    #[must_use]
    pub fn scenarios(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self.sequences.iter().map(|s| s.scenario).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Number of steps.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.sequences.iter().map(|s| s.steps.len()).sum()
    }

    /// Parts of whole scenarios, drawn by `seed`: a share of `validation` and one of `test`, the rest
    /// for training. Steps of one scenario resemble each other: shared between parts, they would be
    /// remembered rather than recognised.
    #[must_use]
    pub fn split(self, validation: f64, test: f64, seed: u64) -> Split {
        let mut order = self.scenarios();
        order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let count = |share: f64| (share * order.len() as f64).round() as usize;
        let (first, second) = (count(validation), count(validation) + count(test));
        let place = |scenario| {
            order
                .iter()
                .position(|s| *s == scenario)
                .unwrap_or(usize::MAX)
        };
        let mut split = Split::default();
        for sequence in self.sequences {
            let part = match place(sequence.scenario) {
                p if p < first => &mut split.validation,
                p if p < second => &mut split.test,
                _ => &mut split.training,
            };
            part.sequences.push(sequence);
        }
        split
    }

    /// The sequences that `keep` says.
    #[must_use]
    pub fn filtered(&self, keep: impl Fn(&Sequence) -> bool) -> Self {
        let kept = self.sequences.iter().filter(|s| keep(s));
        Self {
            sequences: kept.cloned().collect(),
        }
    }
}

/// `count` of `items` without repetition, in a random order; all where there are fewer.
pub(super) fn draw<T: Copy>(items: &[T], count: usize, random: &mut impl Rng) -> Vec<T> {
    let mut order = items.to_vec();
    order.shuffle(random);
    order.truncate(count);
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn sequence(scenario: u32, labels: &[Label]) -> Sequence {
        let step = |(k, label): (usize, &Label)| LabelledStep {
            time_s: k as f64 * 0.02,
            step: ChannelStep::normal(1, k as f64, 0.0),
            label: *label,
        };
        Sequence {
            scenario,
            fault: "blocked".to_owned(),
            steps: labels.iter().enumerate().map(step).collect(),
        }
    }

    #[test]
    fn parts_share_no_scenario_and_lose_none() {
        let sequences = (0..40)
            .map(|k| sequence(k / 2, &[Label::Healthy]))
            .collect();
        let data = Dataset { sequences };
        let split = data.clone().split(0.2, 0.1, 3);
        let parts = [&split.training, &split.validation, &split.test];
        assert_eq!(parts.map(|p| p.scenarios().len()), [14, 4, 2]);
        let mut all: Vec<u32> = parts.iter().flat_map(|p| p.scenarios()).collect();
        all.sort_unstable();
        assert_eq!(all, (0..20).collect::<Vec<u32>>());
        assert_eq!(parts.map(Dataset::steps).iter().sum::<usize>(), 40);
        assert_eq!(split, data.clone().split(0.2, 0.1, 3));
        assert_ne!(split, data.split(0.2, 0.1, 4));
    }

    #[test]
    fn a_change_is_counted_from() {
        use Label::{Faulty, Healthy};
        let sequence = sequence(1, &[Healthy, Healthy, Faulty, Faulty, Healthy]);
        let since = [0, 1, 2, 3, 4, 5].map(|k| sequence.since_change(k));
        assert_eq!(since, [None, None, Some(0), Some(1), Some(0), None]);
    }
}
