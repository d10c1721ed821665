//! Which numbers of a step a learned monitor looks at.

use serde::{Deserialize, Serialize};

use super::ChannelStep;
use super::usual::Usual;
use crate::error::within;
use crate::{Innovation, MonitorError};

/// Most features of a step.
pub(super) const WIDEST: usize = 12;
/// Innovations beyond so many deviations say no more than this many.
const FARTHEST_SIGMAS: f64 = 20.0;
/// Weight of the newest step in the running means of the code's deviation (memories of 10 and 50 steps), of the
/// range rate's (25) and of the squares of both (20).
const CODE_SHARES: [f64; 2] = [0.2, 0.04];
const RATE_SHARE: f64 = 0.08;
const SQUARE_SHARE: f64 = 0.1;
/// Weights of the newest step in the running means of the taps' ratio (memories of 10 and 50 steps).
const SHAPE_SHARES: [f64; 2] = [0.2, 0.04];
/// Within these a ratio of taps tells of a peak; beyond, of a prompt sum that noise left little of.
const SHAPES: (f64, f64) = (0.0, 2.0);
/// Length of a step for the noise of the taps' ratio, s.
const STEP_S: f64 = 0.02;
/// C/N0 that counts as zero, dB-Hz, and what counts as one, dB.
const CN0_MIDDLE_DBHZ: f64 = 40.0;
pub(super) const DECADE_DB: f64 = 10.0;

/// A set of features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSet {
    /// Code and carrier innovation as they are, m and m/s (Jiang2017, Zhu2020).
    Paper,
    /// Both given the other channels, over their predicted deviations; running means of them and of their squares
    /// over their own deviations (a small error that lasts stands out there); C/N0, the same against what the
    /// channel is used to, and that of the last integration against the smoothed one, which answers at once, the
    /// last two less what they are for the other channels; running means of the ratio metric, early plus late over
    /// twice prompt, against what the channel is used to, over their own deviations. Of large numbers the inverse
    /// hyperbolic sine: they keep their order without drowning the others.
    Full,
}

/// The features of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Features {
    values: [f32; WIDEST],
    width: usize,
}

impl Features {
    /// The numbers.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        self.values.get(..self.width).unwrap_or(&self.values)
    }
}

impl FeatureSet {
    /// Numbers a step.
    #[must_use]
    pub const fn width(self) -> usize {
        match self {
            Self::Paper => 2,
            Self::Full => WIDEST,
        }
    }

    /// Name in files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Full => "full",
        }
    }
}

/// The features of a channel, step by step.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureTrack {
    set: FeatureSet,
    code: [f64; 2],
    rate: f64,
    /// Of code and range rate, less one.
    squares: [f64; 2],
    /// C/N0 that the channel is used to, about 40 dB-Hz, in tens of decibels.
    usual_cn0: Usual,
    shape: Shape,
}

/// The ratio metric: early plus late over twice prompt.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    usual: Usual,
    /// Running means of what it deviates, in deviations of a step.
    means: [f64; 2],
}

impl Shape {
    const NEW: Self = Self {
        usual: Usual::NEW,
        means: [0.0; 2],
    };

    fn follow(&mut self, ratios: [f64; 2], cn0_dbhz: f64) {
        let ratio = ((ratios[0] + ratios[1]) / 2.0).clamp(SHAPES.0, SHAPES.1);
        if !self.usual.is_new() {
            // Of a triangle of height one at distance r: noise of early plus late given prompt.
            let usual = self.usual.value();
            let height = usual.clamp(0.05, 0.95);
            let snr = STEP_S * 10_f64.powf(cn0_dbhz / 10.0);
            let sigma = (height * (1.0 - height) / (2.0 * snr)).sqrt();
            let deviation = normalised((ratio - usual, sigma));
            for (mean, share) in self.means.iter_mut().zip(SHAPE_SHARES) {
                *mean += share * (deviation - *mean);
            }
        }
        self.usual.follow(ratio, 0.0);
    }
}

impl FeatureTrack {
    /// A channel of which nothing is known.
    #[must_use]
    pub const fn new(set: FeatureSet) -> Self {
        Self {
            set,
            code: [0.0; 2],
            rate: 0.0,
            squares: [0.0; 2],
            usual_cn0: Usual::NEW,
            shape: Shape::NEW,
        }
    }

    /// The features of the next step. A range rate that was not measured counts as the one expected.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a number of the step is none, or a deviation not above zero; the step
    /// then leaves no trace.
    pub fn next(&mut self, step: &ChannelStep) -> Result<Features, MonitorError> {
        let mut values = [0.0; WIDEST];
        match self.set {
            FeatureSet::Paper => {
                let (code, rate) = measured(&step.innovation)?;
                let rate = rate.map_or(0.0, |rate| rate.0);
                values
                    .iter_mut()
                    .zip([code.0, rate])
                    .for_each(|(slot, value)| *slot = value as f32);
            }
            FeatureSet::Full => {
                let (code, rate) = measured(&step.given_others)?;
                let (cn0, power) = strength(step.cn0_dbhz, step.cn0_now_hz)?;
                let others = others(step)?;
                let ratios = shape(step)?;
                let (code, rate) = (normalised(code), rate.map(normalised));
                if let Some(ratios) = ratios {
                    self.shape.follow(ratios, step.cn0_dbhz);
                }
                self.remember(code, rate, cn0, others[0]);
                let full = self.full(code, rate.unwrap_or_default(), [cn0, power], others);
                values = full.map(|value| value as f32);
            }
        }
        Ok(Features {
            values,
            width: self.set.width(),
        })
    }

    fn full(&self, code: f64, rate: f64, own: [f64; 2], others: [f64; 2]) -> [f64; WIDEST] {
        let [cn0, power] = own;
        let [others_cn0, others_power] = others;
        let [short, long] = self.code;
        let [short_share, long_share] = CODE_SHARES;
        let [code_square, rate_square] = self.squares;
        let [shape, lasting_shape] = self.shape.means;
        let [shape_share, lasting_share] = SHAPE_SHARES;
        [
            code.asinh(),
            rate.asinh(),
            (short / spread(short_share)).asinh(),
            (long / spread(long_share)).asinh(),
            (code_square / spread(SQUARE_SHARE)).asinh(),
            (self.rate / spread(RATE_SHARE)).asinh(),
            (rate_square / spread(SQUARE_SHARE)).asinh(),
            cn0,
            cn0 - self.usual_cn0.value() - others_cn0,
            power - others_power,
            (shape / spread(shape_share)).asinh(),
            (lasting_shape / spread(lasting_share)).asinh(),
        ]
    }

    fn remember(&mut self, code: f64, rate: Option<f64>, cn0: f64, others_cn0: f64) {
        for (mean, share) in self.code.iter_mut().zip(CODE_SHARES) {
            *mean += share * (code - *mean);
        }
        if let Some(rate) = rate {
            self.rate += RATE_SHARE * (rate - self.rate);
        }
        // About what they are in a healthy channel.
        for (mean, value) in self.squares.iter_mut().zip([Some(code), rate]) {
            if let Some(value) = value {
                *mean += SQUARE_SHARE * (value * value - 1.0 - *mean);
            }
        }
        self.usual_cn0.follow(cn0, others_cn0);
    }
}

/// Deviation of a running mean of independent values of deviation one.
fn spread(share: f64) -> f64 {
    (share / (2.0 - share)).sqrt()
}

/// Value and deviation.
type Measured = (f64, f64);

/// Code, and rate where there is one.
fn measured(innovation: &Innovation) -> Result<(Measured, Option<Measured>), MonitorError> {
    let code = checked(innovation.code_m, innovation.code_sigma_m, "innovation (m)")?;
    if innovation.rate_sigma_mps == f64::INFINITY {
        return Ok((code, None));
    }
    let rate = checked(
        innovation.rate_mps,
        innovation.rate_sigma_mps,
        "innovation (m/s)",
    )?;
    Ok((code, Some(rate)))
}

fn checked(value: f64, sigma: f64, name: &'static str) -> Result<(f64, f64), MonitorError> {
    within(name, value, (-1e12, 1e12), "a number up to 1e12")?;
    let allowed = (f64::MIN_POSITIVE, f64::MAX);
    within(
        "deviation of an innovation",
        sigma,
        allowed,
        "more than 0, and finite",
    )?;
    Ok((value, sigma))
}

fn normalised((value, sigma): (f64, f64)) -> f64 {
    (value / sigma).clamp(-FARTHEST_SIGMAS, FARTHEST_SIGMAS)
}

/// Ratios of early and late to prompt.
fn shape(step: &ChannelStep) -> Result<Option<[f64; 2]>, MonitorError> {
    for ratio in step.tap_ratios.into_iter().flatten() {
        within("ratio of taps", ratio, (-1e12, 1e12), "a number up to 1e12")?;
    }
    Ok(step.tap_ratios)
}

/// C/N0 about 40 dB-Hz, and that of the last integration against it, both in tens of decibels.
pub(super) fn strength(cn0_dbhz: f64, cn0_now_hz: f64) -> Result<(f64, f64), MonitorError> {
    within("C/N0 (dB-Hz)", cn0_dbhz, (-100.0, 200.0), "-100 to 200")?;
    within(
        "C/N0 now (Hz)",
        cn0_now_hz,
        (-1e12, 1e12),
        "a number up to 1e12",
    )?;
    let cn0 = (cn0_dbhz - CN0_MIDDLE_DBHZ) / DECADE_DB;
    // Of a sum of 20 ms at 40 dB-Hz: 200. One more keeps the logarithm of nothing finite.
    let power = ((0.02 * cn0_now_hz.max(0.0) + 1.0) / 200.0).log10();
    Ok((cn0, power - cn0))
}

/// What the C/N0 of the others has changed by, in tens of decibels.
fn others(step: &ChannelStep) -> Result<[f64; 2], MonitorError> {
    let change = &step.others_change;
    let both = [change.smoothed_db, change.now_db];
    for change_db in both {
        within(
            "change of the others' C/N0 (dB)",
            change_db,
            (-1e3, 1e3),
            "-1000 to 1000",
        )?;
    }
    Ok(both.map(|change_db| change_db / DECADE_DB))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::super::StrengthChange;
    use super::*;

    #[test]
    fn the_paper_s_are_raw_and_the_full_ones_normalised() {
        let step = ChannelStep::normal(7, 2.0, -3.0);
        let features = |set| FeatureTrack::new(set).next(&step).unwrap();
        let paper = features(FeatureSet::Paper);
        // 2 x 8 m and -3 x 0.2 m/s.
        assert_eq!(paper.values(), [16.0, -0.6_f32]);
        let full = features(FeatureSet::Full);
        // 0.2 of 2 over a deviation of sqrt(0.2 / 1.8) = 1/3; log10(601 / 200) - 0.5.
        for (index, expected) in [
            (0, 2.0_f32.asinh()),
            (1, -3.0_f32.asinh()),
            (2, 1.2_f32.asinh()),
            (7, 0.5),
            (8, 0.0),
            (9, -0.0221),
        ] {
            assert!(
                (full.values()[index] - expected).abs() < 1e-4,
                "{index}: {full:?}"
            );
        }
        for set in [FeatureSet::Paper, FeatureSet::Full] {
            assert_eq!(features(set).values().len(), set.width());
        }
    }

    #[test]
    fn what_the_others_lose_too_is_no_loss() {
        let fallen = |own_db: f64, others_db: f64| {
            let mut step = ChannelStep::normal(1, 0.0, 0.0);
            step.cn0_dbhz += own_db;
            step.cn0_now_hz *= 10_f64.powf(2.0 * own_db / 10.0);
            step.others_change = StrengthChange {
                smoothed_db: others_db,
                now_db: others_db,
            };
            step
        };
        let after = |used_to: usize, last: ChannelStep| {
            let mut track = FeatureTrack::new(FeatureSet::Full);
            for _ in 0..used_to {
                track.next(&fallen(0.0, 0.0)).unwrap();
            }
            let features = track.next(&last).unwrap();
            [8, 9].map(|k| f64::from(features.values()[k]))
        };
        let before = after(1000, fallen(0.0, 0.0));
        let alone = after(1000, fallen(-6.0, 0.0));
        let together = after(1000, fallen(-6.0, -6.0));
        let begun = after(0, fallen(-6.0, -6.0));
        for (k, name) in ["smoothed", "now"].into_iter().enumerate() {
            // Of the last integration a little is noise: 0.02 of 60 at this C/N0.
            assert!(
                (alone[k] - before[k] + 0.6).abs() < 0.05,
                "{name} {alone:?}"
            );
            assert!(
                (together[k] - before[k]).abs() < 0.05,
                "{name} {together:?}"
            );
            assert!((begun[k] - before[k]).abs() < 0.05, "{name} {begun:?}");
        }
    }

    #[test]
    fn what_is_usual_is_no_matter_of_one_step() {
        let mut track = FeatureTrack::new(FeatureSet::Full);
        let usual = ChannelStep::normal(1, 0.0, 0.0);
        let mut weak = usual;
        weak.cn0_dbhz -= 3.0;
        let mut no_prompt = usual;
        no_prompt.tap_ratios = Some([1e6; 2]);
        let steps = [weak].into_iter().chain([usual; 1000]);
        let steps = steps.chain([no_prompt]).chain([usual; 200]);
        let rows: Vec<Features> = steps.map(|step| track.next(&step).unwrap()).collect();
        // A fiftieth of 3 dB.
        assert!(rows[50].values()[8].abs() < 0.01, "{:?}", rows[50]);
        // A weight of 1/500 of a ratio of 2 in place of 0.75 is a fifth of the deviation of a step, and that of the mean a
        // seventh.
        let shape = f64::from(rows[1201].values()[11]).sinh();
        assert!(shape.abs() < 1.5, "{shape}");
    }

    #[test]
    fn running_means_of_healthy_channels_have_deviation_one() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let mut track = FeatureTrack::new(FeatureSet::Full);
        let mut sums = [0.0; 3];
        let steps = 60_000;
        for _ in 0..steps {
            let step = ChannelStep::normal(
                1,
                random.sample(StandardNormal),
                random.sample(StandardNormal),
            );
            let features = track.next(&step).unwrap();
            for (sum, k) in sums.iter_mut().zip([2, 3, 5]) {
                *sum += f64::from(features.values()[k]).sinh().powi(2);
            }
        }
        for sum in sums {
            // The slowest repeats itself over 50 steps: 1200 independent values, 4 %, four of them.
            assert!((sum / f64::from(steps) - 1.0).abs() < 0.16, "{sums:?}");
        }
    }

    #[test]
    fn a_peak_that_changes_shape_stands_out_of_its_noise() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let mut track = FeatureTrack::new(FeatureSet::Full);
        let mut step = ChannelStep::normal(1, 0.0, 0.0);
        let snr = 0.02 * 10_f64.powf(4.5);
        let sigma = (0.75 * 0.25 / (2.0 * snr)).sqrt();
        let mut sums = [0.0; 2];
        let steps = 20_000;
        let mut noisy = |middle: f64| {
            // Both taps alike: their mean has the whole of it.
            Some([middle + sigma * random.sample::<f64, _>(StandardNormal); 2])
        };
        for _ in 0..steps {
            step.tap_ratios = noisy(0.75);
            let features = track.next(&step).unwrap();
            for (sum, k) in sums.iter_mut().zip([10, 11]) {
                *sum += f64::from(features.values()[k]).sinh().powi(2);
            }
        }
        for sum in sums {
            assert!((sum / f64::from(steps) - 1.0).abs() < 0.3, "{sums:?}");
        }
        let mut last = [0.0; 2];
        for _ in 0..25 {
            step.tap_ratios = noisy(0.75 + 2.0 * sigma);
            let features = track.next(&step).unwrap();
            last = [10, 11].map(|k| f64::from(features.values()[k]).sinh());
        }
        // Two deviations of a step, over deviations of a third and a seventh.
        assert!(last[0] > 4.0 && last[1] > 6.0, "{last:?}");
    }

    #[test]
    fn without_a_range_rate_it_is_the_one_expected() {
        let mut step = ChannelStep::normal(7, 1.0, 5.0);
        step.innovation.rate_sigma_mps = f64::INFINITY;
        step.given_others.rate_sigma_mps = f64::INFINITY;
        for set in [FeatureSet::Paper, FeatureSet::Full] {
            let features = FeatureTrack::new(set).next(&step).unwrap();
            assert_eq!(features.values()[1], 0.0);
        }
    }

    #[test]
    fn what_is_no_number_is_named() {
        /// What makes a step unusable, and how the error begins.
        type Spoiled<'a> = (fn(&mut ChannelStep), &'a str);
        let spoil: [Spoiled; 7] = [
            (
                |s| s.given_others.code_m = f64::NAN,
                "innovation (m) is NaN",
            ),
            (
                |s| s.given_others.rate_mps = f64::INFINITY,
                "innovation (m/s) is inf",
            ),
            (
                |s| s.given_others.code_sigma_m = 0.0,
                "deviation of an innovation is 0",
            ),
            (|s| s.cn0_dbhz = f64::NAN, "C/N0 (dB-Hz) is NaN"),
            (|s| s.cn0_now_hz = f64::NAN, "C/N0 now (Hz) is NaN"),
            (
                |s| s.others_change.now_db = f64::NAN,
                "change of the others' C/N0 (dB) is NaN",
            ),
            (
                |s| s.tap_ratios = Some([0.75, f64::NAN]),
                "ratio of taps is NaN",
            ),
        ];
        for (spoil, text) in spoil {
            let mut step = ChannelStep::normal(1, 0.0, 0.0);
            spoil(&mut step);
            let fresh = FeatureTrack::new(FeatureSet::Full);
            let mut track = fresh.clone();
            let error = track.next(&step).unwrap_err().to_string();
            assert!(error.starts_with(text), "{error}");
            assert_eq!(track, fresh);
        }
    }
}
