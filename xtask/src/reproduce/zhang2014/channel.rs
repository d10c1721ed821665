//! A closed loop under watch by the chart of the paper.

use anyhow::Result;
use fault_ml::shape::{ChartSettings, EwmaChart, SHAPE_TAPS_CHIPS, largest_tap};

use super::closed_loop::{ClosedLoop, Reflection, Setting};

/// What a step shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// How late the replica is, chips.
    pub late_chips: f64,
    /// The observable, T, chips.
    pub observed_chips: f64,
    /// The chart's mean, Z, chips.
    pub mean_chips: f64,
    /// Half the distance of its limits, chips.
    pub limit_chips: f64,
}

impl Seen {
    /// Whether the mean is outside its limits.
    #[must_use]
    pub const fn is_outside(&self) -> bool {
        self.mean_chips.abs() > self.limit_chips
    }
}

/// A loop and its chart.
#[derive(Debug, Clone)]
pub struct Channel {
    closed: ClosedLoop,
    chart: EwmaChart,
}

impl Channel {
    /// A loop on its signal, and a chart at its target.
    ///
    /// # Errors
    /// Where the chart's settings are impossible.
    pub fn new(setting: Setting, chart: ChartSettings, seed: u64) -> Result<Self> {
        Ok(Self {
            closed: ClosedLoop::new(setting, seed),
            chart: EwmaChart::new(chart)?,
        })
    }

    /// Puts the chart back to its target.
    pub const fn restart_chart(&mut self) {
        self.chart.reset();
    }

    /// One integration over the direct signal and `reflections`.
    pub fn step(&mut self, reflections: &[Reflection]) -> Seen {
        let sums = self.closed.step(reflections);
        let observed_chips = largest_tap(&SHAPE_TAPS_CHIPS, &sums.shape).unwrap_or(0.0);
        Seen {
            observed_chips,
            mean_chips: self.chart.step(observed_chips),
            limit_chips: self.chart.limit(),
            late_chips: self.closed.late_chips(),
        }
    }
}
