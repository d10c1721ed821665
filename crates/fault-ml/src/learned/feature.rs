//! Which numbers of a step a learned monitor looks at.

use serde::{Deserialize, Serialize};

use super::ChannelStep;
use crate::MonitorError;
use crate::error::within;

/// Most features of a step.
const WIDEST: usize = 8;
/// Innovations beyond so many deviations say no more than this many.
const FARTHEST_SIGMAS: f64 = 20.0;
/// Weight of the newest step in the running means of the code's innovation, of its square and of the
/// range rate's: memories of 10 and 50 steps, 20 and 25.
const CODE_SHARES: [f64; 2] = [0.2, 0.04];
const SQUARE_SHARE: f64 = 0.1;
const RATE_SHARE: f64 = 0.08;
/// C/N0 that counts as zero, dB-Hz, and what counts as one, dB.
const CN0_MIDDLE_DBHZ: f64 = 40.0;
const DECADE_DB: f64 = 10.0;

/// A set of features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSet {
    /// Code and carrier innovation as they are, m and m/s (Jiang2017, Zhu2020).
    Paper,
    /// Both over their predicted deviations, running means of them over their own deviations (a small error
    /// that lasts stands out there), C/N0, and the power of the last prompt sum against what C/N0 lets
    /// expect, which answers at once where C/N0 is smoothed.
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
            Self::Full => 8,
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
    square: f64,
    rate: f64,
}

impl FeatureTrack {
    /// A channel of which nothing is known.
    #[must_use]
    pub const fn new(set: FeatureSet) -> Self {
        Self {
            set,
            code: [0.0; 2],
            square: 0.0,
            rate: 0.0,
        }
    }

    /// The features of the next step. A range rate that was not measured counts as the one expected.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a number of the step is none, or a deviation not above zero; the step
    /// then leaves no trace.
    pub fn next(&mut self, step: &ChannelStep) -> Result<Features, MonitorError> {
        let innovation = &step.innovation;
        let code = checked(innovation.code_m, innovation.code_sigma_m, "innovation (m)")?;
        let measured = innovation.rate_sigma_mps != f64::INFINITY;
        let rate = if measured {
            checked(
                innovation.rate_mps,
                innovation.rate_sigma_mps,
                "innovation (m/s)",
            )?
        } else {
            (0.0, 1.0)
        };
        let values = match self.set {
            FeatureSet::Paper => [code.0, rate.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            FeatureSet::Full => {
                let (cn0, power) = strength(step)?;
                let (code, rate) = (normalised(code), normalised(rate));
                self.remember(code, measured.then_some(rate));
                let [short, long] = self.code;
                let square = self.square / spread(SQUARE_SHARE);
                let mean_rate = self.rate / spread(RATE_SHARE);
                let [a, b] = CODE_SHARES;
                [
                    code,
                    rate,
                    short / spread(a),
                    long / spread(b),
                    square,
                    mean_rate,
                    cn0,
                    power,
                ]
            }
        };
        Ok(Features {
            values: values.map(|value| value as f32),
            width: self.set.width(),
        })
    }

    fn remember(&mut self, code: f64, rate: Option<f64>) {
        for (mean, share) in self.code.iter_mut().zip(CODE_SHARES) {
            *mean += share * (code - *mean);
        }
        // About what it is in a healthy channel.
        self.square += SQUARE_SHARE * (code * code - 1.0 - self.square);
        if let Some(rate) = rate {
            self.rate += RATE_SHARE * (rate - self.rate);
        }
    }
}

/// Deviation of a running mean of independent values of deviation one.
fn spread(share: f64) -> f64 {
    (share / (2.0 - share)).sqrt()
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

/// C/N0 about 40 dB-Hz and the prompt power, both in tens of decibels.
fn strength(step: &ChannelStep) -> Result<(f64, f64), MonitorError> {
    within(
        "C/N0 (dB-Hz)",
        step.cn0_dbhz,
        (-100.0, 200.0),
        "-100 to 200",
    )?;
    within("prompt power", step.prompt_power, (0.0, 1e30), "0 to 1e30")?;
    let cn0 = (step.cn0_dbhz - CN0_MIDDLE_DBHZ) / DECADE_DB;
    // Of a sum of 20 ms at 40 dB-Hz: 200. One more keeps the logarithm of nothing finite.
    let power = ((step.prompt_power + 1.0) / 200.0).log10();
    Ok((cn0, power - cn0))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    #[test]
    fn the_paper_s_are_raw_and_the_full_ones_normalised() {
        let step = ChannelStep::normal(7, 2.0, -3.0);
        let features = |set| FeatureTrack::new(set).next(&step).unwrap();
        let paper = features(FeatureSet::Paper);
        // 2 x 8 m and -3 x 0.2 m/s.
        assert_eq!(paper.values(), [16.0, -0.6_f32]);
        let full = features(FeatureSet::Full);
        assert_eq!(full.values()[..2], [2.0, -3.0]);
        // 0.2 of 2 over a deviation of sqrt(0.2 / 1.8) = 1/3.
        assert!((full.values()[2] - 1.2).abs() < 1e-6);
        assert_eq!(full.values()[6], 0.5);
        // log10(601 / 200) - 0.5.
        assert!((full.values()[7] + 0.0221).abs() < 1e-4);
        for set in [FeatureSet::Paper, FeatureSet::Full] {
            assert_eq!(features(set).values().len(), set.width());
        }
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
                *sum += f64::from(features.values()[k]).powi(2);
            }
        }
        for sum in sums {
            // The slowest repeats itself over 50 steps: 1200 independent values, 4 %, four of them.
            assert!((sum / f64::from(steps) - 1.0).abs() < 0.16, "{sums:?}");
        }
    }

    #[test]
    fn without_a_range_rate_it_is_the_one_expected() {
        let mut step = ChannelStep::normal(7, 1.0, 5.0);
        step.innovation.rate_sigma_mps = f64::INFINITY;
        for set in [FeatureSet::Paper, FeatureSet::Full] {
            let features = FeatureTrack::new(set).next(&step).unwrap();
            assert_eq!(features.values()[1], 0.0);
        }
    }

    #[test]
    fn what_is_no_number_is_named() {
        /// What makes a step unusable, and how the error begins.
        type Spoiled<'a> = (fn(&mut ChannelStep), &'a str);
        let spoil: [Spoiled; 5] = [
            (|s| s.innovation.code_m = f64::NAN, "innovation (m) is NaN"),
            (
                |s| s.innovation.rate_mps = f64::INFINITY,
                "innovation (m/s) is inf",
            ),
            (
                |s| s.innovation.code_sigma_m = 0.0,
                "deviation of an innovation is 0",
            ),
            (|s| s.cn0_dbhz = f64::NAN, "C/N0 (dB-Hz) is NaN"),
            (|s| s.prompt_power = -1.0, "prompt power is -1"),
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
