//! Where a receiver is, how it moves and what its clock does, at one instant.

use nalgebra::Vector3;

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::prediction::{Expected, ReceiverState, predict_from, predict_through};
use crate::{Ephemeris, GpsTime, MeasurementModel, NavError, SatelliteState, Solution};

/// Position, velocity, clock bias and clock drift of a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavState {
    /// GPS time at which all of it holds.
    pub time: GpsTime,
    /// ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
    /// Receiver's clock minus GPS time, m.
    pub clock_bias_m: f64,
    /// Drift of the receiver's clock, m/s.
    pub clock_drift_mps: f64,
}

impl NavState {
    /// What the receiver's clock reads at `time`.
    #[must_use]
    pub fn receiver_clock(&self) -> GpsTime {
        self.time + self.clock_bias_m / SPEED_OF_LIGHT_MPS
    }

    /// GPS time at which the receiver's clock reads `receiver_clock`, by this bias and drift.
    #[must_use]
    pub fn gps_time(&self, receiver_clock: GpsTime) -> GpsTime {
        let rate = 1.0 + self.clock_drift_mps / SPEED_OF_LIGHT_MPS;
        self.time + (receiver_clock - self.receiver_clock()) / rate
    }

    /// This state carried to `time` (earlier or later) at constant velocity and drift: equations
    /// (1) and (2) of Jiang2017.
    #[must_use]
    pub fn at(&self, time: GpsTime) -> Self {
        let interval_s = time - self.time;
        Self {
            time,
            position_ecef_m: self.position_ecef_m + self.velocity_ecef_mps * interval_s,
            clock_bias_m: self.clock_bias_m + self.clock_drift_mps * interval_s,
            ..*self
        }
    }

    /// What this receiver expects of the satellite of `ephemeris` when its clock reads
    /// `receiver_clock`: transmit time and code phase, code rate and Doppler to steer a channel by
    /// (equations (1) to (4) of Jiang2017), through the delays of `model`.
    ///
    /// # Errors
    /// As [`predict_through`].
    pub fn expect(
        &self,
        ephemeris: &Ephemeris,
        receiver_clock: GpsTime,
        model: &MeasurementModel,
    ) -> Result<Expected, NavError> {
        let there = self.at(self.gps_time(receiver_clock));
        predict_through(ephemeris, &ReceiverState::from(&there), model)
    }

    /// The same of a satellite whose state at transmission is known; see [`predict_from`].
    #[must_use]
    pub fn expect_from(
        &self,
        satellite: &SatelliteState,
        receiver_clock: GpsTime,
        model: &MeasurementModel,
    ) -> Expected {
        let there = self.at(self.gps_time(receiver_clock));
        predict_from(satellite, &ReceiverState::from(&there), model)
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position_ecef_m.iter().all(|x| x.is_finite())
            && self.velocity_ecef_mps.iter().all(|x| x.is_finite())
            && self.clock_bias_m.is_finite()
            && self.clock_drift_mps.is_finite()
    }
}

impl From<&Solution> for NavState {
    /// The state a solution found; velocity and drift are zero where it has none.
    fn from(solution: &Solution) -> Self {
        let (velocity_ecef_mps, clock_drift_mps) =
            solution.velocity.map_or((Vector3::zeros(), 0.0), |v| {
                (v.velocity_ecef_mps, v.clock_drift_mps)
            });
        Self {
            time: solution.gps_time(),
            position_ecef_m: solution.position_ecef_m,
            velocity_ecef_mps,
            clock_bias_m: solution.clock_bias_m,
            clock_drift_mps,
        }
    }
}

impl From<&NavState> for ReceiverState {
    /// The part that decides what arrives at a GPS time: all but the clock's bias.
    fn from(state: &NavState) -> Self {
        Self {
            time: state.time,
            position_ecef_m: state.position_ecef_m,
            velocity_ecef_mps: state.velocity_ecef_mps,
            clock_drift_mps: state.clock_drift_mps,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::made_up_sky::receiver;

    #[test]
    fn the_clock_is_undone_at_any_instant() {
        let state = receiver();
        for later_s in [-3.0, 0.0, 0.02, 100.0] {
            let there = state.at(state.time + later_s);
            let back = state.gps_time(there.receiver_clock());
            // The sum of a time and an interval rounds to 1e-16 s of fraction; the interval of
            // 100 s itself to 1e-14 s.
            assert!((back - there.time).abs() < 1e-13, "{}", back - there.time);
        }
    }

    #[test]
    fn motion_is_uniform() {
        let state = receiver();
        let there = state.at(state.time + 2.0);
        let moved = there.position_ecef_m - state.position_ecef_m;
        // Coordinates of 4e6 m step by 5e-10 m.
        assert!((moved - state.velocity_ecef_mps * 2.0).norm() < 2e-9);
        assert!((there.clock_bias_m - state.clock_bias_m - 420.0).abs() < 1e-9);
    }
}
