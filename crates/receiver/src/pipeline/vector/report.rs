//! Records of vector tracking.

use gnss_nav::GpsTime;
use gnss_nav::filter::Disposition;
use gnss_signal::tracking::Lock;

use super::watch::Watch;
use super::{Epoch, Member, Policy, VectorTracking};
use crate::pipeline::belief::Change;
use crate::pipeline::report::{filtered, innovation, observation, score, tracking};
use crate::pipeline::slot::Slot;
use crate::record::{
    self, ChannelRecord, EventKind, FilterRecord, LoopMembership, ObservationEpoch, PvtRecord,
    ScoreRecord, Status,
};

/// Says what changed in the belief in a satellite.
pub(in crate::pipeline) fn change(change: &Change, policy: Policy) -> EventKind {
    let Change::Alarm { monitor, judgement } = change else {
        return EventKind::Readmitted;
    };
    let monitor = (*monitor).to_owned();
    let (score, threshold) = (judgement.score(), judgement.threshold());
    if policy == Policy::Exclude {
        EventKind::Excluded {
            monitor,
            score,
            threshold,
            residual_m: None,
        }
    } else {
        EventKind::Alarm {
            monitor,
            score,
            threshold,
        }
    }
}

impl VectorTracking {
    /// The estimate as a record.
    pub(in crate::pipeline) fn pvt(&self, time_s: f64, epoch: &Epoch) -> PvtRecord {
        let own = self.filter.covariance_after(epoch.age_s());
        let mut covariance = self.geometry.map_or(own, |g| g.with_lasting(&own));
        if let Some(shift) = self.coarse_shift_m {
            let offsets = shift * shift.transpose();
            for (row, column) in (0..4).flat_map(|row| (0..4).map(move |c| (row, c))) {
                covariance[(2 * row, 2 * column)] += offsets[(row, column)];
            }
        }
        let status = if self.is_fixed() {
            Status::Fix
        } else {
            Status::Predicted
        };
        PvtRecord {
            satellites_used: epoch.members.iter().filter(|m| m.used).count(),
            pdop: self.geometry.map_or(f64::INFINITY, |g| g.pdop),
            filter: Some(Box::new(FilterRecord {
                covariance: own,
                normalised_innovation_squared: epoch.normalised_innovation_squared,
                innovations: epoch.innovations_used,
            })),
            ..filtered(time_s, self.state(), &covariance, status)
        }
    }

    /// A steered channel as a record.
    pub(in crate::pipeline) fn channel(&self, time_s: f64, member: &Member) -> ChannelRecord {
        let epoch = &member.epoch;
        let (code, rate) = member.innovation.map_or((None, None), |i| {
            (Some(innovation(&i.code)), i.rate.as_ref().map(innovation))
        });
        let watch = self.watches.get(&member.satellite);
        ChannelRecord {
            time_s,
            satellite: member.satellite,
            cn0_dbhz: Some(epoch.cn0_dbhz),
            tracking: Some(tracking(epoch, LoopMembership::Vector)),
            pseudorange_m: member.raw.map(|r| r.pseudorange_m),
            range_rate_mps: member.raw.map(|r| r.range_rate_mps),
            innovation_code_m: code,
            innovation_rate_mps: rate,
            shown: member.shown,
            disposition: disposition(member.disposition),
            scores: watch.map(scores).unwrap_or_default(),
        }
    }
}

/// What the steered channels observed.
pub(in crate::pipeline) fn observations(
    time_s: f64,
    time: GpsTime,
    epoch: &Epoch,
    slots: &mut [Slot],
) -> ObservationEpoch {
    let observations = epoch.members.iter().filter_map(|member| {
        let slot = slots.iter_mut().find(|s| s.satellite == member.satellite)?;
        let raw = member.raw.filter(|_| member.epoch.lock != Lock::Lost)?;
        let look = member.expected.look;
        let sight = Some((look.azimuth_rad, look.elevation_rad));
        Some(observation(slot, &member.epoch, &raw, sight))
    });
    ObservationEpoch {
        time_s,
        time,
        observations: observations.collect(),
    }
}

fn scores(watch: &Watch) -> Vec<ScoreRecord> {
    watch.judgements().iter().map(score).collect()
}

const fn disposition(told: Option<Disposition>) -> record::Disposition {
    match told {
        None => record::Disposition::Unavailable,
        Some(Disposition::Use) => record::Disposition::Use,
        Some(Disposition::Deweight { variance_factor }) => {
            record::Disposition::Deweight { variance_factor }
        }
        Some(Disposition::Exclude) => record::Disposition::Exclude,
    }
}
