//! What monitors say of every satellite, and what the filter is told of it.

use gnss_nav::SatelliteId;
use gnss_nav::filter::{Disposition, GivenOthers, Innovations};
use gnss_signal::tracking::Lock;

use super::monitors::{self, deviations};
use super::watch::Watch;
use super::{Epoch, Member, READMIT_S, Time, VectorTracking, report, too_few};
use crate::ReceiverError;
use crate::pipeline::belief::Change;
use crate::record::EventKind;

impl VectorTracking {
    pub(super) fn watch(&mut self, satellite: SatelliteId) -> &mut Watch {
        let clean = (READMIT_S / self.settings.interval_s) as u32;
        self.watches
            .entry(satellite)
            .or_insert_with(|| Watch::new(self.monitors.clone(), clean))
    }

    /// Shows every monitor its satellite's innovations, `given` those of the others, once time is exact: an error of the
    /// coarse time moves every range by what its satellite comes nearer meanwhile, metres for tens of milliseconds, and
    /// none of them is faulty.
    pub(super) fn show(
        &mut self,
        innovations: &Innovations,
        given: &[GivenOthers],
        members: &mut [Member],
    ) -> Result<(), ReceiverError> {
        let heard = members.iter().filter(|m| m.epoch.lock != Lock::Lost);
        let heard = heard.map(|m| monitors::strength(m.satellite, &m.epoch));
        self.strengths.follow(&heard.collect::<Vec<_>>());
        if self.time() == Time::Coarse {
            return Ok(());
        }
        for (innovation, given) in innovations.satellites().iter().zip(given) {
            let satellite = innovation.satellite;
            let mut members = members.iter_mut();
            let Some(member) = members.find(|m| m.satellite == satellite) else {
                continue;
            };
            let others_change = self.strengths.of_others(satellite.prn.into());
            let step = monitors::step(innovation, given, &member.epoch, others_change);
            member.shown = Some(step);
            self.watch(satellite).hear(&step, member.shape)?;
        }
        Ok(())
    }

    /// Every satellite's innovations given those of the others that are believed.
    pub(super) fn deviations(
        &mut self,
        innovations: &Innovations,
    ) -> Result<Vec<GivenOthers>, ReceiverError> {
        let believed = |satellite| {
            let watch = self.watches.get(&satellite);
            watch.is_none_or(|watch| !watch.is_suspended())
        };
        deviations(
            innovations,
            &self.filter.covariance(),
            &mut self.scatter,
            self.settings.interval_s,
            believed,
        )
    }

    /// What follows from every monitor's say.
    ///
    /// Of several satellites that alarm at once the worst is left out first: by what it did to the filter it may have
    /// made the others look faulty, and they are judged anew without it.
    pub(super) fn believe(
        &mut self,
        innovations: &Innovations,
        epoch: &mut Epoch,
    ) -> Vec<(SatelliteId, Disposition)> {
        let policy = self.settings.policy;
        let alarms = innovations.satellites().iter().filter_map(|i| {
            let excess = self.watches.get(&i.satellite)?.alarm()?;
            Some((i.satellite, excess))
        });
        let one_at_a_time = self.settings.takes_back();
        let worst = alarms.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(s, _)| s);
        let mut dispositions = Vec::new();
        let mut weighted = Vec::new();
        let mut above_mask = Vec::new();
        for innovation in innovations.satellites() {
            let satellite = innovation.satellite;
            let mut members = epoch.members.iter();
            let Some(member) = members.find(|m| m.satellite == satellite) else {
                continue;
            };
            let variance_m2 = member
                .raw
                .map_or(f64::INFINITY, |r| r.pseudorange_variance_m2);
            let sigma_m = variance_m2.sqrt();
            let watch = self.watch(satellite);
            let waits = one_at_a_time && watch.alarm().is_some() && worst != Some(satellite);
            let change = if waits { None } else { watch.follow() };
            dispositions.push((satellite, watch.disposition(policy, sigma_m)));
            weighted.push(watch.weighted(sigma_m));
            above_mask.push(innovation.look.elevation_rad >= self.model.elevation_mask_rad);
            if let Some(change) = change {
                let kind = report::change(&change, policy);
                epoch.events.push((Some(satellite), kind));
                if change == Change::Cleared {
                    self.faults.forget(satellite);
                }
            }
        }
        let weighted = too_few::weight(&mut dispositions, &weighted, &above_mask);
        if (weighted > 0) != self.too_few_left {
            self.too_few_left = weighted > 0;
            epoch
                .events
                .push((None, EventKind::TooFewLeft { weighted }));
        }
        dispositions
    }

    /// Suspends channels of which the gate keeps refusing measurements (Li2019), where they are watched; not before time
    /// is exact, when what it refuses may be no fault and nobody could clear them again.
    pub(super) fn isolate(&mut self, channels: &[SatelliteId], epoch: &mut Epoch) {
        if self.time() == Time::Coarse {
            return;
        }
        let policy = self.settings.policy;
        for satellite in channels {
            let skipped = f64::from(self.faults.skipped_epochs(*satellite));
            let Some(change) = self.watch(*satellite).isolate(skipped) else {
                continue;
            };
            let kind = report::change(&change, policy);
            epoch.events.push((Some(*satellite), kind));
        }
    }
}
