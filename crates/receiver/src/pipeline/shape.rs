//! The shape of a channel's correlation under watch, in scalar and vector tracking alike.

use fault_ml::shape::{SHAPE_TAPS_CHIPS, Shape, ShapeMonitor};
use fault_ml::{ChannelMonitor, Judgement};
use gnss_nav::RawMeasurement;
use gnss_nav::constants::{CA_CODE_RATE_HZ, SPEED_OF_LIGHT_MPS};
use gnss_nav::filter::Disposition;
use gnss_signal::tracking::{Channel, Lock};
use gnss_signal::{Replica, Taps};

use super::belief::{Belief, Change};
use super::settings::{Settings, ShapeWatching};
use super::vector::{Policy, READMIT_S};
use crate::ReceiverError;

/// Name in results.
pub(super) const NAME: &str = "ewma";
/// Length of a chip, m.
const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / CA_CODE_RATE_HZ;

/// What the shape of the last integration says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ShapeSaid {
    pub(super) judgement: Judgement,
    /// How much too long the pseudorange is taken to be, m.
    pub(super) error_m: f64,
}

/// One channel's shape under watch.
#[derive(Debug, Clone)]
pub(super) struct ShapeWatch {
    monitor: ShapeMonitor,
    judgement: Option<Judgement>,
    /// What scalar tracking makes of it; vector tracking has its own.
    belief: Belief,
    watching: ShapeWatching,
}

impl ShapeWatch {
    /// A channel of which nothing is known; `None` where shapes are not watched.
    ///
    /// # Errors
    /// Where the settings of the chart are impossible.
    pub(super) fn new(settings: &Settings) -> Result<Option<Self>, ReceiverError> {
        let watch = |watching: ShapeWatching| {
            Ok(Self {
                monitor: ShapeMonitor::new(watching.chart)?,
                judgement: None,
                belief: Belief::new((READMIT_S * settings.rate_hz) as u32),
                watching,
            })
        };
        settings.shape.map(watch).transpose()
    }

    /// Takes the sums of an integration of `channel`.
    pub(super) fn step(&mut self, replica: &Replica, taps: &Taps, channel: &Channel) {
        if channel.lock() == Lock::Lost || channel.is_silent() {
            self.monitor.reset();
            self.judgement = None;
            return;
        }
        let Some(sums) = taps.as_slice().last_chunk() else {
            return;
        };
        if replica.tap_offsets.as_slice().ends_with(&SHAPE_TAPS_CHIPS) {
            let magnitudes = sums.map(|sum| sum.norm_sqr().sqrt());
            let verdict = self.monitor.step(&Shape { magnitudes });
            self.judgement = verdict.ok().and_then(|v| v.judgement().copied());
        }
    }

    /// What the shape of the last integration says.
    pub(super) fn said(&self) -> Option<ShapeSaid> {
        Some(ShapeSaid {
            judgement: self.judgement?,
            error_m: CHIP_M * self.monitor.error_chips(),
        })
    }

    /// A navigation epoch of scalar tracking: what changed by it, and the policy.
    pub(super) fn follow(&mut self) -> Option<(Change, Policy)> {
        let judgement = self.judgement?;
        let change = self.belief.follow(&[(NAME, judgement)])?;
        Some((change, self.watching.policy))
    }

    /// What a solution of scalar tracking is to do with a measurement of the channel.
    pub(super) fn disposition(&self, raw: &RawMeasurement) -> Disposition {
        self.belief
            .disposition(self.watching.policy, self.error_over_sigma(raw))
    }

    /// The same where it cannot do without.
    pub(super) fn weighted(&self, raw: &RawMeasurement) -> Disposition {
        let weighted = self.belief.weighted(self.error_over_sigma(raw));
        weighted.unwrap_or(Disposition::Use)
    }

    fn error_over_sigma(&self, raw: &RawMeasurement) -> Option<f64> {
        Some(self.said()?.error_m / raw.pseudorange_variance_m2.sqrt())
    }
}
