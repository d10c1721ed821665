//! What a receiver at a known place and time expects to receive.

use nalgebra::Vector3;

use crate::constants::{CA_CODE_RATE_HZ, L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use crate::geodesy::Look;
use crate::line_of_sight::LineOfSight;
use crate::measurement::MeasurementModel;
use crate::{Ephemeris, GpsTime, NavError, SatelliteState};

/// Period of the C/A code, s.
const CA_PERIOD_S: f64 = 1e-3;
/// C/A code periods in a data bit.
const PERIODS_PER_BIT: i64 = 20;

/// Time a signal takes from most satellites, s.
const TYPICAL_TRAVEL_S: f64 = 0.075;

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

    /// Code periods of L1 C/A that are over in the data bit that arrives, below 20.
    #[must_use]
    pub fn periods_into_bit(&self) -> u8 {
        let fraction_s = self.transmit_time.fraction_s();
        // From where the code period began, so that both change together.
        let began_s = fraction_s - fraction_s % CA_PERIOD_S;
        ((began_s / CA_PERIOD_S).round() as i64).rem_euclid(PERIODS_PER_BIT) as u8
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
/// delay is left out (0.1 mm for 30 m), and so is the rate of the ionosphere's, millimetres a second.
///
/// # Errors
/// As [`predict`].
pub fn predict_through(
    ephemeris: &Ephemeris,
    receiver: &ReceiverState,
    model: &MeasurementModel,
) -> Result<Expected, NavError> {
    let (state, _) = received_state(ephemeris, &receiver.position_ecef_m, receiver.time)?;
    Ok(predict_from(&state, receiver, model))
}

/// The same of a satellite whose state at transmission is known, as from a prediction for nearly the same
/// receiver: a travel time wrong by 10 m moves a satellite by 0.1 mm.
#[must_use]
pub fn predict_from(
    state: &SatelliteState,
    receiver: &ReceiverState,
    model: &MeasurementModel,
) -> Expected {
    let predicted = model.predict(state, &receiver.position_ecef_m, receiver.time);
    let line_of_sight = predicted.line_of_sight;
    let range_rate_mps = line_of_sight.range_rate_mps(&receiver.velocity_ecef_mps)
        + predicted.delay_rate.mps(&receiver.velocity_ecef_mps)
        + receiver.clock_drift_mps
        - SPEED_OF_LIGHT_MPS * state.clock_drift;
    let travel_m = line_of_sight.range_m + predicted.delay_m;
    Expected {
        range_m: line_of_sight.range_m,
        range_rate_mps,
        doppler_hz: -range_rate_mps / L1_WAVELENGTH_M,
        delay_m: predicted.delay_m,
        transmit_time: receiver.time - travel_m / SPEED_OF_LIGHT_MPS + state.clock_bias_s,
        look: predicted.look,
        state: *state,
    }
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
    // A typical travel time, 10 ms off at most, in which an orbit bends by 30 um; each pass shrinks
    // the error of the time by 1e-5, the satellite's speed over c.
    let typical = ephemeris.state_at(time - TYPICAL_TRAVEL_S)?;
    let mut travel_s = TYPICAL_TRAVEL_S;
    for _ in 0..2 {
        let mut nearly = typical;
        nearly.position_ecef_m += typical.velocity_ecef_mps * (TYPICAL_TRAVEL_S - travel_s);
        travel_s = LineOfSight::new(&nearly, receiver_ecef_m).range_m / SPEED_OF_LIGHT_MPS;
    }
    let state = ephemeris.state_at(time - travel_s)?;
    Ok((state, LineOfSight::new(&state, receiver_ecef_m)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Klobuchar;
    use crate::made_up_sky::{constellation, receiver};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn through_air() -> MeasurementModel {
        MeasurementModel {
            ionosphere: Some(Klobuchar {
                alpha: [1.77e-8, -7.451e-9, -5.96e-8, 1.192e-7],
                beta: [131_100.0, -131_100.0, 65_540.0, -262_100.0],
            }),
            troposphere: true,
            ..MeasurementModel::default()
        }
    }

    /// What is expected of every satellite above 10 degrees when the receiver's clock has gone on
    /// by `later_s`.
    fn expected(later_s: f64, model: &MeasurementModel) -> Vec<Expected> {
        let state = receiver();
        let clock = state.receiver_clock() + later_s;
        constellation(&mut ChaCha8Rng::seed_from_u64(1))
            .iter()
            .map(|ephemeris| state.expect(ephemeris, clock, model).unwrap())
            .filter(|e| e.look.elevation_rad > 10f64.to_radians())
            .collect()
    }

    #[test]
    fn code_and_carrier_run_at_the_predicted_rates() {
        let model = MeasurementModel::geometry_only();
        let (before, now, after) = (
            expected(-0.5, &model),
            expected(0.0, &model),
            expected(0.5, &model),
        );
        assert!(now.len() >= 6);
        for ((b, n), a) in before.iter().zip(&now).zip(&after) {
            // Transmit time that passes in a second of the receiver's clock, 1 - range rate / c.
            let per_second = a.transmit_time - b.transmit_time;
            let code_hz = CA_CODE_RATE_HZ * per_second;
            // The product of range rate and drift, 0.2 mm/s here, and 1e-16 s of a time.
            let allowed_mps = 1e-3;
            let allowed_hz = CA_CODE_RATE_HZ * allowed_mps / SPEED_OF_LIGHT_MPS;
            assert!((code_hz - n.code_rate_hz()).abs() < allowed_hz);
            let doppler_hz = (per_second - 1.0) * crate::constants::L1_HZ;
            assert!((doppler_hz - n.doppler_hz).abs() < allowed_mps / L1_WAVELENGTH_M);
        }
    }

    #[test]
    fn a_satellite_known_from_nearby_is_as_good() {
        let model = through_air();
        let state = receiver();
        for ephemeris in constellation(&mut ChaCha8Rng::seed_from_u64(1)).iter() {
            let clock = state.receiver_clock();
            let Ok(there) = state.expect(ephemeris, clock, &model) else {
                continue;
            };
            let mut moved = state;
            moved.position_ecef_m += Vector3::new(6.0, -6.0, 5.0);
            let exact = moved.expect(ephemeris, clock, &model).unwrap();
            let near = predict_from(&there.state, &ReceiverState::from(&moved), &model);
            let apart_m = (near.transmit_time - exact.transmit_time) * SPEED_OF_LIGHT_MPS;
            // 10 m over c times 4 km/s.
            assert!(apart_m.abs() < 1.4e-4, "{apart_m} m");
            assert!((near.range_rate_mps - exact.range_rate_mps).abs() < 1e-6);
        }
    }

    #[test]
    fn the_code_phase_is_that_of_the_transmit_time() {
        for one in expected(0.0, &through_air()) {
            let chips = one.code_phase_chips();
            assert!((0.0..1023.0).contains(&chips));
            let periods = one.transmit_time.fraction_s() * 1e3 - chips / 1023.0;
            // 1e3 periods of a second round to 1e-13.
            assert!((periods - periods.round()).abs() < 1e-9, "{periods}");
            let into_bit = f64::from(one.periods_into_bit());
            assert_eq!(periods.round().rem_euclid(20.0), into_bit);
        }
    }

    #[test]
    fn the_air_holds_back_the_code() {
        let empty = expected(0.0, &MeasurementModel::geometry_only());
        for (air, none) in expected(0.0, &through_air()).iter().zip(&empty) {
            assert!((2.0..60.0).contains(&air.delay_m), "{}", air.delay_m);
            assert_eq!(none.delay_m, 0.0);
            let later_s = none.transmit_time - air.transmit_time;
            // A time of the fraction of a second rounds to 1e-16 s.
            assert!((later_s * SPEED_OF_LIGHT_MPS - air.delay_m).abs() < 1e-6);
        }
        let ionosphere = MeasurementModel {
            troposphere: false,
            ..through_air()
        };
        for (air, none) in expected(0.0, &ionosphere).iter().zip(&empty) {
            assert_eq!(air.doppler_hz, none.doppler_hz);
        }
    }

    #[test]
    fn range_rates_hold_how_the_delay_of_the_troposphere_changes() {
        let model = MeasurementModel {
            troposphere: true,
            ..MeasurementModel::default()
        };
        // Across and up, faster than a ground station ever sees a satellite set.
        let mut here = receiver();
        here.velocity_ecef_mps += Vector3::new(300.0, -500.0, 400.0);
        let mut fastest_mps = 0.0_f64;
        for ephemeris in constellation(&mut ChaCha8Rng::seed_from_u64(1)).iter() {
            let delayed = |later_s: f64, model: &MeasurementModel| {
                let mut then = here;
                then.time = here.time + later_s;
                then.position_ecef_m += here.velocity_ecef_mps * later_s;
                then.expect(ephemeris, then.receiver_clock(), model)
                    .unwrap()
            };
            let (now, empty) = (
                delayed(0.0, &model),
                delayed(0.0, &MeasurementModel::geometry_only()),
            );
            if now.look.elevation_rad < 5f64.to_radians() {
                continue;
            }
            let found_mps = now.range_rate_mps - empty.range_rate_mps;
            let true_mps = delayed(0.5, &model).delay_m - delayed(-0.5, &model).delay_m;
            // The height over which the air thins changes with height.
            let allowed_mps = 1e-3 + 0.05 * true_mps.abs();
            assert!(
                (found_mps - true_mps).abs() < allowed_mps,
                "{found_mps} {true_mps}"
            );
            fastest_mps = fastest_mps.max(true_mps.abs());
        }
        assert!(fastest_mps > 0.02, "{fastest_mps}");
    }
}
