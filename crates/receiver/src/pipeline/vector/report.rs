//! Records of vector tracking.

use fault_ml::Judgement;
use gnss_nav::filter::{Covariance, Disposition, Innovation};
use gnss_nav::geodesy::Geodetic;
use gnss_nav::{GpsTime, SatelliteId};
use gnss_signal::tracking::Lock;
use nalgebra::Matrix3;

use super::watch::{Change, Watch};
use super::{Epoch, Member, Policy, VectorTracking};
use crate::pipeline::report::observation;
use crate::pipeline::slot::Slot;
use crate::record::{
    self, ChannelRecord, EventKind, InnovationRecord, LoopMembership, ObservationEpoch, PvtRecord,
    ScoreRecord, Source, Status,
};

/// Says what changed in the belief in a satellite.
pub(super) fn change(
    satellite: SatelliteId,
    change: &Change,
    policy: Policy,
    events: &mut Vec<(Option<SatelliteId>, EventKind)>,
) {
    let kind = match change {
        Change::Alarm { monitor, judgement } => {
            let monitor = (*monitor).to_owned();
            let (score, threshold) = (judgement.score(), judgement.threshold());
            if policy == Policy::Exclude {
                EventKind::Excluded {
                    monitor,
                    score,
                    threshold,
                }
            } else {
                EventKind::Alarm {
                    monitor,
                    score,
                    threshold,
                }
            }
        }
        Change::Cleared => EventKind::Readmitted,
    };
    events.push((Some(satellite), kind));
}

impl VectorTracking {
    /// The estimate as a record.
    pub(in crate::pipeline) fn pvt(&self, time_s: f64, epoch: &Epoch) -> PvtRecord {
        let state = self.state();
        let own = self.filter.covariance();
        let covariance = self.geometry.map_or(own, |g| g.with_lasting(&own));
        let to_enu = Geodetic::from_ecef(&state.position_ecef_m).enu_from_ecef();
        let enu = to_enu * block(&covariance, 0) * to_enu.transpose();
        PvtRecord {
            time_s,
            time: state.time,
            position_ecef_m: state.position_ecef_m,
            velocity_ecef_mps: state.velocity_ecef_mps,
            clock_bias_m: state.clock_bias_m,
            clock_drift_mps: state.clock_drift_mps,
            satellites_used: epoch.members.iter().filter(|m| m.used).count(),
            pdop: self.geometry.map_or(f64::INFINITY, |g| g.pdop),
            source: Source::Filter,
            sigma_enu_m: [enu[(0, 0)].sqrt(), enu[(1, 1)].sqrt(), enu[(2, 2)].sqrt()],
            sigma_velocity_mps: block(&covariance, 1).trace().sqrt(),
            horizontal_protection_m: None,
            vertical_protection_m: None,
            status: if self.is_fixed() {
                Status::Fix
            } else {
                Status::Predicted
            },
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
            cn0_dbhz: epoch.cn0_dbhz,
            lock: epoch.lock,
            membership: LoopMembership::Vector,
            prompt: epoch.prompt,
            code_error_chips: epoch.code_error_chips,
            frequency_error_hz: epoch.frequency_error_hz,
            pseudorange_m: member.raw.map(|r| r.pseudorange_m),
            range_rate_mps: member.raw.map(|r| r.range_rate_mps),
            innovation_code_m: code,
            innovation_rate_mps: rate,
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
    let score = |(monitor, judgement): &(&str, Judgement)| ScoreRecord {
        monitor: (*monitor).to_owned(),
        score: judgement.score(),
        threshold: judgement.threshold(),
    };
    watch.judgements().iter().map(score).collect()
}

fn innovation(innovation: &Innovation) -> InnovationRecord {
    InnovationRecord {
        value: innovation.value(),
        sigma: innovation.variance().sqrt(),
    }
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

/// The position block (`offset` 0) or the velocity block (1) of a covariance.
fn block(covariance: &Covariance, offset: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| covariance[(2 * row + offset, 2 * column + offset)])
}
