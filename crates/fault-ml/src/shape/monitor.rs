//! The chart as a monitor of a channel.

use super::balance::{FlankBalance, newest_weight};
use super::chart::{ChartSettings, EwmaChart};
use super::observable::SHAPE_TAPS_CHIPS;
use crate::error::within;
use crate::{Cadence, ChannelMonitor, ChannelVerdict, Judgement, MonitorError};

/// Weight of a new difference in the deviation that a channel measures of itself: some 200 steps.
const DEVIATION_WEIGHT: f64 = 0.005;

/// Mean of the chart over the error of the range, by least squares over the reflections of
/// `cargo xtask reproduce zhang2014`, for a front end of 1.6 MHz each side; 0.7 without a filter.
const SLOPE: f64 = 0.4;

/// Magnitudes of a channel's correlator sums over one integration, at [`SHAPE_TAPS_CHIPS`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// In any unit.
    pub magnitudes: [f64; SHAPE_TAPS_CHIPS.len()],
}

impl Shape {
    /// What is said where no peak is found: nothing, or that there are no numbers to find it in.
    fn without_peak(&self) -> Result<ChannelVerdict, MonitorError> {
        let total: f64 = self.magnitudes.iter().sum();
        if total.is_finite() {
            return Ok(ChannelVerdict::Unavailable);
        }
        Err(MonitorError::Value {
            name: "sum of the magnitudes of a shape",
            value: total,
            expected: "a finite number",
        })
    }
}

/// Settings of [`ShapeMonitor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSettings {
    /// Weight of the newest shape, lambda. Default 0.02: a mean over half a second of 10 ms each.
    pub lambda: f64,
    /// Distance of the limits, L, deviations of the mean. Default 7: no more than 0.01 false alarms
    /// a channel and hour in simulated closed loops of 10 ms (docs/monitors.md).
    pub width: f64,
    /// Deviation of the mean that noise does not explain, chips: other satellites' codes, and the grid of samples. Default
    /// 0.0015, that is 0.4 m; on samples at 4 MHz of eight satellites the mean was seen to wander by 0.009 in 80
    /// minutes of their channels.
    pub floor_chips: f64,
    /// Steps seen before the first verdict, at least 2. Default 20, that is 0.2 s: the deviation is then known to 20 %.
    pub warm_up: u32,
}

impl Default for ShapeSettings {
    fn default() -> Self {
        Self {
            lambda: 0.02,
            width: 7.0,
            floor_chips: 0.0015,
            warm_up: 20,
        }
    }
}

/// Watches the shape of a channel's correlation: an [`EwmaChart`] of [`FlankBalance`].
///
/// The deviation, sigma, is that of successive values, the moving range of control charts: it follows
/// C/N0, integration and bandwidth by itself, and a slow change of the mean does not raise it. The
/// score is the distance of the mean from zero, chips, and the threshold half the width of the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeMonitor {
    settings: ShapeSettings,
    balance: FlankBalance,
    chart: EwmaChart,
    previous: Option<f64>,
    variance: f64,
    steps: u32,
}

impl ShapeMonitor {
    /// A monitor that has seen nothing.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a setting is out of its range.
    pub fn new(settings: ShapeSettings) -> Result<Self, MonitorError> {
        let warm_up = f64::from(settings.warm_up);
        within("warm-up, steps", warm_up, (2.0, 1e6), "2 to 1000000")?;
        let floor = (0.0, 1.0);
        within("floor, chips", settings.floor_chips, floor, "0 to 1")?;
        let chart = EwmaChart::new(ChartSettings {
            target: 0.0,
            sigma: 1.0,
            lambda: settings.lambda,
            width: settings.width,
        })?;
        Ok(Self {
            settings,
            balance: FlankBalance::new(),
            chart,
            previous: None,
            variance: 0.0,
            steps: 0,
        })
    }

    /// The chart's mean, chips: above zero the measured range is too long.
    #[must_use]
    pub const fn mean_chips(&self) -> f64 {
        self.chart.mean()
    }

    /// How much too long the measured range is taken to be, chips, by early and late half a chip apart.
    #[must_use]
    pub const fn error_chips(&self) -> f64 {
        self.chart.mean() / SLOPE
    }

    fn observe(&mut self, observed: f64) {
        self.chart.step(observed);
        self.steps = self.steps.saturating_add(1);
        if let Some(previous) = self.previous.replace(observed) {
            let differences = f64::from(self.steps - 1);
            let weight = newest_weight(differences, DEVIATION_WEIGHT);
            let square = 0.5 * (observed - previous) * (observed - previous);
            self.variance += weight * (square - self.variance);
        }
    }
}

impl ChannelMonitor for ShapeMonitor {
    type Input = Shape;

    fn name(&self) -> &str {
        "ewma"
    }

    fn cadence(&self) -> Cadence {
        Cadence::Integration
    }

    fn step(&mut self, input: &Shape) -> Result<ChannelVerdict, MonitorError> {
        let Some(observed) = self.balance.step(&input.magnitudes) else {
            return input.without_peak();
        };
        self.observe(observed);
        let Some(remaining) = self
            .settings
            .warm_up
            .checked_sub(self.steps)
            .filter(|r| *r > 0)
        else {
            let floor = self.settings.floor_chips;
            let variance = self.chart.mean_variance_of(self.variance) + floor * floor;
            let limit = self.settings.width * variance.sqrt();
            return Ok(ChannelVerdict::Judged(Judgement::new(
                self.chart.distance(),
                limit,
            )?));
        };
        let remaining_steps = remaining as usize;
        Ok(ChannelVerdict::WarmingUp { remaining_steps })
    }

    fn reset(&mut self) {
        self.balance.reset();
        self.chart.reset();
        self.previous = None;
        self.variance = 0.0;
        self.steps = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// A noisy triangle and a reflection half a chip late.
    fn shape(amplitude: f64, noise: f64, rng: &mut ChaCha8Rng) -> Shape {
        let peak = |x: f64| (1.0 - x.abs()).max(0.0);
        Shape {
            magnitudes: SHAPE_TAPS_CHIPS.map(|x| {
                let drawn: f64 = rng.sample(StandardNormal);
                (peak(x) + amplitude * peak(x - 0.5) + noise * drawn).abs()
            }),
        }
    }

    fn steps(
        monitor: &mut ShapeMonitor,
        count: usize,
        amplitude: f64,
        noise: f64,
        rng: &mut ChaCha8Rng,
    ) -> Option<usize> {
        let mut alarm = None;
        for k in 0..count {
            let verdict = monitor.step(&shape(amplitude, noise, rng)).unwrap();
            alarm = alarm.or(verdict.is_faulty().then_some(k));
        }
        alarm
    }

    #[test]
    fn a_reflection_alarms_and_its_sign_shows() {
        for (amplitude, sign) in [(0.3, 1.0), (-0.3, -1.0)] {
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let mut monitor = ShapeMonitor::new(ShapeSettings::default()).unwrap();
            assert_eq!(steps(&mut monitor, 5_000, 0.0, 0.05, &mut rng), None);
            let alarm = steps(&mut monitor, 200, amplitude, 0.05, &mut rng);
            assert!(alarm.is_some_and(|k| k < 100), "{alarm:?}");
            assert!(sign * monitor.mean_chips() > 0.0);
        }
    }

    #[test]
    fn the_limits_follow_the_noise() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut threshold = |noise| {
            let settings = ShapeSettings {
                floor_chips: 0.0,
                ..ShapeSettings::default()
            };
            let mut monitor = ShapeMonitor::new(settings).unwrap();
            assert_eq!(steps(&mut monitor, 3_000, 0.0, noise, &mut rng), None);
            let verdict = monitor.step(&shape(0.0, noise, &mut rng)).unwrap();
            verdict.judgement().unwrap().threshold()
        };
        let ratio = threshold(0.1) / threshold(0.02);
        // Five times the noise; the deviation of 200 steps is good to 6 %.
        assert!((4.0..6.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn it_warms_up_and_what_is_no_number_leaves_no_trace() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let settings = ShapeSettings {
            warm_up: 3,
            ..ShapeSettings::default()
        };
        let mut monitor = ShapeMonitor::new(settings).unwrap();
        for remaining_steps in [2, 1] {
            let verdict = monitor.step(&shape(0.0, 0.01, &mut rng)).unwrap();
            assert_eq!(verdict, ChannelVerdict::WarmingUp { remaining_steps });
            let before = monitor;
            let bad = Shape {
                magnitudes: [f64::NAN; 9],
            };
            assert!(monitor.step(&bad).is_err());
            assert_eq!(monitor, before);
        }
        let verdict = monitor.step(&shape(0.0, 0.01, &mut rng)).unwrap();
        assert!(verdict.judgement().is_some());
        let flat = Shape {
            magnitudes: [0.0; 9],
        };
        assert_eq!(monitor.step(&flat), Ok(ChannelVerdict::Unavailable));
        monitor.reset();
        assert_eq!(monitor, ShapeMonitor::new(settings).unwrap());
    }
}
