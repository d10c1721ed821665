//! Records of a navigation epoch.

use gnss_nav::constants::L1_WAVELENGTH_M;
use gnss_nav::filter::{Covariance, Disposition as Told, Innovation};
use gnss_nav::geodesy::Geodetic;
use gnss_nav::least_squares::Solution;
use gnss_nav::{NavState, RawMeasurement, SatelliteId};
use gnss_signal::tracking::{ChannelEpoch, Lock};
use nalgebra::Matrix3;

use super::belief::Said;
use super::navigated::{Navigated, is_contradictory};
use super::navigator::Tracked;
use super::shape::{self, ShapeWatch};
use super::slot::Slot;
use crate::record::{
    CarrierPhase, ChannelRecord, Disposition, InnovationRecord, LoopMembership, Observation,
    ObservationEpoch, PvtRecord, ScoreRecord, Source, Status, TrackingRecord, VelocityRecord,
};

/// The solution as a record.
pub(crate) fn pvt(time_s: f64, solution: &Solution, source: Source) -> PvtRecord {
    let geodetic = Geodetic::from_ecef(&solution.position_ecef_m);
    let to_enu = geodetic.enu_from_ecef();
    let position_covariance: Matrix3<f64> = solution.covariance_m2.fixed_view::<3, 3>(0, 0).into();
    let enu = to_enu * position_covariance * to_enu.transpose();
    let velocity = solution.velocity.map(|v| {
        let variance = v.covariance_m2_s2.fixed_view::<3, 3>(0, 0).trace();
        VelocityRecord {
            ecef_mps: v.velocity_ecef_mps,
            clock_drift_mps: v.clock_drift_mps,
            sigma_mps: variance.sqrt(),
        }
    });
    PvtRecord {
        time_s,
        time: solution.gps_time(),
        position_ecef_m: solution.position_ecef_m,
        velocity,
        clock_bias_m: solution.clock_bias_m,
        satellites_used: solution.satellites.len(),
        pdop: solution.dops.pdop,
        source,
        sigma_enu_m: [enu[(0, 0)].sqrt(), enu[(1, 1)].sqrt(), enu[(2, 2)].sqrt()],
        position_covariance_ecef_m2: position_covariance,
        horizontal_protection_m: None,
        vertical_protection_m: None,
        filter: None,
        status: if is_contradictory(solution) {
            Status::Unreliable
        } else {
            Status::Fix
        },
    }
}

/// A filter's estimate as a record; how many satellites made it, and their dilution, is for the caller
/// to say.
pub(crate) fn filtered(
    time_s: f64,
    state: &NavState,
    covariance: &Covariance,
    status: Status,
) -> PvtRecord {
    let to_enu = Geodetic::from_ecef(&state.position_ecef_m).enu_from_ecef();
    let position_covariance = block(covariance, 0);
    let enu = to_enu * position_covariance * to_enu.transpose();
    PvtRecord {
        time_s,
        time: state.time,
        position_ecef_m: state.position_ecef_m,
        velocity: Some(VelocityRecord {
            ecef_mps: state.velocity_ecef_mps,
            clock_drift_mps: state.clock_drift_mps,
            sigma_mps: block(covariance, 1).trace().sqrt(),
        }),
        clock_bias_m: state.clock_bias_m,
        satellites_used: 0,
        pdop: f64::INFINITY,
        source: Source::Filter,
        sigma_enu_m: [enu[(0, 0)].sqrt(), enu[(1, 1)].sqrt(), enu[(2, 2)].sqrt()],
        position_covariance_ecef_m2: position_covariance,
        horizontal_protection_m: None,
        vertical_protection_m: None,
        status,
        filter: None,
    }
}

/// The position block (`offset` 0) or the velocity block (1) of a covariance.
fn block(covariance: &Covariance, offset: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| covariance[(2 * row + offset, 2 * column + offset)])
}

/// An innovation of a filter as a record.
pub(crate) fn innovation(innovation: &Innovation) -> InnovationRecord {
    InnovationRecord {
        value: innovation.value(),
        sigma: innovation.variance().sqrt(),
    }
}

/// All observations of an epoch.
pub(super) fn observations(
    time_s: f64,
    tracked: &mut [Tracked],
    navigated: &Navigated,
) -> Option<ObservationEpoch> {
    let time = navigated.receive_time?;
    let observations = tracked
        .iter_mut()
        .filter_map(|t| observation_of(t, navigated))
        .collect();
    Some(ObservationEpoch {
        time_s,
        time,
        observations,
    })
}

fn observation_of(tracked: &mut Tracked, navigated: &Navigated) -> Option<Observation> {
    let satellite = tracked.slot.satellite;
    let raw = navigated.raw.iter().find(|r| r.satellite == satellite)?;
    let solution = navigated.fix.as_ref().map(|(solution, _)| solution);
    let sight = solution.and_then(|s| {
        let look = s.satellites.iter().find(|s| s.satellite == satellite)?;
        Some((look.azimuth_rad, look.elevation_rad))
    });
    Some(observation(tracked.slot, &tracked.epoch, raw, sight))
}

/// An observation; `sight` is azimuth and elevation, rad.
pub(super) fn observation(
    slot: &mut Slot,
    epoch: &ChannelEpoch,
    raw: &RawMeasurement,
    sight: Option<(f64, f64)>,
) -> Observation {
    let cycles = raw.pseudorange_m / L1_WAVELENGTH_M;
    let (phase, half_cycle) = slot.carrier_phase(epoch, cycles);
    Observation {
        satellite: slot.satellite,
        pseudorange_m: raw.pseudorange_m,
        doppler_hz: Some(epoch.doppler_hz),
        cn0_dbhz: Some(epoch.cn0_dbhz),
        carrier_phase: (epoch.lock == Lock::Carrier).then_some(CarrierPhase {
            cycles: phase,
            loss_of_lock: epoch.phase_slipped,
            half_cycle,
        }),
        azimuth_rad: sight.map(|s| s.0),
        elevation_rad: sight.map(|s| s.1),
    }
}

/// How a channel tracks.
pub(super) const fn tracking(epoch: &ChannelEpoch, membership: LoopMembership) -> TrackingRecord {
    TrackingRecord {
        lock: epoch.lock,
        membership,
        prompt: epoch.prompt,
        code_error_chips: epoch.code_error_chips,
        frequency_error_hz: epoch.frequency_error_hz,
    }
}

/// A channel as a record.
pub(super) fn channel(time_s: f64, tracked: &Tracked, navigated: &Navigated) -> ChannelRecord {
    let satellite = tracked.slot.satellite;
    let epoch: &ChannelEpoch = &tracked.epoch;
    let raw = navigated.raw.iter().find(|r| r.satellite == satellite);
    let (innovation_code_m, innovation_rate_mps) = residuals(satellite, navigated);
    let shape = tracked.slot.shape.as_ref().and_then(ShapeWatch::said);
    ChannelRecord {
        time_s,
        satellite,
        cn0_dbhz: Some(epoch.cn0_dbhz),
        tracking: Some(tracking(epoch, LoopMembership::Scalar)),
        pseudorange_m: raw.map(|r| r.pseudorange_m),
        range_rate_mps: raw.map(|r| r.range_rate_mps),
        innovation_code_m,
        innovation_rate_mps,
        shown: None,
        disposition: disposition(satellite, navigated),
        scores: shape
            .into_iter()
            .map(|s| score(&(shape::NAME, s.judgement)))
            .collect(),
    }
}

/// What a monitor said, as a record.
pub(super) fn score((monitor, judgement): &Said) -> ScoreRecord {
    ScoreRecord {
        monitor: (*monitor).to_owned(),
        score: judgement.score(),
        threshold: judgement.threshold(),
    }
}

fn disposition(satellite: SatelliteId, navigated: &Navigated) -> Disposition {
    let Some((solution, _)) = &navigated.fix else {
        return Disposition::Unavailable;
    };
    let mut both = navigated.raw.iter().zip(&navigated.dispositions);
    let told = both
        .find(|(r, _)| r.satellite == satellite)
        .map(|(_, told)| *told);
    if solution.excluded.contains(&satellite) || told == Some(Told::Exclude) {
        Disposition::Exclude
    } else if solution.satellites.iter().any(|s| s.satellite == satellite) {
        match told {
            Some(Told::Deweight { variance_factor }) => Disposition::Deweight { variance_factor },
            _ => Disposition::Use,
        }
    } else {
        Disposition::Unavailable
    }
}

type Residuals = (Option<InnovationRecord>, Option<InnovationRecord>);

/// What is left of the measurements after the solution.
fn residuals(satellite: SatelliteId, navigated: &Navigated) -> Residuals {
    let used = navigated.fix.as_ref().and_then(|(solution, _)| {
        solution
            .satellites
            .iter()
            .find(|s| s.satellite == satellite)
    });
    let code = used.map(|u| InnovationRecord {
        value: u.pseudorange_residual_m,
        sigma: u.pseudorange_sigma_m,
    });
    let raw = navigated.raw.iter().find(|r| r.satellite == satellite);
    let rate = used.and_then(|u| {
        Some(InnovationRecord {
            value: u.range_rate_residual_mps?,
            sigma: raw?.range_rate_variance_m2_s2.sqrt(),
        })
    });
    (code, rate)
}
