//! What a receiver at a known place and time expects to receive.

use nalgebra::Vector3;

use crate::constants::{CA_CODE_RATE_HZ, L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use crate::geodesy::Look;
use crate::line_of_sight::LineOfSight;
use crate::measurement::MeasurementModel;
use crate::{Ephemeris, GpsTime, NavError, SatelliteState};

/// Period of the C/A code, s.
const CA_PERIOD_S: f64 = 1e-3;

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
    /// Delay of the code by ionosphere and troposphere, m; zero from [`predict`].
    pub delay_m: f64,
    /// Reading of the satellite's clock in what arrives, `delay_m` included: its whole
    /// milliseconds, bits and seconds are the boundaries of codes, bits and subframes.
    pub transmit_time: GpsTime,
    /// Where the satellite stands in the sky.
    pub look: Look,
    /// The satellite at transmission.
    pub state: SatelliteState,
}

impl Expected {
    /// Code phase of L1 C/A in what arrives, chips, in [0, 1023) (equation (4) of Jiang2017).
    #[must_use]
    pub fn code_phase_chips(&self) -> f64 {
        let chips = self.transmit_time.fraction_s() % CA_PERIOD_S * CA_CODE_RATE_HZ;
        // The remainder is below one period; times the rate it may round up to all of it.
        chips.min((CA_PERIOD_S * CA_CODE_RATE_HZ).next_down())
    }

    /// Rate at which the code phase grows, chips/s: 1.023e6 (1 - range rate / c), equation (4) of
    /// Jiang2017 with its signs put right.
    #[must_use]
    pub fn code_rate_hz(&self) -> f64 {
        CA_CODE_RATE_HZ * (1.0 - self.range_rate_mps / SPEED_OF_LIGHT_MPS)
    }
}

/// What a receiver expects of the satellite of `ephemeris` through empty space.
///
/// # Errors
/// As [`Ephemeris::state_at`], and for a receiver whose position is not finite.
pub fn predict(ephemeris: &Ephemeris, receiver: &ReceiverState) -> Result<Expected, NavError> {
    predict_through(ephemeris, receiver, &MeasurementModel::geometry_only())
}

/// What a receiver expects of the satellite of `ephemeris` through the delays of `model`.
///
/// The delays hold back the code; that the satellite stands elsewhere by its range rate times the
/// delay is left out (0.1 mm for 30 m). Their own rates are left out: millimetres a second, except the
/// troposphere of low satellites, 8 mm/s at 10 degrees and 3 cm/s at 5 as they rise or set.
///
/// # Errors
/// As [`predict`].
pub fn predict_through(
    ephemeris: &Ephemeris,
    receiver: &ReceiverState,
    model: &MeasurementModel,
) -> Result<Expected, NavError> {
    let (state, line_of_sight) =
        received_state(ephemeris, &receiver.position_ecef_m, receiver.time)?;
    let predicted = model.predict(&state, &receiver.position_ecef_m, receiver.time);
    let range_rate_mps = line_of_sight.range_rate_mps(&receiver.velocity_ecef_mps)
        + receiver.clock_drift_mps
        - SPEED_OF_LIGHT_MPS * state.clock_drift;
    let travel_m = line_of_sight.range_m + predicted.delay_m;
    Ok(Expected {
        range_m: line_of_sight.range_m,
        range_rate_mps,
        doppler_hz: -range_rate_mps / L1_WAVELENGTH_M,
        delay_m: predicted.delay_m,
        transmit_time: receiver.time - travel_m / SPEED_OF_LIGHT_MPS + state.clock_bias_s,
        look: predicted.look,
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
