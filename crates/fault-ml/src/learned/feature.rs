//! Which numbers of a step a learned monitor looks at.

use serde::{Deserialize, Serialize};

use super::ChannelStep;
use crate::MonitorError;
use crate::error::within;

/// Most features of a step.
const WIDEST: usize = 4;
/// Innovations beyond so many deviations say no more than this many.
const FARTHEST_SIGMAS: f64 = 20.0;
/// C/N0 that counts as zero, dB-Hz, and what counts as one, dB.
const CN0_MIDDLE_DBHZ: f64 = 40.0;
const DECADE_DB: f64 = 10.0;

/// A set of features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSet {
    /// Code and carrier innovation as they are, m and m/s (Jiang2017, Zhu2020).
    Paper,
    /// Both over their predicted deviations, C/N0, and the power of the last prompt sum against what
    /// C/N0 lets expect, which answers at once where C/N0 is smoothed.
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
            Self::Full => 4,
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

    /// The features of `step`. A range rate that was not measured counts as the one expected.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a number of the step is none, or a deviation not above zero.
    pub fn features(self, step: &ChannelStep) -> Result<Features, MonitorError> {
        let innovation = &step.innovation;
        let code = checked(innovation.code_m, innovation.code_sigma_m, "innovation (m)")?;
        let rate = if innovation.rate_sigma_mps == f64::INFINITY {
            (0.0, 1.0)
        } else {
            checked(
                innovation.rate_mps,
                innovation.rate_sigma_mps,
                "innovation (m/s)",
            )?
        };
        let values = match self {
            Self::Paper => [code.0, rate.0, 0.0, 0.0],
            Self::Full => {
                let (cn0, power) = strength(step)?;
                [normalised(code), normalised(rate), cn0, power]
            }
        };
        Ok(Features {
            values: values.map(|value| value as f32),
            width: self.width(),
        })
    }
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
    use super::*;

    #[test]
    fn the_paper_s_are_raw_and_the_full_ones_normalised() {
        let step = ChannelStep::normal(7, 2.0, -3.0);
        let paper = FeatureSet::Paper.features(&step).unwrap();
        // 2 x 8 m and -3 x 0.2 m/s.
        assert_eq!(paper.values(), [16.0, -0.6_f32]);
        let full = FeatureSet::Full.features(&step).unwrap();
        assert_eq!(full.values()[..3], [2.0, -3.0, 0.5]);
        // log10(601 / 200) - 0.5.
        assert!((full.values()[3] + 0.0221).abs() < 1e-4);
        for set in [FeatureSet::Paper, FeatureSet::Full] {
            assert_eq!(set.features(&step).unwrap().values().len(), set.width());
        }
    }

    #[test]
    fn without_a_range_rate_it_is_the_one_expected() {
        let mut step = ChannelStep::normal(7, 1.0, 5.0);
        step.innovation.rate_sigma_mps = f64::INFINITY;
        for set in [FeatureSet::Paper, FeatureSet::Full] {
            assert_eq!(set.features(&step).unwrap().values()[1], 0.0);
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
            let error = FeatureSet::Full.features(&step).unwrap_err().to_string();
            assert!(error.starts_with(text), "{error}");
        }
    }
}
