//! A satellite's monitors in vector tracking, and whether it is believed.

use fault_ml::learned::ChannelStep;
use fault_ml::{ChannelVerdict, Health};
use gnss_nav::filter::Disposition;

use super::monitors::Monitor;
use super::settings::Policy;
use crate::ReceiverError;
use crate::pipeline::belief::{Belief, Change, Said};
use crate::pipeline::shape::{self, ShapeSaid};

/// One satellite under watch.
#[derive(Debug, Clone)]
pub(super) struct Watch {
    monitors: Vec<Monitor>,
    belief: Belief,
    judgements: Vec<Said>,
    /// What the shape of the correlation said last.
    shape: Option<ShapeSaid>,
    is_watched: bool,
}

impl Watch {
    /// A satellite of which nothing is known; once suspended it takes `clean_to_readmit` healthy epochs
    /// to be believed again.
    pub(super) const fn new(monitors: Vec<Monitor>, clean_to_readmit: u32) -> Self {
        Self {
            is_watched: !monitors.is_empty(),
            monitors,
            belief: Belief::new(clean_to_readmit),
            judgements: Vec::new(),
            shape: None,
        }
    }

    /// The signal is gone: what its monitors saw no longer counts.
    pub(super) fn lost(&mut self) {
        self.monitors.iter_mut().for_each(Monitor::reset);
        self.judgements.clear();
        self.shape = None;
        self.belief.lost();
    }

    /// Shows this epoch to every monitor, and takes what the `shape` of the correlation says, which is
    /// watched integration by integration.
    ///
    /// # Errors
    /// Where the innovation is no number.
    pub(super) fn hear(
        &mut self,
        step: &ChannelStep,
        shape: Option<ShapeSaid>,
    ) -> Result<(), ReceiverError> {
        self.judgements.clear();
        for monitor in &mut self.monitors {
            if let ChannelVerdict::Judged(judgement) = monitor.step(step)? {
                self.judgements.push((monitor.name(), judgement));
            }
        }
        self.shape = shape;
        self.judgements
            .extend(shape.map(|s| (shape::NAME, s.judgement)));
        self.is_watched |= shape.is_some();
        Ok(())
    }

    /// Shows the last epochs to every monitor as if they were the first: the filter, and so the innovations, were
    /// others than those they saw. What is not believed stays as it is.
    ///
    /// # Errors
    /// As [`Self::hear`].
    pub(super) fn hear_again(&mut self, steps: &[ChannelStep]) -> Result<(), ReceiverError> {
        if self.is_suspended() || steps.is_empty() {
            return Ok(());
        }
        self.monitors.iter_mut().for_each(Monitor::reset);
        steps
            .iter()
            .try_for_each(|step| self.hear(step, self.shape))
    }

    /// By how much a satellite that is believed exceeds a threshold, the largest score over its threshold; `None` where
    /// it exceeds none.
    pub(super) fn alarm(&self) -> Option<f64> {
        let judged = self.judgements.iter().map(|(_, judgement)| judgement);
        let faulty = judged.filter(|j| j.health() == Health::Faulty);
        let excess = faulty.map(|j| j.score() / j.threshold());
        excess
            .max_by(f64::total_cmp)
            .filter(|_| !self.is_suspended())
    }

    /// Follows what was heard last; returns what changed by it.
    pub(super) fn follow(&mut self) -> Option<Change> {
        self.belief.follow(&self.judgements)
    }

    /// The gate refused measurements of `skipped` of the last epochs; returns what changed by it.
    /// Without a monitor nothing could clear the satellite again, and nothing is done.
    pub(super) fn isolate(&mut self, skipped: f64) -> Option<Change> {
        self.is_watched.then(|| self.belief.isolate(skipped))?
    }

    /// Whether it is not believed.
    pub(super) const fn is_suspended(&self) -> bool {
        self.belief.is_suspended()
    }

    /// What the filter is to do with the satellite, whose pseudorange has a deviation of `sigma_m`.
    pub(super) fn disposition(&self, policy: Policy, sigma_m: f64) -> Disposition {
        let error_over_sigma = self.shape.map(|s| s.error_m / sigma_m);
        self.belief.disposition(policy, error_over_sigma)
    }

    /// What the filter may do with the satellite where it cannot do without: weighted where it is suspended,
    /// by how much the shape of its correlation says that it errs or else by the usual factor.
    pub(super) fn weighted(&self, sigma_m: f64) -> Disposition {
        let variance_factor = Policy::VARIANCE_FACTOR;
        self.disposition(Policy::Deweight { variance_factor }, sigma_m)
    }

    /// Monitor, score and threshold of the last epoch, of each that judged.
    pub(super) fn judgements(&self) -> &[Said] {
        &self.judgements
    }
}
