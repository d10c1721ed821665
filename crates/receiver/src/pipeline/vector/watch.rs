//! Whether a satellite is believed: its monitor, and what followed from it.

use fault_ml::{ChannelMonitor, ChannelVerdict, Innovation, InnovationTest, Judgement};
use gnss_nav::filter::{Disposition, FaultThresholds, SatelliteInnovation};

use super::settings::Policy;
use crate::ReceiverError;

/// One satellite under watch.
#[derive(Debug, Clone)]
pub(super) struct Watch {
    monitor: Option<InnovationTest>,
    suspended: Option<Suspended>,
    judgement: Option<Judgement>,
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
    pub(super) const fn new(monitor: Option<InnovationTest>, clean_to_readmit: u32) -> Self {
        Self {
            monitor,
            suspended: None,
            judgement: None,
            clean_to_readmit,
        }
    }

    /// The signal is gone: what its monitor saw no longer counts.
    pub(super) fn lost(&mut self) {
        if let Some(monitor) = &mut self.monitor {
            monitor.reset();
        }
        self.judgement = None;
    }

    /// Judges this epoch's innovation; returns what changed by it.
    ///
    /// # Errors
    /// Where the innovation is no number.
    pub(super) fn judge(
        &mut self,
        innovation: &SatelliteInnovation,
    ) -> Result<Option<Change>, ReceiverError> {
        let Some(monitor) = &mut self.monitor else {
            return Ok(None);
        };
        let (rate_mps, rate_sigma_mps) = innovation.rate.map_or((0.0, f64::INFINITY), |rate| {
            (rate.value(), rate.variance().sqrt())
        });
        let verdict = monitor.step(&Innovation {
            code_m: innovation.code.value(),
            code_sigma_m: innovation.code.variance().sqrt(),
            rate_mps,
            rate_sigma_mps,
        })?;
        self.judgement = verdict.judgement().copied();
        Ok(self.follow(&verdict))
    }

    fn follow(&mut self, verdict: &ChannelVerdict) -> Option<Change> {
        let ChannelVerdict::Judged(judgement) = verdict else {
            return None;
        };
        match (&mut self.suspended, verdict.is_faulty()) {
            (None, true) => {
                self.suspended = Some(Suspended::default());
                Some(Change::Alarm {
                    monitor: "innovation",
                    judgement: *judgement,
                })
            }
            (None, false) => None,
            (Some(suspended), faulty) => {
                suspended.clean_epochs = if faulty {
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
        if self.suspended.is_some() || self.monitor.is_none() {
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

    /// Score and threshold of the last epoch, where there are any.
    pub(super) const fn judgement(&self) -> Option<&Judgement> {
        self.judgement.as_ref()
    }
}
