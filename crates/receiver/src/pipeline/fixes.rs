//! The solution of a navigation epoch, and the events it makes.

use std::collections::BTreeSet;

use gnss_nav::{SatelliteId, Solution};
use gnss_signal::CorrelatorBank;

use super::navigator::{EXCLUSION_FALSE_ALARM, Tracked};
use super::report;
use super::run::{Fixed, Run};
use super::slot::Slot;
use super::vector;
use crate::ReceiverError;
use crate::record::{EventKind, Record};

impl<B: CorrelatorBank> Run<'_, B> {
    /// Position, velocity and time of this epoch by least squares, and all its records.
    pub(super) fn navigate(&mut self, now: u64) -> Result<(), ReceiverError> {
        let time_s = self.time_s(now);
        for (satellite, kind) in self.follow_shapes() {
            self.emit(now, Some(satellite), kind)?;
        }
        let mut tracked = tracked(now, &mut self.slots);
        let navigated = self.navigator.navigate(now, &mut tracked);
        let observations = report::observations(time_s, &mut tracked, &navigated);
        if let Some(observations) = observations {
            (self.sink)(Record::Observations(observations))?;
        }
        for one in &tracked {
            let record = report::channel(time_s, one, &navigated);
            (self.sink)(Record::Channel(record))?;
        }
        self.consider_vector_tracking(now, &navigated)?;
        let fix = navigated.fix.as_ref();
        if let Some((solution, source)) = fix {
            self.report_exclusions(now, solution)?;
            self.report_fix(now, Fixed::Now)?;
            let pvt = report::pvt(time_s, solution, *source);
            (self.sink)(Record::Pvt(pvt))
        } else {
            self.report_fix(now, Fixed::Before)
        }
    }

    /// Believes the satellites anew by the shapes of their correlations; returns what changed.
    fn follow_shapes(&mut self) -> Vec<(SatelliteId, EventKind)> {
        let change = |slot: &mut Slot| {
            let (change, policy) = slot.shape.as_mut()?.follow()?;
            Some((slot.satellite, vector::change(&change, policy)))
        };
        self.slots.iter_mut().filter_map(change).collect()
    }

    pub(super) fn report_fix(&mut self, now: u64, to: Fixed) -> Result<(), ReceiverError> {
        let from = self.fixed;
        match (from, to) {
            (Fixed::Never, Fixed::Now) => {
                self.fixed = to;
                self.emit(now, None, EventKind::FirstFix)
            }
            (Fixed::Now, Fixed::Before) => {
                self.fixed = to;
                self.emit(now, None, EventKind::FixLost)
            }
            (Fixed::Before, Fixed::Now) => {
                self.fixed = to;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn report_exclusions(&mut self, now: u64, solution: &Solution) -> Result<(), ReceiverError> {
        let excluded: BTreeSet<_> = solution.excluded.iter().copied().collect();
        let before = std::mem::replace(&mut self.excluded, excluded.clone());
        for satellite in excluded.difference(&before) {
            let kind = EventKind::Excluded {
                monitor: "residuals".to_owned(),
                score: solution.chi_square,
                threshold: report::residual_threshold(solution, EXCLUSION_FALSE_ALARM),
                residual_m: None,
            };
            self.emit(now, Some(*satellite), kind)?;
        }
        for satellite in before.difference(&excluded) {
            let tracked = self.slots.iter().any(|s| s.satellite == *satellite);
            if tracked {
                self.emit(now, Some(*satellite), EventKind::Readmitted)?;
            }
        }
        Ok(())
    }
}

/// The channels that have something to say at `now`.
pub(super) fn tracked(now: u64, slots: &mut [Slot]) -> Vec<Tracked<'_>> {
    let said = slots.iter_mut().filter_map(|slot| {
        let epoch = slot.channel.epoch(now)?;
        Some(Tracked { slot, epoch })
    });
    said.collect()
}
