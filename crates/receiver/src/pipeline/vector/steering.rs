//! Between the filter's state and the channels: what they measured, and where they are put.

use gnss_nav::constants::{L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use gnss_nav::prediction::Expected;
use gnss_nav::{GpsTime, RawMeasurement, SatelliteId};
use gnss_signal::tracking::{ChannelEpoch, Steering};

use super::settings::{MeasurementNoise, VectorSettings};
use super::{Member, Surroundings, Time, VectorTracking};
use crate::pipeline::slot::Slot;

/// Variance of the code phase when a channel gets its own loops back, chips^2.
pub(in crate::pipeline) const RELEASED_VARIANCE_CHIPS2: f64 = 0.01;

impl VectorTracking {
    /// Puts every channel whose bit boundaries are known, and where time is coarse every channel, where its
    /// signal is expected; of `members` it is known where their satellites are. A channel of which nothing is expected any
    /// more, its ephemeris having run out, gets its own loops back, and learns the next.
    pub(in crate::pipeline) fn steer(
        &self,
        around: &Surroundings,
        members: &[Member],
        slots: &mut [Slot],
    ) {
        for slot in slots {
            let member = members.iter().find(|m| m.satellite == slot.satellite);
            let expected = match member {
                Some(member) => Some(self.state().expect_from(
                    &member.expected.state,
                    around.receive_time,
                    self.model(),
                )),
                None => self.expected(around, slot.satellite),
            };
            let Some(expected) = expected else {
                if slot.channel.is_steered() {
                    slot.channel.release(RELEASED_VARIANCE_CHIPS2);
                }
                continue;
            };
            let to = steering(around.tick, &expected, self.time());
            match self.time() {
                Time::Exact => slot.channel.steer(&to),
                Time::Coarse => slot.channel.steer_early(&to),
            };
        }
    }
}

/// The oscillators of a signal that arrives as expected at `tick`, and where time is exact its bits.
pub(in crate::pipeline) fn steering(tick: u64, expected: &Expected, time: Time) -> Steering {
    Steering {
        tick,
        periods_into_bit: (time == Time::Exact).then(|| expected.periods_into_bit()),
        code_phase_chips: expected.code_phase_chips(),
        code_rate_hz: expected.code_rate_hz(),
        doppler_hz: expected.doppler_hz,
    }
}

/// The measurement of a steered channel: the code phase nearest to the one expected; `None` where
/// nothing was measured.
pub(super) fn raw_measurement(
    epoch: &ChannelEpoch,
    satellite: SatelliteId,
    receive_time: GpsTime,
    expected: &Expected,
    settings: &VectorSettings,
) -> Option<RawMeasurement> {
    if !epoch.code_variance_chips2.is_finite() {
        return None;
    }
    let spec = epoch.signal.spec();
    let length = f64::from(spec.code_length_chips);
    let ahead = epoch.code_phase_chips - expected.code_phase_chips();
    let ahead = (ahead + length / 2.0).rem_euclid(length) - length / 2.0;
    let transmit_time = expected.transmit_time + ahead / spec.code_rate_hz;
    let chip_m = SPEED_OF_LIGHT_MPS / spec.code_rate_hz;
    let (code, rate) = match settings.noise {
        MeasurementNoise::Measured => (
            epoch.code_variance_chips2 * chip_m * chip_m,
            epoch.doppler_variance_hz2 * L1_WAVELENGTH_M * L1_WAVELENGTH_M,
        ),
        MeasurementNoise::Fixed {
            pseudorange_m2,
            range_rate_m2_s2,
        } => (pseudorange_m2, range_rate_m2_s2),
    };
    let has_rate = epoch.doppler_variance_hz2.is_finite();
    Some(RawMeasurement {
        satellite,
        transmit_time,
        pseudorange_m: RawMeasurement::pseudorange_m(receive_time, transmit_time),
        range_rate_mps: -L1_WAVELENGTH_M * epoch.doppler_hz,
        pseudorange_variance_m2: code,
        range_rate_variance_m2_s2: if has_rate { rate } else { f64::INFINITY },
        cn0_dbhz: epoch.cn0_dbhz,
    })
}
