//! The solution of a navigation epoch, and the events it makes.

use std::collections::BTreeSet;

use gnss_nav::SatelliteId;
use gnss_nav::integrity::Misfit;
use gnss_signal::CorrelatorBank;

use super::navigator::Tracked;
use super::report;
use super::run::{Fixed, Run};
use super::slot::Slot;
use super::vector;
use crate::ReceiverError;
use crate::record::{EventKind, PvtRecord, Record};

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
            let mut record = report::channel(time_s, one, &navigated);
            record.scores.extend(self.navigator.watch.score());
            (self.sink)(Record::Channel(record))?;
        }
        self.consider_vector_tracking(now, &navigated)?;
        let fix = navigated.fix.as_ref();
        if let Some((solution, source)) = fix {
            self.report_exclusions(now, &navigated.misfits)?;
            self.report_fix(now, Fixed::Now)?;
            let pvt = PvtRecord {
                horizontal_protection_m: navigated.protection.map(|p| p.horizontal_m),
                vertical_protection_m: navigated.protection.map(|p| p.vertical_m),
                ..report::pvt(time_s, solution, *source)
            };
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

    fn report_exclusions(&mut self, now: u64, misfits: &[Misfit]) -> Result<(), ReceiverError> {
        let excluded: BTreeSet<_> = misfits.iter().map(|m| m.satellite).collect();
        let before = std::mem::replace(&mut self.excluded, excluded.clone());
        for misfit in misfits {
            if !before.contains(&misfit.satellite) {
                let kind = self.navigator.watch.exclusion(misfit);
                self.emit(now, Some(misfit.satellite), kind)?;
            }
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
