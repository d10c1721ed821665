//! Whether a satellite is believed, by what its monitors say.

use fault_ml::{Health, Judgement};
use gnss_nav::filter::{Disposition, FaultThresholds};

use super::shape;
use super::vector::Policy;

/// Monitor and judgement.
pub(super) type Said = (&'static str, Judgement);

/// Whether a satellite is believed.
#[derive(Debug, Clone)]
pub(super) struct Belief {
    suspended: Option<Suspended>,
    clean_to_readmit: u32,
}

/// A satellite that is not believed.
#[derive(Debug, Clone, Copy)]
struct Suspended {
    clean_epochs: u32,
    /// Another monitor than the chart on the shape found it faulty.
    by_others: bool,
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

impl Belief {
    /// A satellite of which nothing is known; once suspended it takes `clean_to_readmit` healthy epochs
    /// to be believed again.
    pub(super) const fn new(clean_to_readmit: u32) -> Self {
        Self {
            suspended: None,
            clean_to_readmit,
        }
    }

    /// Whether the satellite is not believed.
    pub(super) const fn is_suspended(&self) -> bool {
        self.suspended.is_some()
    }

    /// The signal is gone: to be believed again it has to be healthy anew.
    pub(super) fn lost(&mut self) {
        if let Some(suspended) = &mut self.suspended {
            suspended.clean_epochs = 0;
        }
    }

    /// One monitor is enough to suspend; to be believed again all that judge must find it healthy.
    pub(super) fn follow(&mut self, judgements: &[Said]) -> Option<Change> {
        if judgements.is_empty() {
            return None;
        }
        let is_faulty = |said: &&Said| said.1.health() == Health::Faulty;
        let mut faulty = judgements.iter().filter(is_faulty);
        let by_others = faulty.clone().any(|(monitor, _)| *monitor != shape::NAME);
        match (&mut self.suspended, faulty.next()) {
            (None, Some((monitor, judgement))) => {
                self.suspended = Some(Suspended {
                    clean_epochs: 0,
                    by_others,
                });
                Some(Change::Alarm {
                    monitor,
                    judgement: *judgement,
                })
            }
            (None, None) => None,
            (Some(suspended), faulty) => {
                suspended.by_others |= by_others;
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
    pub(super) fn isolate(&mut self, skipped: f64) -> Option<Change> {
        if self.suspended.is_some() {
            return None;
        }
        // So many epochs and more: the threshold itself is exceeded.
        let threshold = f64::from(FaultThresholds::default().epochs_to_isolate) - 1.0;
        let judgement = Judgement::new(skipped, threshold).ok()?;
        self.suspended = Some(Suspended {
            clean_epochs: 0,
            by_others: true,
        });
        Some(Change::Alarm {
            monitor: "gate",
            judgement,
        })
    }

    /// What is to be done with the satellite; `error_over_sigma` where the shape of its correlation says by
    /// how much its pseudorange errs, in deviations of it.
    pub(super) fn disposition(&self, policy: Policy, error_over_sigma: Option<f64>) -> Disposition {
        match (self.suspended, policy) {
            (None, _) | (_, Policy::Observe) => Disposition::Use,
            (Some(_), Policy::Deweight { variance_factor }) => {
                let weighted = self.weighted(error_over_sigma);
                weighted.unwrap_or(Disposition::Deweight { variance_factor })
            }
            (Some(_), Policy::Exclude) => Disposition::Exclude,
        }
    }

    /// The weight 1 / (sigma^2 + error^2) of a suspended satellite of which the shape says the error, but no
    /// more than usual where others suspended it; `None` where the shape says nothing.
    pub(super) fn weighted(&self, error_over_sigma: Option<f64>) -> Option<Disposition> {
        let (suspended, error) = (self.suspended?, error_over_sigma?);
        let least = if suspended.by_others {
            Policy::VARIANCE_FACTOR
        } else {
            1.0
        };
        Some(Disposition::Deweight {
            variance_factor: (1.0 + error * error).max(least),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(score: f64) -> [Said; 1] {
        [("ewma", Judgement::new(score, 1.0).unwrap())]
    }

    #[test]
    fn healthy_epochs_before_a_loss_do_not_count() {
        let mut belief = Belief::new(2);
        belief.follow(&said(1.5));
        assert_eq!(belief.follow(&said(0.5)), None);
        belief.lost();
        assert_eq!(belief.follow(&said(0.5)), None);
        assert_eq!(belief.follow(&said(0.5)), Some(Change::Cleared));
    }

    #[test]
    fn an_alarm_lasts_until_it_was_healthy_long_enough() {
        let mut belief = Belief::new(2);
        assert_eq!(belief.follow(&said(0.5)), None);
        assert!(matches!(
            belief.follow(&said(1.5)),
            Some(Change::Alarm { .. })
        ));
        assert_eq!(
            belief.disposition(Policy::Exclude, None),
            Disposition::Exclude
        );
        assert_eq!(belief.disposition(Policy::Observe, None), Disposition::Use);
        for score in [0.5, 1.5, 0.5] {
            assert_eq!(belief.follow(&said(score)), None);
        }
        assert_eq!(belief.follow(&[]), None);
        assert_eq!(belief.follow(&said(0.5)), Some(Change::Cleared));
        assert_eq!(belief.disposition(Policy::Exclude, None), Disposition::Use);
    }

    #[test]
    fn weight_falls_with_the_error_that_is_suspected() {
        let mut belief = Belief::new(2);
        belief.follow(&said(1.5));
        let alarmed = belief.clone();
        let deweight = Policy::Deweight {
            variance_factor: 100.0,
        };
        let factor = |error| match alarmed.disposition(deweight, error) {
            Disposition::Deweight { variance_factor } => variance_factor,
            _ => 0.0,
        };
        assert_eq!(
            [factor(None), factor(Some(3.0)), factor(Some(-3.0))],
            [100.0, 10.0, 10.0]
        );
        // What others found faulty is not told by the shape.
        let other = ("innovation", Judgement::new(5.0, 1.0).unwrap());
        belief.follow(&[other, said(0.1)[0]]);
        let usual = Disposition::Deweight {
            variance_factor: Policy::VARIANCE_FACTOR,
        };
        assert_eq!(belief.weighted(Some(3.0)), Some(usual));
        assert_eq!(belief.weighted(None), None);
    }
}
