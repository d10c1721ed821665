//! What a receiver at a known place and time expects to receive.

use nalgebra::Vector3;

use crate::constants::{L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use crate::geodesy::{Geodetic, Look};
use crate::line_of_sight::LineOfSight;
use crate::{Ephemeris, GpsTime, NavError, SatelliteState};

/// Where a receiver is, how it moves, and what its oscillator does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReceiverState {
    /// GPS time.
    pub time: GpsTime,
    /// ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
    /// Drift of the receiver's clock, m/s.
    pub clock_drift_mps: f64,
}

/// A satellite's signal as it should arrive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Geometric range, m.
    pub range_m: f64,
    /// Rate of the pseudorange (both clocks included), m/s.
    pub range_rate_mps: f64,
    /// Doppler of L1, Hz.
    pub doppler_hz: f64,
    /// Reading of the satellite's clock in what arrives (atmosphere neglected): its whole
    /// milliseconds, bits and seconds are the boundaries of codes, bits and subframes.
    pub transmit_time: GpsTime,
    /// Where the satellite stands in the sky.
    pub look: Look,
    /// The satellite at transmission.
    pub state: SatelliteState,
}

/// What a receiver expects of the satellite of `ephemeris`.
///
/// # Errors
/// As [`Ephemeris::state_at`], and for a receiver whose position is not finite.
pub fn predict(ephemeris: &Ephemeris, receiver: &ReceiverState) -> Result<Expected, NavError> {
    let (state, line_of_sight) =
        received_state(ephemeris, &receiver.position_ecef_m, receiver.time)?;
    let range_rate_mps = line_of_sight.range_rate_mps(&receiver.velocity_ecef_mps)
        + receiver.clock_drift_mps
        - SPEED_OF_LIGHT_MPS * state.clock_drift;
    let sent = receiver.time - line_of_sight.range_m / SPEED_OF_LIGHT_MPS;
    Ok(Expected {
        range_m: line_of_sight.range_m,
        range_rate_mps,
        doppler_hz: -range_rate_mps / L1_WAVELENGTH_M,
        transmit_time: sent + state.clock_bias_s,
        look: Geodetic::from_ecef(&receiver.position_ecef_m).look(&line_of_sight.unit_ecef),
        state,
    })
}

/// State at transmission of what `receiver_ecef_m` receives at GPS time `time`.
pub(crate) fn received_state(
    ephemeris: &Ephemeris,
    receiver_ecef_m: &Vector3<f64>,
    time: GpsTime,
) -> Result<(SatelliteState, LineOfSight), NavError> {
    if !receiver_ecef_m.iter().all(|x| x.is_finite()) {
        return Err(NavError::Value {
            name: "receiver position",
            value: format!("{receiver_ecef_m:?}"),
            expected: "finite coordinates",
        });
    }
    // A typical travel time, 10 ms off at most; each pass shrinks its error by 1e-5, the
    // satellite's speed over c: two leave less than a nanometre.
    let mut state = ephemeris.state_at(time - 0.075)?;
    let mut path = LineOfSight::new(&state, receiver_ecef_m);
    for _ in 0..2 {
        state = ephemeris.state_at(time - path.range_m / SPEED_OF_LIGHT_MPS)?;
        path = LineOfSight::new(&state, receiver_ecef_m);
    }
    Ok((state, path))
}
