//! Accuracy by the number of innovations (Figure 5 of Jiang2017, Figure 6 of Zhu2020): a blocked channel, raw
//! innovations, the receiver of the papers.

use anyhow::Result;
use fault_ml::learned::lstm::LstmTraining;
use fault_ml::learned::svm::SvmTraining;
use fault_ml::learned::{
    Calibration, Card, Dataset, FORMAT, FeatureSet, HealthyScores, LearnedModel, Mode, ModelKind,
    Network, OperatingPoint, Sequence, Split, VERSION, WindowEnd, Windows, choose, cn0_class_dbhz,
    features, healthy_scaler,
};
use fault_ml::metrics::BalancedAccuracy;
use gnss_nav::tracking_noise;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use receiver::pipeline::{MeasurementNoise, Settings};
use serde_json::json;

use super::evaluate::best_cut;
use super::fit::{calibrated, with_evidence};
use super::label::labelled;
use super::scoring::{Examinee, add_healthy};
use crate::judged;
use crate::reproduce::jiang2017::receivers::{INTERVAL_S, Variant};
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::make::Level;

/// Classes of C/N0 before the front end, dB-Hz.
pub const CLASSES_DBHZ: [i64; 4] = [30, 35, 40, 45];
/// Numbers of innovations.
pub const LENGTHS: [usize; 7] = [5, 10, 20, 30, 50, 75, 100];
/// Early to late of the papers' receivers, chips.
const SPACING_CHIPS: f64 = 1.0;
/// Signal of a run and onset of the blockage, s.
const DURATION_S: f64 = 19.0;
/// Signal of a run in which nothing is blocked, s.
const QUIET_S: f64 = 45.0;
const ONSET_S: (f64, f64) = (12.0, 15.0);
/// How long a blockage lasts that ends, s.
const PASSING_S: (f64, f64) = (0.2, 2.0);
/// Every run begins at this C/N0, dB-Hz, and falls to its class between these times, s: below 35 dB-Hz it takes
/// long before the filter can take over, which is not what is studied.
const BEGIN_DBHZ: i64 = 45;
const FALL_S: (f64, f64) = (8.0, 9.0);

/// What befalls a flight of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flight {
    /// One satellite is blocked.
    Blocked,
    /// One satellite is blocked, in every second flight only for a while.
    BlockedOrPassing,
    /// Nothing.
    Quiet,
}

/// A scenario of the study: a flight of the papers'.
///
/// # Errors
/// Where it cannot be made.
pub fn scenario(flight: Flight, cn0_dbhz: i64, seed: u64) -> Result<Scenario> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let victims = [7, 8, 24, 17, 19, 11, 20];
    let victim = victims[random.random_range(0..victims.len())];
    let begin_s = random.random_range(ONSET_S.0..ONSET_S.1);
    let blocked = format!("kind = 'blocked', sat = 'G{victim:02}', begin_s = {begin_s:.3}");
    let (duration_s, fault) = match flight {
        Flight::BlockedOrPassing if random.random_bool(0.5) => {
            let end_s = begin_s + random.random_range(PASSING_S.0..PASSING_S.1);
            (DURATION_S, format!("{{ {blocked}, end_s = {end_s:.3} }}"))
        }
        Flight::Blocked | Flight::BlockedOrPassing => (DURATION_S, format!("{{ {blocked} }}")),
        Flight::Quiet => (QUIET_S, String::new()),
    };
    let overrides = [
        format!(
            "cn0={{ fixed_dbhz = {cn0_dbhz}, schedule = [[0, {excess}], [{from}, {excess}], [{to}, 0]] }}",
            excess = BEGIN_DBHZ - cn0_dbhz,
            from = FALL_S.0,
            to = FALL_S.1,
        ),
        format!("duration_s={duration_s:?}"),
        format!("fault=[{fault}]"),
    ];
    Scenario::new(
        &catalogue::find("jiang2017-1")?.with(&overrides)?,
        Some(seed),
    )
}

/// The papers' receiver, every update reported, its noise that of the class, the innovation test excluding; what its
/// filter took in before an alarm it keeps.
#[must_use]
pub fn settings(scenario: &Scenario, cn0_dbhz: i64) -> Settings {
    let mut settings = Variant::PaperExcluding.settings(scenario);
    settings.rate_hz = 1.0 / INTERVAL_S;
    let cn0_dbhz = cn0_dbhz as f64;
    if let Some(vector) = &mut settings.vector {
        vector.hindsight_s = 0.0;
        vector.noise = MeasurementNoise::Fixed {
            pseudorange_m2: tracking_noise::code_variance_m2(cn0_dbhz, INTERVAL_S, SPACING_CHIPS),
            range_rate_m2_s2: tracking_noise::sum_pair_rate_variance_m2_s2(cn0_dbhz, INTERVAL_S),
        };
    }
    settings
}

/// Labelled steps of `seeds` runs of every class, made at `level`; the scenario's number tells the class.
///
/// # Errors
/// Where a run fails.
pub fn harvest(flight: Flight, seeds: usize, first_seed: u64, level: Level) -> Result<Dataset> {
    let all = judged::in_parallel(CLASSES_DBHZ.len() * seeds, |number| {
        let cn0_dbhz = CLASSES_DBHZ[number % CLASSES_DBHZ.len()];
        let scenario = scenario(flight, cn0_dbhz, first_seed + number as u64)?;
        let judged = judged::receive(&scenario, level, &settings(&scenario, cn0_dbhz))?;
        let elapsed_s = |time_s| scenario.elapsed_s(time_s);
        let mut data = labelled(
            number as u32,
            &judged.channels,
            &scenario.accounts,
            elapsed_s,
        );
        for sequence in &mut data.sequences {
            sequence.steps.retain(|step| step.time_s >= FALL_S.1);
        }
        data.sequences.retain(|sequence| !sequence.steps.is_empty());
        // Classes are those of the scenario; a blocked channel has no C/N0 of its own.
        for step in data.sequences.iter_mut().flat_map(|s| &mut s.steps) {
            step.step.cn0_dbhz = cn0_dbhz as f64;
        }
        Ok(data)
    })?;
    Ok(Dataset {
        sequences: all.into_iter().flat_map(|part| part.sequences).collect(),
    })
}

/// Accuracy of one model.
#[derive(Debug, Clone)]
pub struct Accuracy {
    /// Over all windows.
    pub all: BalancedAccuracy,
    /// Without those in which the channel became faulty.
    pub steady: BalancedAccuracy,
    /// By class of C/N0, dB-Hz.
    pub by_class: Vec<(i64, BalancedAccuracy)>,
    /// The same without those in which the channel became faulty.
    pub steady_by_class: Vec<(i64, BalancedAccuracy)>,
}

impl Accuracy {
    /// Balanced accuracy in class number `index`, over all windows or those in which nothing changes; zero where
    /// there is no such class.
    #[must_use]
    pub fn of_class(&self, index: usize, steady: bool) -> f64 {
        let classes = if steady {
            &self.steady_by_class
        } else {
            &self.by_class
        };
        classes
            .get(index)
            .map_or(0.0, |(_, accuracy)| accuracy.value())
    }
}

/// Windows that a layer is trained on, and a machine: the cost of its kernel grows with their square.
const LAYER_WINDOWS: usize = 6000;
const MACHINE_WINDOWS: usize = 1200;
/// Passes over them at most.
const PASSES: usize = 20;
/// One window in so many is judged; a number that divides no other period here.
const JUDGED_EVERY: usize = 7;
/// The paper's number of innovations of the LSTM.
pub const LSTM_LENGTH: usize = 50;
/// That of Jiang2017, of the machine.
pub const SVM_LENGTH: usize = 30;
/// First seeds of what is learned from and of what is judged by: no scenario is in both, nor in those of the
/// flights.
pub const LEARNED_FROM: u64 = 2_000_001;
/// See [`LEARNED_FROM`].
pub const JUDGED_BY: u64 = 1_000_001;
/// See [`LEARNED_FROM`].
const QUIET_FROM: u64 = 3_000_001;
/// Part of what is learned from that is held out, to stop by and for thresholds.
const HELD_OUT: f64 = 0.25;
/// A monitor that flies has learned from classes from this one on, dB-Hz: flights are at 43, and raw innovations do
/// not say of which class they are, so that weaker ones would set its threshold.
const FLOWN_FROM_DBHZ: f64 = 40.0;
/// False alarms of a channel an hour in a flight.
const FLIGHT_ALARMS_PER_HOUR: f64 = 0.1;

/// What a monitor that flies is learned from.
#[derive(Debug, Clone)]
pub struct Lessons {
    /// Flights with a blockage, some of them held out.
    blocked: Split,
    /// Flights without one, that thresholds are found by.
    quiet: Dataset,
}

/// `seeds` runs of every class with what `flight` says, at the correlator level, a quarter of them held out.
///
/// # Errors
/// Where a run fails.
pub fn lessons_of(flight: Flight, seeds: usize) -> Result<Split> {
    let data = harvest(flight, seeds, LEARNED_FROM, Level::Correlator)?;
    Ok(data.split(HELD_OUT, 0.0, 1))
}

/// `seeds` runs of every class and a quarter as many in which nothing is blocked. Some blockages end: a layer that
/// has never seen one end holds a channel faulty for a whole window after two large innovations by chance.
///
/// # Errors
/// Where a run fails.
pub fn lessons(seeds: usize) -> Result<Lessons> {
    let quiet = seeds.div_ceil(4);
    Ok(Lessons {
        blocked: lessons_of(Flight::BlockedOrPassing, seeds)?,
        quiet: harvest(Flight::Quiet, quiet, QUIET_FROM, Level::Correlator)?,
    })
}

/// A monitor of the paper's own number of innovations, ready to fly.
///
/// # Errors
/// Where there is too little to learn from.
pub fn monitor(kind: ModelKind, lessons: &Lessons) -> Result<LearnedModel> {
    let length = match kind {
        ModelKind::Svm => SVM_LENGTH,
        ModelKind::Lstm => LSTM_LENGTH,
    };
    let split = Split {
        training: flown(&lessons.blocked.training),
        validation: flown(&lessons.blocked.validation),
        test: Dataset::default(),
    };
    let (held_out, quiet) = (&split.validation, &flown(&lessons.quiet));
    let model = calibrated(fit(kind, length, &split, 1)?, held_out)?;
    with_evidence(model, held_out, FLIGHT_ALARMS_PER_HOUR, |examinees| {
        let scores = |examinee: &Examinee| {
            let mut healthy = HealthyScores::default();
            let scores = examinee.all_scores(quiet)?;
            add_healthy(&mut healthy, quiet, &scores, INTERVAL_S);
            Ok(healthy)
        };
        examinees.iter().map(scores).collect()
    })
}

/// What of `data` is as strong as a flight.
fn flown(data: &Dataset) -> Dataset {
    let strong = |s: &&Sequence| s.steps.iter().all(|s| s.step.cn0_dbhz >= FLOWN_FROM_DBHZ);
    Dataset {
        sequences: data.sequences.iter().filter(strong).cloned().collect(),
    }
}

/// Trains a model of `kind` on windows of `length` raw innovations.
///
/// # Errors
/// Where there is too little to learn from.
pub fn fit(kind: ModelKind, length: usize, split: &Split, seed: u64) -> Result<LearnedModel> {
    let set = FeatureSet::Paper;
    let rows = features(&split.training, set)?;
    let scaler = healthy_scaler(&split.training, &rows)?;
    let gather = |data: &Dataset, rows: &[Vec<_>], count| {
        let ends = choose(data, length, count, seed);
        Windows::gather(data, rows, &scaler, length, &ends)
    };
    let count = match kind {
        ModelKind::Svm => MACHINE_WINDOWS,
        ModelKind::Lstm => LAYER_WINDOWS,
    };
    let training = gather(&split.training, &rows, count);
    let network = match kind {
        ModelKind::Svm => {
            let settings = SvmTraining {
                largest: usize::MAX,
                ..SvmTraining::default()
            };
            Network::Svm(settings.fit(&training)?.predictor)
        }
        ModelKind::Lstm => {
            let held_out = features(&split.validation, set)?;
            let validation = gather(&split.validation, &held_out, LAYER_WINDOWS / 4);
            let settings = LstmTraining {
                mode: Mode::Window,
                epochs: PASSES,
                seed,
                ..LstmTraining::default()
            };
            Network::Lstm(settings.fit(&training, &validation)?.cell)
        }
    };
    let card = Card {
        format: FORMAT.to_owned(),
        version: VERSION,
        kind,
        features: set,
        window: length,
        mode: Mode::Window,
        interval_s: INTERVAL_S,
        decide_every: 1,
        calibration: Calibration::NONE,
        evidence: None,
        operating_point: OperatingPoint {
            threshold: 0.0,
            false_alarms_per_hour: 1.0,
            channel_hours: 0.0,
            extrapolated: true,
        },
        weights_fnv1a: String::new(),
        training: json!({ "paper": true, "seed": seed }),
    };
    Ok(LearnedModel::new(card, scaler, network)?)
}

/// A window that was judged.
struct Judged {
    score: f64,
    faulty: bool,
    /// Whether the channel became faulty within it.
    new: bool,
    class: i64,
}

/// One in [`JUDGED_EVERY`] of the windows of `data`, by `model`'s raw score.
fn judged_windows(model: &LearnedModel, data: &Dataset) -> Result<Vec<Judged>> {
    let (card, scaler) = (model.card(), model.scaler());
    let (length, width) = (card.window, scaler.width());
    let rows = features(data, card.features)?;
    let mut ends = Vec::new();
    for (sequence, steps) in data.sequences.iter().enumerate() {
        let last = steps.steps.len();
        let newest = (length.saturating_sub(1)..last).step_by(JUDGED_EVERY);
        ends.extend(newest.map(|newest| WindowEnd { sequence, newest }));
    }
    let windows = Windows::gather(data, &rows, scaler, length, &ends);
    let mut judged = Vec::new();
    let mut state = match model.network() {
        Network::Lstm(cell) => Some(cell.zero_state()),
        Network::Svm(_) => None,
    };
    let values = windows.values().chunks(length * width);
    let labels = windows.step_labels().chunks(length);
    for ((end, window), labels) in ends.iter().zip(values).zip(labels) {
        let score = match (model.network(), &mut state) {
            (Network::Lstm(cell), Some(state)) => cell.window(state, window),
            (Network::Svm(machine), _) => machine.decision(window),
            (Network::Lstm(_), None) => continue,
        };
        let step = &data.sequences[end.sequence].steps[end.newest];
        judged.push(Judged {
            score: f64::from(score),
            faulty: step.label.is_faulty(),
            new: labels.first() != labels.last(),
            class: cn0_class_dbhz(step.step.cn0_dbhz),
        });
    }
    Ok(judged)
}

/// How `model` fares on windows of `test`, which come as often as they do; the score above which one is faulty is
/// that of the largest balanced accuracy on `held_out`.
///
/// # Errors
/// Where a step holds no numbers.
pub fn accuracy(model: &LearnedModel, held_out: &Dataset, test: &Dataset) -> Result<Accuracy> {
    let plain = judged_windows(model, held_out)?;
    let plain: Vec<_> = plain.iter().map(|j| (j.score, j.faulty)).collect();
    let cut = best_cut(&plain);
    let all = judged_windows(model, test)?;
    let of = |class: Option<i64>, steady: bool| {
        let kept = all
            .iter()
            .filter(|j| class.is_none_or(|k| k == j.class) && !(steady && j.new));
        BalancedAccuracy::of(kept.map(|j| (j.score > cut, j.faulty)))
    };
    let by_class = |steady| {
        let classes = CLASSES_DBHZ.iter().map(|c| (*c, of(Some(*c), steady)));
        classes.collect()
    };
    Ok(Accuracy {
        all: of(None, false),
        steady: of(None, true),
        by_class: by_class(false),
        steady_by_class: by_class(true),
    })
}
