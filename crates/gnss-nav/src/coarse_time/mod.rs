//! Position and time from a snapshot too short for a time mark: code phases modulo 1 ms, Doppler.
//!
//! Five unknowns: position, common bias and the error of the coarse time, which moves the
//! satellites by up to 800 m/s along the line of sight (van Diggelen, A-GPS, 2009, chapter 4).
//! The whole milliseconds are those under which the pseudoranges agree: they are tried from a
//! grid of positions and times over the prior, so that the prior may be off by more than the
//! 150 km of half a millisecond.

mod anchor;
mod fit;
mod hypothesis;
mod screen;

use nalgebra::{Matrix4, Vector3, Vector4};

use crate::chi_square::chi_square_threshold;
use crate::constants::{CA_PERIOD_M, L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use crate::ephemeris::EphemerisStore;
use crate::least_squares::{
    Consistency, Dops, RateEquation, Solution, UsedSatellite, solve_velocity,
};
use crate::measurement::MeasurementModel;
use crate::{Ephemeris, GpsTime, NavError, SatelliteId};
use fit::{Fit, UNKNOWNS};

/// What a channel measured at the tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SnapshotMeasurement {
    /// Of which satellite.
    pub satellite: SatelliteId,
    /// Reading of the satellite's clock in what arrives at the tick, modulo 1 ms, s: the code
    /// phase in chips over 1.023 MHz.
    pub transmit_fraction_s: f64,
    /// Doppler of L1, Hz; positive when approaching.
    pub doppler_hz: f64,
    /// Variance of the code phase, m^2.
    pub code_variance_m2: f64,
    /// Variance of the Doppler, Hz^2; infinite where none was measured.
    pub doppler_variance_hz2: f64,
}

/// What is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// GPS time of the tick, about.
    pub time: GpsTime,
    /// By how much it may be wrong, s.
    pub time_uncertainty_s: f64,
    /// Receiver, about; `None`: found from the Dopplers.
    pub position_ecef_m: Option<Vector3<f64>>,
    /// By how much it may be wrong, m.
    pub position_uncertainty_m: f64,
    /// How fast the receiver may move, m/s: limits what Dopplers say about position.
    pub speed_uncertainty_mps: f64,
}

impl Prior {
    /// Time within 60 s, position (if known) within 100 km, speed within 100 m/s.
    #[must_use]
    pub const fn new(time: GpsTime, position_ecef_m: Option<Vector3<f64>>) -> Self {
        Self {
            time,
            time_uncertainty_s: 60.0,
            position_ecef_m,
            position_uncertainty_m: 100e3,
            speed_uncertainty_mps: 100.0,
        }
    }
}

/// Position, velocity and time of a snapshot.
#[derive(Debug, Clone, PartialEq)]
pub struct SnapshotSolution {
    /// The solution; its `receive_time` is the corrected GPS time of the tick and its clock bias
    /// is zero. Modulo 1 ms that time agrees with the code phases; its whole milliseconds are as
    /// good as `time_sigma_s`.
    pub solution: Solution,
    /// Standard deviation of the coarse time, s.
    pub time_sigma_s: f64,
    /// By how much position (ECEF) and clock bias are off where the coarse time is off by that, m: the
    /// solution's covariance holds it.
    pub time_shift_m: Vector4<f64>,
    /// Corrected minus prior time, s.
    pub time_correction_s: f64,
    /// Satellites measured that have no valid ephemeris or whose values are not finite.
    pub rejected: Vec<SatelliteId>,
}

/// A usable measurement with its ephemeris.
#[derive(Debug, Clone, Copy)]
struct Channel<'a> {
    satellite: SatelliteId,
    ephemeris: &'a Ephemeris,
    fraction_m: f64,
    code_variance_m2: f64,
    range_rate_mps: f64,
    range_rate_variance_m2_s2: f64,
}

/// The position and time the fit is tied to, and how loosely.
#[derive(Debug, Clone, Copy)]
struct Anchor {
    position_ecef_m: Vector3<f64>,
    position_sigma_m: f64,
    time: GpsTime,
    time_sigma_s: f64,
}

/// Solves a snapshot for position, velocity and time.
///
/// Up to two satellites are taken out where the chi-square test of the code residuals at
/// `false_alarm_probability` demands it and at least two redundant ones are left. With five
/// satellites nothing is redundant and the prior has to be within 150 km in all.
///
/// # Errors
/// [`NavError::TooFew`] with fewer than five usable satellites, or above the elevation mask;
/// [`NavError::NoFit`] when nothing near the prior agrees; [`NavError::Value`] for a prior or probability out of range;
/// [`NavError::Singular`].
pub fn solve(
    measurements: &[SnapshotMeasurement],
    store: &EphemerisStore,
    prior: &Prior,
    model: &MeasurementModel,
    false_alarm_probability: f64,
) -> Result<SnapshotSolution, NavError> {
    chi_square_threshold(1, false_alarm_probability)?;
    let (channels, rejected) = usable(measurements, store, prior);
    if channels.len() < UNKNOWNS {
        return Err(NavError::TooFew {
            found: channels.len(),
            needed: UNKNOWNS,
        });
    }
    let anchor = anchor::from_prior(prior, &channels)?;
    let best = hypothesis::search(&channels, &anchor, model, false_alarm_probability)?;
    let best = fit::without_masked(best, &anchor, model)?;
    finish(&best, &channels, prior, rejected)
}

fn usable<'a>(
    measurements: &[SnapshotMeasurement],
    store: &'a EphemerisStore,
    prior: &Prior,
) -> (Vec<Channel<'a>>, Vec<SatelliteId>) {
    let mut rejected = Vec::new();
    let mut channels = Vec::new();
    for m in measurements {
        let ephemeris = store.select(m.satellite, prior.time);
        match ephemeris.and_then(|ephemeris| Channel::new(m, ephemeris)) {
            Some(channel) => channels.push(channel),
            None => rejected.push(m.satellite),
        }
    }
    (channels, rejected)
}

impl<'a> Channel<'a> {
    fn new(m: &SnapshotMeasurement, ephemeris: &'a Ephemeris) -> Option<Self> {
        let valid = (0.0..1e-3).contains(&m.transmit_fraction_s)
            && m.code_variance_m2.is_finite()
            && m.code_variance_m2 > 0.0;
        valid.then(|| Self {
            satellite: m.satellite,
            ephemeris,
            fraction_m: SPEED_OF_LIGHT_MPS * m.transmit_fraction_s,
            code_variance_m2: m.code_variance_m2,
            range_rate_mps: -L1_WAVELENGTH_M * m.doppler_hz,
            range_rate_variance_m2_s2: L1_WAVELENGTH_M.powi(2) * m.doppler_variance_hz2,
        })
    }
}

fn finish(
    best: &Fit,
    channels: &[Channel],
    prior: &Prior,
    rejected: Vec<SatelliteId>,
) -> Result<SnapshotSolution, NavError> {
    let rates: Vec<RateEquation> = best.seen.iter().map(fit::Seen::rate_equation).collect();
    let velocity = solve_velocity(&rates).ok();
    let predicted: Vec<_> = best.seen.iter().map(|s| s.predicted).collect();
    let satellites = best.seen.iter().zip(&rates).map(|(s, rate)| UsedSatellite {
        satellite: s.channel.satellite,
        azimuth_rad: s.predicted.look.azimuth_rad,
        elevation_rad: s.predicted.look.elevation_rad,
        pseudorange_residual_m: s.residual_m,
        pseudorange_sigma_m: s.sigma_m,
        range_rate_residual_mps: velocity.and_then(|v| rate.residual_mps(&v)),
    });
    let tick = tick_time(best);
    let excluded = channels
        .iter()
        .map(|c| c.satellite)
        .filter(|id| !best.contains(*id) && !best.masked.contains(id));
    let solution = Solution {
        receive_time: tick,
        position_ecef_m: best.position_ecef_m,
        clock_bias_m: 0.0,
        covariance_m2: Matrix4::from_fn(|i, j| best.covariance[(i, j)]),
        velocity,
        dops: Dops::new(&best.position_ecef_m, &predicted)?,
        satellites: satellites.collect(),
        masked: best.masked.clone(),
        excluded: excluded.collect(),
        chi_square: best.chi_square,
        consistency: if best.seen.len() > UNKNOWNS {
            Consistency::Passed
        } else {
            Consistency::Untested
        },
    };
    let time_sigma_s = best.covariance[(4, 4)].max(0.0).sqrt();
    let with_time = Vector4::from_fn(|k, _| best.covariance[(k, 4)]);
    Ok(SnapshotSolution {
        solution,
        time_sigma_s,
        time_shift_m: with_time / time_sigma_s.max(f64::MIN_POSITIVE),
        time_correction_s: tick - prior.time,
        rejected,
    })
}

/// The time nearest the fitted one that agrees with the code phases modulo 1 ms.
fn tick_time(best: &Fit) -> GpsTime {
    // GPS time of the tick is minus the bias over c, modulo 1 ms.
    let wanted_s = -(best.bias_m / CA_PERIOD_M).fract() * 1e-3;
    let have_s = best.time.fraction_s() % 1e-3;
    let miss_s = wanted_s - have_s;
    best.time + (miss_s - (miss_s / 1e-3).round() * 1e-3)
}

#[cfg(test)]
mod tests;
