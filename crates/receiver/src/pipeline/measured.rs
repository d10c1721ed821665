//! What channels measure, and what is to be done with it by the shapes of their correlations.

use gnss_nav::constants::{L1_HZ, L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use gnss_nav::filter::Disposition;
use gnss_nav::measurement::RawMeasurement;
use gnss_nav::{GpsTime, SatelliteId};
use gnss_signal::tracking::ChannelEpoch;

use super::navigator::Tracked;

/// Fewer satellites make no solution.
pub(super) const NEEDED: usize = 4;

/// Variance of a channel's code phase, m^2.
pub(super) fn code_variance_m2(epoch: &ChannelEpoch) -> f64 {
    let chip_m = SPEED_OF_LIGHT_MPS / epoch.signal.spec().code_rate_hz;
    epoch.code_variance_chips2 * chip_m * chip_m
}

/// Pseudorange and range rate of a channel, received and transmitted at these times.
pub(super) fn raw_measurement(
    epoch: &ChannelEpoch,
    satellite: SatelliteId,
    receive_time: GpsTime,
    transmit_time: GpsTime,
) -> RawMeasurement {
    let wavelength_m = L1_WAVELENGTH_M;
    debug_assert!((L1_HZ - epoch.signal.spec().carrier_hz).abs() < 1.0);
    RawMeasurement {
        satellite,
        transmit_time,
        pseudorange_m: RawMeasurement::pseudorange_m(receive_time, transmit_time),
        range_rate_mps: -wavelength_m * epoch.doppler_hz,
        pseudorange_variance_m2: code_variance_m2(epoch),
        range_rate_variance_m2_s2: wavelength_m * wavelength_m * epoch.doppler_variance_hz2,
        cn0_dbhz: epoch.cn0_dbhz,
    }
}

/// Measurements and what is to be done with them by the shapes of their satellites' correlations: weighted,
/// not left out, where too few would be left.
pub(super) fn shape_dispositions(raw: &[RawMeasurement], tracked: &[Tracked]) -> Vec<Disposition> {
    let shape = |r: &RawMeasurement| {
        let mut of = tracked.iter().filter(|t| t.slot.satellite == r.satellite);
        of.find_map(|t| t.slot.shape.as_ref())
    };
    let told = |r: &RawMeasurement| shape(r).map_or(Disposition::Use, |s| s.disposition(r));
    let all: Vec<_> = raw.iter().map(told).collect();
    let left = all.iter().filter(|d| **d != Disposition::Exclude).count();
    if left == all.len() || left >= NEEDED {
        return all;
    }
    let weighted = |r: &RawMeasurement| shape(r).map_or(Disposition::Use, |s| s.weighted(r));
    raw.iter().map(weighted).collect()
}

/// A measurement with its weight, unless it is left out.
pub(super) fn weighted(raw: &RawMeasurement, disposition: Disposition) -> Option<RawMeasurement> {
    match disposition {
        Disposition::Use => Some(*raw),
        Disposition::Deweight { variance_factor } => Some(RawMeasurement {
            pseudorange_variance_m2: raw.pseudorange_variance_m2 * variance_factor,
            ..*raw
        }),
        Disposition::Exclude => None,
    }
}
