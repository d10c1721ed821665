//! Whether a satellite is believed: its monitors, and what followed from them.

use fault_ml::learned::ChannelStep;
use fault_ml::{ChannelVerdict, Health, Judgement};
use gnss_nav::filter::{Disposition, FaultThresholds};

use super::monitors::Monitor;
use super::settings::Policy;
use crate::ReceiverError;

/// One satellite under watch.
#[derive(Debug, Clone)]
pub(super) struct Watch {
    monitors: Vec<Monitor>,
    suspended: Option<Suspended>,
    judgements: Vec<(&'static str, Judgement)>,
    clean_to_readmit: u32,
}

/// A satellite that is not believed.
#[derive(Debug, Clone, Copy, Default)]
struct Suspended {
    clean_epochs: u32,
}

/// A change of what is believed.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Change {
    /// Found faulty, by whom.
    Alarm {
        monitor: &'static str,
        judgement: Judgement,
    },
    /// Found healthy again.
    Cleared,
}

impl Watch {
    /// A satellite of which nothing is known; once suspended it takes `clean_to_readmit` healthy epochs
    /// to be believed again.
    pub(super) const fn new(monitors: Vec<Monitor>, clean_to_readmit: u32) -> Self {
        Self {
            monitors,
            suspended: None,
            judgements: Vec::new(),
            clean_to_readmit,
        }
    }

    /// The signal is gone: what its monitors saw no longer counts.
    pub(super) fn lost(&mut self) {
        self.monitors.iter_mut().for_each(Monitor::reset);
        self.judgements.clear();
    }

    /// Shows this epoch to every monitor; returns what changed by it.
    ///
    /// # Errors
    /// Where the innovation is no number.
    pub(super) fn judge(&mut self, step: &ChannelStep) -> Result<Option<Change>, ReceiverError> {
        self.judgements.clear();
        for monitor in &mut self.monitors {
            if let ChannelVerdict::Judged(judgement) = monitor.step(step)? {
                self.judgements.push((monitor.name(), judgement));
            }
        }
        Ok(self.follow())
    }

    /// One monitor is enough to suspend; to be believed again all that judge must find it healthy.
    fn follow(&mut self) -> Option<Change> {
        if self.judgements.is_empty() {
            return None;
        }
        let mut judgements = self.judgements.iter();
        let faulty = judgements.find(|(_, judgement)| judgement.health() == Health::Faulty);
        match (&mut self.suspended, faulty) {
            (None, Some((monitor, judgement))) => {
                self.suspended = Some(Suspended::default());
                Some(Change::Alarm {
                    monitor,
                    judgement: *judgement,
                })
            }
            (None, None) => None,
            (Some(suspended), faulty) => {
                suspended.clean_epochs = if faulty.is_some() {
                    0
                } else {
                    suspended.clean_epochs + 1
                };
                let clean = suspended.clean_epochs >= self.clean_to_readmit;
                if clean {
                    self.suspended = None;
                }
                clean.then_some(Change::Cleared)
            }
        }
    }

    /// The gate refused measurements of `skipped` of the last epochs; returns what changed by it.
    /// Without a monitor nothing could clear the satellite again, and nothing is done.
    pub(super) fn isolate(&mut self, skipped: f64) -> Option<Change> {
        if self.suspended.is_some() || self.monitors.is_empty() {
            return None;
        }
        // So many epochs and more: the threshold itself is exceeded.
        let threshold = f64::from(FaultThresholds::default().epochs_to_isolate) - 1.0;
        let judgement = Judgement::new(skipped, threshold).ok()?;
        self.suspended = Some(Suspended::default());
        Some(Change::Alarm {
            monitor: "gate",
            judgement,
        })
    }

    /// Whether it is not believed.
    pub(super) const fn is_suspended(&self) -> bool {
        self.suspended.is_some()
    }

    /// What the filter is to do with the satellite.
    pub(super) const fn disposition(&self, policy: Policy) -> Disposition {
        match (self.suspended, policy) {
            (None, _) | (_, Policy::Observe) => Disposition::Use,
            (Some(_), Policy::Deweight { variance_factor }) => {
                Disposition::Deweight { variance_factor }
            }
            (Some(_), Policy::Exclude) => Disposition::Exclude,
        }
    }

    /// Monitor, score and threshold of the last epoch, of each that judged.
    pub(super) fn judgements(&self) -> &[(&'static str, Judgement)] {
        &self.judgements
    }
}
