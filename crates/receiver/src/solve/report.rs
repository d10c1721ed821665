//! Records of an epoch.

use gnss_nav::{GpsTime, RawMeasurement};

use super::kinematic::Estimate;
use super::single_point::Fix;
use super::solver::Solved;
use crate::pipeline::{filter_record, innovation, solution_record};
use crate::record::{
    CarrierPhase, ChannelRecord, Disposition, InnovationRecord, Observation, ObservationEpoch,
    PvtRecord, Source, Status,
};
use crate::rinex_obs::ObservedSatellite;

/// The solution of an epoch.
pub(super) fn pvt(time_s: f64, fix: &Fix) -> PvtRecord {
    PvtRecord {
        horizontal_protection_m: fix.protection.map(|p| p.horizontal_m),
        vertical_protection_m: fix.protection.map(|p| p.vertical_m),
        status: if fix.is_trusted {
            Status::Fix
        } else {
            Status::Unreliable
        },
        ..solution_record(time_s, &fix.solution, Source::LeastSquares)
    }
}

/// The filter's estimate.
pub(super) fn filtered(time_s: f64, estimate: &Estimate) -> PvtRecord {
    let state = &estimate.state;
    let status = if estimate.is_determined {
        Status::Fix
    } else {
        Status::Predicted
    };
    PvtRecord {
        satellites_used: estimate.satellites,
        pdop: estimate.pdop,
        horizontal_protection_m: estimate.protection.map(|p| p.horizontal_m),
        vertical_protection_m: estimate.protection.map(|p| p.vertical_m),
        ..filter_record(time_s, state, &estimate.covariance, status)
    }
}

/// What was observed, with where it stood in the sky.
pub(super) fn observations(
    time_s: f64,
    time: GpsTime,
    observed: &[ObservedSatellite],
    raw: &[RawMeasurement],
    fix: Option<&Fix>,
) -> ObservationEpoch {
    let observations = observed.iter().zip(raw).map(|(o, raw)| {
        let used = fix.and_then(|fix| {
            let mut satellites = fix.solution.satellites.iter();
            satellites.find(|s| s.satellite == o.satellite)
        });
        Observation {
            satellite: o.satellite,
            pseudorange_m: raw.pseudorange_m,
            doppler_hz: o.doppler_hz,
            cn0_dbhz: o.cn0_dbhz,
            carrier_phase: o.phase_cycles.map(|cycles| CarrierPhase {
                cycles,
                loss_of_lock: o.loss_of_lock & 1 != 0,
                half_cycle: o.loss_of_lock & 2 != 0,
            }),
            azimuth_rad: used.map(|u| u.azimuth_rad),
            elevation_rad: used.map(|u| u.elevation_rad),
        }
    });
    ObservationEpoch {
        time_s,
        time,
        observations: observations.collect(),
    }
}

/// A satellite of an epoch.
pub(super) fn channel(
    time_s: f64,
    observed: &ObservedSatellite,
    raw: &RawMeasurement,
    solved: &Solved,
) -> ChannelRecord {
    let satellite = observed.satellite;
    let fix = solved.fix.as_ref();
    let held = solved.estimate.as_ref().and_then(|estimate| {
        let mut satellites = estimate.innovations.satellites().iter();
        satellites.find(|s| s.satellite == satellite)
    });
    let used = fix.and_then(|fix| {
        let mut satellites = fix.solution.satellites.iter();
        satellites.find(|s| s.satellite == satellite)
    });
    let disposition = match fix {
        Some(fix) if fix.excludes(satellite).is_some() => Disposition::Exclude,
        Some(_) if used.is_some() => Disposition::Use,
        _ if held.is_some() => Disposition::Use,
        _ => Disposition::Unavailable,
    };
    ChannelRecord {
        time_s,
        satellite,
        cn0_dbhz: observed.cn0_dbhz,
        tracking: None,
        pseudorange_m: Some(raw.pseudorange_m),
        range_rate_mps: observed.doppler_hz.map(|_| raw.range_rate_mps),
        innovation_code_m: match held {
            Some(held) => Some(innovation(&held.code)),
            None => used.map(|u| InnovationRecord {
                value: u.pseudorange_residual_m,
                sigma: u.pseudorange_sigma_m,
            }),
        },
        innovation_rate_mps: match held {
            Some(held) => held.rate.as_ref().map(innovation),
            None => used.and_then(|u| {
                Some(InnovationRecord {
                    value: u.range_rate_residual_mps?,
                    sigma: raw.range_rate_variance_m2_s2.sqrt(),
                })
            }),
        },
        shown: None,
        disposition,
        scores: Vec::new(),
    }
}
