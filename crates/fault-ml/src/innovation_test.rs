//! The innovation test: mean normalised innovation squared over a window.

use std::collections::VecDeque;

use crate::crossing_rate::MovingSum;
use crate::{Cadence, ChannelMonitor, ChannelVerdict, Innovation, Judgement, MonitorError};

/// Longest window, epochs.
const LONGEST_WINDOW: usize = 3_600;

/// Which innovations are tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum InnovationStatistic {
    /// That of the pseudorange.
    Code,
    /// That of the range rate; a step without one cannot be judged.
    Rate,
    /// Both, which are independent; a step without a range rate cannot be judged.
    CodeAndRate,
}

impl InnovationStatistic {
    const fn degrees_of_freedom(self) -> usize {
        match self {
            Self::Code | Self::Rate => 1,
            Self::CodeAndRate => 2,
        }
    }
}

/// Settings of [`InnovationTest`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnovationTestSettings {
    /// Steps averaged over, 2 to 3600. Default 30.
    pub window: usize,
    /// Steps a second, Hz. Default 10.
    pub epoch_rate_hz: f64,
    /// False alarms of a channel an hour. Default 0.01.
    pub false_alarms_per_hour: f64,
    /// What is tested. Default: code, which every channel has.
    pub statistic: InnovationStatistic,
}

impl Default for InnovationTestSettings {
    fn default() -> Self {
        Self {
            window: 30,
            epoch_rate_hz: 10.0,
            false_alarms_per_hour: 0.01,
            statistic: InnovationStatistic::Code,
        }
    }
}

/// Holds the mean over a window of (innovation / deviation)^2, per degree of freedom, against a
/// threshold that is crossed at a stated rate.
///
/// An alarm is a step from healthy to faulty. Successive windows share all but one step, so that
/// exceedances come in runs; their beginnings are counted, and their rate for independent normal
/// innovations of the stated deviations follows exactly from one integral (no bound, no
/// simulation). It does not hold where deviations are understated, errors last (multipath) or have
/// heavy tails: the frequency discriminator of equation (6) of Jiang2017 has no variance at all.
///
/// A fault is judged from the first full window on, and alarms as soon as its excess outweighs the
/// window: one of 8 deviations at once, at the default settings (threshold 2.75).
#[derive(Debug, Clone)]
pub struct InnovationTest {
    settings: InnovationTestSettings,
    threshold: f64,
    squares: VecDeque<f64>,
}

impl InnovationTest {
    /// A test with an empty window.
    ///
    /// # Errors
    /// [`MonitorError::Value`] for a window outside 2 to 3600, a rate that is not above zero and
    /// finite, or more false alarms than the window can cross its mean.
    pub fn new(settings: InnovationTestSettings) -> Result<Self, MonitorError> {
        if !(2..=LONGEST_WINDOW).contains(&settings.window) {
            return refuse("window, steps", settings.window as f64, "2 to 3600");
        }
        for (name, value) in [
            ("epoch rate, Hz", settings.epoch_rate_hz),
            ("false alarms an hour", settings.false_alarms_per_hour),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(name, value, "more than 0, and finite");
            }
        }
        let freedom = settings.statistic.degrees_of_freedom();
        let probability = settings.false_alarms_per_hour / (3600.0 * settings.epoch_rate_hz);
        let level = MovingSum::new(settings.window, freedom).and_then(|sum| sum.level(probability));
        let Some(level) = level else {
            let rate = settings.false_alarms_per_hour;
            return refuse(
                "false alarms an hour",
                rate,
                "a rate some level is crossed at",
            );
        };
        Ok(Self {
            settings,
            threshold: level / (settings.window * freedom) as f64,
            squares: VecDeque::with_capacity(settings.window),
        })
    }

    /// The threshold of the mean normalised innovation squared per degree of freedom.
    #[must_use]
    pub const fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Sum of what is tested of one step; `None` where it was not measured.
    fn square(&self, innovation: &Innovation) -> Result<Option<f64>, MonitorError> {
        use InnovationStatistic::{Code, CodeAndRate, Rate};
        let code = || normalised_squared(innovation.code_m, innovation.code_sigma_m);
        let rate = || normalised_squared(innovation.rate_mps, innovation.rate_sigma_mps);
        match self.settings.statistic {
            Code => code().map(Some),
            _ if innovation.rate_sigma_mps == f64::INFINITY => Ok(None),
            Rate => rate().map(Some),
            CodeAndRate => Ok(Some(code()? + rate()?)),
        }
    }
}

impl ChannelMonitor for InnovationTest {
    type Input = Innovation;

    fn name(&self) -> &str {
        "innovation"
    }

    fn cadence(&self) -> Cadence {
        Cadence::NavigationEpoch
    }

    fn step(&mut self, input: &Innovation) -> Result<ChannelVerdict, MonitorError> {
        let Some(square) = self.square(input)? else {
            return Ok(ChannelVerdict::Unavailable);
        };
        let window = self.settings.window;
        if self.squares.len() == window {
            self.squares.pop_front();
        }
        self.squares.push_back(square);
        if self.squares.len() < window {
            let remaining_steps = window - self.squares.len();
            return Ok(ChannelVerdict::WarmingUp { remaining_steps });
        }
        // Summed anew, so that no rounding is carried on and one infinite step is forgotten.
        let freedom = self.settings.statistic.degrees_of_freedom();
        let mean = self.squares.iter().sum::<f64>() / (window * freedom) as f64;
        Ok(ChannelVerdict::Judged(Judgement::new(
            mean,
            self.threshold,
        )?))
    }

    fn reset(&mut self) {
        self.squares.clear();
    }
}

fn normalised_squared(value: f64, sigma: f64) -> Result<f64, MonitorError> {
    if !value.is_finite() {
        return refuse("innovation", value, "a finite number");
    }
    if !(sigma > 0.0 && sigma.is_finite()) {
        return refuse(
            "deviation of an innovation",
            sigma,
            "more than 0, and finite",
        );
    }
    Ok((value / sigma).powi(2))
}

fn refuse<T>(name: &'static str, value: f64, expected: &'static str) -> Result<T, MonitorError> {
    Err(MonitorError::Value {
        name,
        value,
        expected,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    fn innovation(code_sigmas: f64, rate_sigmas: f64) -> Innovation {
        Innovation {
            code_m: 8.0 * code_sigmas,
            code_sigma_m: 8.0,
            rate_mps: 0.2 * rate_sigmas,
            rate_sigma_mps: 0.2,
        }
    }

    fn test(statistic: InnovationStatistic) -> InnovationTest {
        let settings = InnovationTestSettings {
            statistic,
            ..InnovationTestSettings::default()
        };
        InnovationTest::new(settings).unwrap()
    }

    /// Alarms among `steps` healthy steps.
    fn alarms(settings: InnovationTestSettings, steps: usize, seed: u64) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut test = InnovationTest::new(settings).unwrap();
        let mut faulty = (0..steps).map(|_| {
            let (code, rate) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
            test.step(&innovation(code, rate)).unwrap().is_faulty()
        });
        let mut before = faulty.next().unwrap();
        faulty
            .filter(|&now| !std::mem::replace(&mut before, now) && now)
            .count()
    }

    #[test]
    fn healthy_channels_alarm_at_the_stated_rate() {
        for statistic in [InnovationStatistic::Code, InnovationStatistic::CodeAndRate] {
            for window in [2, 30] {
                let settings = InnovationTestSettings {
                    window,
                    // One in 500 steps, so that a simulation sees enough of them.
                    false_alarms_per_hour: 72.0,
                    statistic,
                    ..InnovationTestSettings::default()
                };
                let (steps, expected) = (500_000, 1_000.0);
                let found = alarms(settings, steps, 11 + window as u64) as f64;
                // Alarms come nearly independently: deviation 32, and four times that.
                assert!((found - expected).abs() < 130.0, "{window}: {found}");
            }
        }
    }

    #[test]
    fn thresholds_of_the_default_rate() {
        // 2.8e-7 crossings a step. Exceedances come in runs of a few steps: the probability of one
        // at the threshold is that many times larger.
        let exceedances = ChiSquared::new(30.0).unwrap();
        let rate = 0.01 / 36_000.0;
        let code = test(InnovationStatistic::Code).threshold();
        let exceeded = exceedances.sf(30.0 * code);
        assert!((rate..5.0 * rate).contains(&exceeded), "{code} {exceeded}");
        // More degrees of freedom scatter less.
        assert!(test(InnovationStatistic::CodeAndRate).threshold() < code);
    }

    #[test]
    fn a_large_fault_alarms_at_once_and_is_forgotten() {
        let mut test = test(InnovationStatistic::Code);
        for k in 0..30 {
            let healthy = innovation(if k % 2 == 0 { 1.0 } else { -1.0 }, 50.0);
            let verdict = test.step(&healthy).unwrap();
            let warming = ChannelVerdict::WarmingUp {
                remaining_steps: 29 - k,
            };
            assert!(if k < 29 {
                verdict == warming
            } else {
                !verdict.is_faulty()
            });
        }
        assert!(test.step(&innovation(9.0, 0.0)).unwrap().is_faulty());
        for _ in 0..29 {
            let verdict = test.step(&innovation(1.0, 0.0)).unwrap();
            assert!(verdict.is_faulty(), "still in the window");
        }
        let verdict = test.step(&innovation(1.0, 0.0)).unwrap();
        assert_eq!(verdict.judgement().unwrap().score(), 1.0);
        test.reset();
        let verdict = test.step(&innovation(0.0, 0.0)).unwrap();
        assert_eq!(
            verdict,
            ChannelVerdict::WarmingUp {
                remaining_steps: 29
            }
        );
    }

    #[test]
    fn a_step_without_range_rate_cannot_be_judged_where_it_is_needed() {
        let mut without = innovation(1.0, 0.0);
        without.rate_sigma_mps = f64::INFINITY;
        for statistic in [InnovationStatistic::Rate, InnovationStatistic::CodeAndRate] {
            let mut test = test(statistic);
            assert_eq!(test.step(&without), Ok(ChannelVerdict::Unavailable));
            assert!(test.squares.is_empty());
        }
        let verdict = test(InnovationStatistic::Code).step(&without).unwrap();
        assert_eq!(
            verdict,
            ChannelVerdict::WarmingUp {
                remaining_steps: 29
            }
        );
    }

    #[test]
    fn what_is_no_innovation_leaves_no_trace() {
        let spoil: [fn(&mut Innovation); 5] = [
            |i| i.code_m = f64::NAN,
            |i| i.code_sigma_m = 0.0,
            |i| i.code_sigma_m = f64::INFINITY,
            |i| i.rate_mps = f64::INFINITY,
            |i| i.rate_sigma_mps = f64::NAN,
        ];
        for spoil in spoil {
            let mut test = test(InnovationStatistic::CodeAndRate);
            let mut bad = innovation(1.0, 1.0);
            spoil(&mut bad);
            assert!(test.step(&bad).is_err());
            assert!(test.squares.is_empty());
        }
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        let base = InnovationTestSettings::default();
        let refused = |settings, name| {
            let error = InnovationTest::new(settings).unwrap_err().to_string();
            assert!(error.starts_with(name), "{error}");
        };
        for window in [0, 1, 3_601] {
            refused(InnovationTestSettings { window, ..base }, "window");
        }
        for epoch_rate_hz in [0.0, f64::NAN, f64::INFINITY] {
            refused(
                InnovationTestSettings {
                    epoch_rate_hz,
                    ..base
                },
                "epoch rate",
            );
        }
        for false_alarms_per_hour in [0.0, -1.0, 36_000.0] {
            let settings = InnovationTestSettings {
                false_alarms_per_hour,
                ..base
            };
            refused(settings, "false alarms");
        }
    }
}
