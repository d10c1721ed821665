//! Windows of a data set: drawn so that kinds weigh the same and none repeats another.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::dataset::{Dataset, Label, Sequence, draw};
use super::{FeatureSet, FeatureTrack, Features, LearnedError, Scaler};

/// Widths of the classes of C/N0, dB.
const CLASS_DB: f64 = 5.0;

/// Windows of one length, scaled; the label of each is that of its newest step.
#[derive(Debug, Clone, PartialEq)]
pub struct Windows {
    length: usize,
    width: usize,
    values: Vec<f32>,
    labels: Vec<Label>,
    /// The label of every step, oldest first.
    step_labels: Vec<Label>,
}

/// Where a window ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowEnd {
    /// Which sequence.
    pub sequence: usize,
    /// Its newest step.
    pub newest: usize,
}

/// What windows are drawn evenly over: label, newness of it, fault, class of C/N0.
type Stratum<'a> = (bool, bool, &'a str, i64);

/// Class of `cn0_dbhz`: multiples of 5 dB-Hz, from half below to half above.
#[must_use]
pub fn cn0_class_dbhz(cn0_dbhz: f64) -> i64 {
    (CLASS_DB * (cn0_dbhz / CLASS_DB).round()) as i64
}

/// Ends of at most `count` windows of `length` steps: half faulty, half healthy, of each as many as there are; within
/// each, evenly over how new the label is (changed within the window or not), the fault and the class of C/N0. Windows
/// that no change of label is in are half a window apart: closer ones would nearly repeat each other.
#[must_use]
pub fn choose(data: &Dataset, length: usize, count: usize, seed: u64) -> Vec<WindowEnd> {
    let mut strata: BTreeMap<Stratum, Vec<WindowEnd>> = BTreeMap::new();
    for (index, sequence) in data.sequences.iter().enumerate() {
        collect(&mut strata, (index, sequence), length);
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut chosen = Vec::new();
    for label in [false, true] {
        let mut groups: Vec<&Vec<WindowEnd>> = Vec::new();
        groups.extend(
            strata
                .iter()
                .filter(|(s, _)| s.0 == label)
                .map(|(_, ends)| ends),
        );
        // The smallest first: what it cannot fill is left to the others.
        groups.sort_by_key(|ends| ends.len());
        let mut wanted = count / 2;
        for (number, ends) in groups.iter().enumerate() {
            let share = wanted / (groups.len() - number);
            let drawn = draw(ends, share, &mut random);
            wanted -= drawn.len();
            chosen.extend(drawn);
        }
    }
    draw(&chosen, chosen.len(), &mut random)
}

fn collect<'a>(
    strata: &mut BTreeMap<Stratum<'a>, Vec<WindowEnd>>,
    (index, sequence): (usize, &'a Sequence),
    length: usize,
) {
    let mut since = None;
    let mut before = None;
    for (newest, step) in sequence.steps.iter().enumerate() {
        since = match before {
            Some(label) if label != step.label => Some(0),
            _ => since.map(|n: usize| n + 1),
        };
        before = Some(step.label);
        let is_new = since.is_some_and(|n| n < length);
        // All of the first steps after a change, one in four of the later ones.
        let apart = match since {
            Some(n) if n < 4 => 1,
            _ if is_new => (length / 4).clamp(1, 4),
            _ => length.div_ceil(2),
        };
        if newest + 1 < length || !newest.is_multiple_of(apart) {
            continue;
        }
        let class = cn0_class_dbhz(step.step.cn0_dbhz);
        let faulty = step.label.is_faulty();
        let fault = if faulty { sequence.fault.as_str() } else { "" };
        let stratum = (faulty, is_new, fault, class);
        let end = WindowEnd {
            sequence: index,
            newest,
        };
        strata.entry(stratum).or_default().push(end);
    }
}

/// Features of every step of `data`, sequence by sequence.
///
/// # Errors
/// Where a step holds no numbers.
pub fn features(data: &Dataset, set: FeatureSet) -> Result<Vec<Vec<Features>>, LearnedError> {
    let of_sequence = |sequence: &Sequence| {
        let mut track = FeatureTrack::new(set);
        let steps = sequence.steps.iter().map(|s| track.next(&s.step));
        steps.collect::<Result<Vec<_>, _>>()
    };
    Ok(data
        .sequences
        .iter()
        .map(of_sequence)
        .collect::<Result<_, _>>()?)
}

/// A scaler by the healthy steps of `data`, whose `features` these are.
///
/// # Errors
/// Where there are none.
pub fn healthy_scaler(data: &Dataset, features: &[Vec<Features>]) -> Result<Scaler, LearnedError> {
    let healthy = |(sequence, features): (&'_ Sequence, &'_ Vec<Features>)| {
        let labelled = sequence.steps.iter().zip(features);
        let healthy = labelled.filter(|(step, _)| !step.label.is_faulty());
        healthy.map(|(_, features)| *features).collect::<Vec<_>>()
    };
    let rows: Vec<Features> = data
        .sequences
        .iter()
        .zip(features)
        .flat_map(healthy)
        .collect();
    Ok(Scaler::fit(rows.iter())?)
}

impl Windows {
    /// The windows of `length` steps that end at `ends`.
    #[must_use]
    pub fn gather(
        data: &Dataset,
        features: &[Vec<Features>],
        scaler: &Scaler,
        length: usize,
        ends: &[WindowEnd],
    ) -> Self {
        let mut windows = Self::empty(length, scaler.width());
        for end in ends {
            let (sequence, rows) = (data.sequences.get(end.sequence), features.get(end.sequence));
            let (Some(sequence), Some(rows), Some(first)) =
                (sequence, rows, (end.newest + 1).checked_sub(length))
            else {
                continue;
            };
            let (Some(rows), Some(steps)) = (
                rows.get(first..=end.newest),
                sequence.steps.get(first..=end.newest),
            ) else {
                continue;
            };
            let labels = steps.iter().map(|s| s.label);
            windows.push(rows.iter().flat_map(|row| scaler.scaled(row)), labels);
        }
        windows
    }

    /// No windows yet.
    #[must_use]
    pub const fn empty(length: usize, width: usize) -> Self {
        Self {
            length,
            width,
            values: Vec::new(),
            labels: Vec::new(),
            step_labels: Vec::new(),
        }
    }

    /// Adds a window and the labels of its steps.
    fn push(&mut self, values: impl Iterator<Item = f32>, labels: impl Iterator<Item = Label>) {
        self.values.extend(values);
        self.step_labels.extend(labels);
        self.labels.extend(self.step_labels.last());
    }

    /// Number of windows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.labels.len()
    }

    /// How many are faulty.
    #[must_use]
    pub fn faulty(&self) -> usize {
        self.labels.iter().filter(|l| l.is_faulty()).count()
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Steps of a window.
    #[must_use]
    pub const fn length(&self) -> usize {
        self.length
    }

    /// Features of a step.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Numbers of a window.
    #[must_use]
    pub const fn dimensions(&self) -> usize {
        self.length * self.width
    }

    /// All windows, one after the other: by window, step (oldest first), feature.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Label of each window.
    #[must_use]
    pub fn labels(&self) -> &[Label] {
        &self.labels
    }

    /// Labels of all steps: by window, step.
    #[must_use]
    pub fn step_labels(&self) -> &[Label] {
        &self.step_labels
    }

    /// Whether there are healthy and faulty ones.
    #[must_use]
    pub fn has_both_kinds(&self) -> bool {
        [Label::Healthy, Label::Faulty]
            .iter()
            .all(|l| self.labels.contains(l))
    }
}

/// Made-up windows for tests of trainings.
#[cfg(test)]
pub(super) mod testing {
    use rand::RngExt;
    use rand_distr::StandardNormal;

    use super::*;

    impl Windows {
        /// Those whose label `keep` says.
        pub(crate) fn filtered(&self, keep: impl Fn(Label) -> bool) -> Self {
            let mut kept = Self::empty(self.length, self.width);
            let rows = self.values.chunks(self.dimensions());
            let steps = self.step_labels.chunks(self.length);
            for ((row, steps), label) in rows.zip(steps).zip(&self.labels) {
                if keep(*label) {
                    kept.push(row.iter().copied(), steps.iter().copied());
                }
            }
            kept
        }
    }

    /// Windows of one step: two rings, the outer one faulty.
    pub(crate) fn rings(count: usize, seed: u64) -> Windows {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut windows = Windows::empty(1, 2);
        for k in 0..count {
            let label = if k % 2 == 0 {
                Label::Healthy
            } else {
                Label::Faulty
            };
            let middle = if label.is_faulty() { 3.0 } else { 1.0 };
            let radius = middle + 0.3 * random.sample::<f32, _>(StandardNormal);
            let (sin, cos) = random.random_range(0.0..std::f32::consts::TAU).sin_cos();
            windows.push(
                [radius * cos, radius * sin].into_iter(),
                [label].into_iter(),
            );
        }
        windows
    }

    /// Windows of noise whose deviation is three times as large from some step on, in every other one.
    pub(crate) fn swellings(count: usize, length: usize, seed: u64) -> Windows {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut windows = Windows::empty(length, 2);
        for k in 0..count {
            let onset = if k % 2 == 0 {
                length
            } else {
                random.random_range(0..length * 3 / 4)
            };
            let label = |step| {
                if step < onset {
                    Label::Healthy
                } else {
                    Label::Faulty
                }
            };
            let labels: Vec<Label> = (0..length).map(label).collect();
            let values: Vec<f32> = labels
                .iter()
                .flat_map(|label| [*label; 2])
                .map(|label| {
                    let size = if label.is_faulty() { 3.0 } else { 1.0 };
                    size * random.sample::<f32, _>(StandardNormal)
                })
                .collect();
            windows.push(values.into_iter(), labels.into_iter());
        }
        windows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::ChannelStep;
    use crate::learned::dataset::LabelledStep;

    fn data() -> Dataset {
        let sequence = |scenario: u32| {
            let step = |k: u32| LabelledStep {
                time_s: f64::from(k) * 0.02,
                step: ChannelStep {
                    cn0_dbhz: 30.0 + 5.0 * f64::from(scenario % 4),
                    ..ChannelStep::normal(3, f64::from(k), f64::from(scenario))
                },
                label: if k < 300 {
                    Label::Healthy
                } else {
                    Label::Faulty
                },
            };
            Sequence {
                scenario,
                fault: ["blocked", "ramp"][scenario as usize % 2].to_owned(),
                steps: (0..400).map(step).collect(),
            }
        };
        Dataset {
            sequences: (0..8).map(sequence).collect(),
        }
    }

    #[test]
    fn kinds_faults_and_classes_weigh_the_same() {
        let data = data();
        let ends = choose(&data, 10, 160, 2);
        assert_eq!(ends.len(), 160);
        let mut seen = BTreeMap::new();
        for end in &ends {
            let sequence = &data.sequences[end.sequence];
            let step = &sequence.steps[end.newest];
            let new = sequence.since_change(end.newest).is_some_and(|n| n < 10);
            let key = (
                step.label.is_faulty(),
                new,
                cn0_class_dbhz(step.step.cn0_dbhz),
            );
            *seen.entry(key).or_insert(0) += 1;
        }
        // 80 of each kind: healthy, four classes; faulty, new or not and four classes.
        assert_eq!(seen[&(false, false, 35)], 20);
        assert_eq!(seen[&(true, true, 35)], 10);
        assert_eq!(seen[&(true, false, 40)], 10);
        let mut once = ends.clone();
        once.sort_by_key(|e| (e.sequence, e.newest));
        once.dedup();
        assert_eq!(once.len(), ends.len());
        assert_eq!(ends, choose(&data, 10, 160, 2));
    }

    #[test]
    fn a_window_holds_its_steps_and_the_label_of_the_newest() {
        let data = data();
        let set = FeatureSet::Paper;
        let features = features(&data, set).unwrap();
        let scaler = Scaler::new(vec![0.0, 0.0], vec![1000.0, 1.0]).unwrap();
        let end = WindowEnd {
            sequence: 1,
            newest: 300,
        };
        let windows = Windows::gather(&data, &features, &scaler, 3, &[end]);
        let code = |k: f32| 8.0 * k / 1000.0;
        let expected = [code(298.0), 0.2, code(299.0), 0.2, code(300.0), 0.2];
        for (found, expected) in windows.values().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{:?}", windows.values());
        }
        assert_eq!(windows.labels(), [Label::Faulty]);
        assert_eq!(windows.step_labels()[..2], [Label::Healthy; 2]);
        assert_eq!((windows.len(), windows.dimensions()), (1, 6));
    }
}
