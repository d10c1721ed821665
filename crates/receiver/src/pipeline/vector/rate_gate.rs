//! A gate on range rates, by what the other channels say.
//!
//! What the filter expects of a rate is no better than the frequency of the clock, 0.7 m/s after 20 ms, so that its own gate
//! lets the carrier pass that has slipped. Between two or three carriers that are taken for good to centimetres a second
//! it would then seek a velocity that suits them all, and by it steer the other channels off their signals (a noisy
//! oscillator did so once in 1700 runs of 400 s). Given the others a rate is expected to centimetres a second as well.

use fault_ml::learned::ChannelStep;
use gnss_nav::{Measurement, SatelliteId};

use super::monitors::CONTRADICTS_SIGMAS;

/// Takes range rates out of `measurements` that contradict those of the others, and says whether there were any.
pub(super) fn close(
    measurements: &mut [Measurement],
    shown: &[(SatelliteId, ChannelStep)],
) -> bool {
    let mut any = false;
    for measurement in measurements {
        let is_of =
            |(satellite, _): &&(SatelliteId, ChannelStep)| *satellite == measurement.satellite;
        if shown
            .iter()
            .find(is_of)
            .is_some_and(|(_, step)| contradicts(step))
        {
            measurement.range_rate_variance_m2 = f64::INFINITY;
            any = true;
        }
    }
    any
}

fn contradicts(step: &ChannelStep) -> bool {
    let given = &step.given_others;
    given.rate_mps.abs() > CONTRADICTS_SIGMAS * given.rate_sigma_mps
}

#[cfg(test)]
mod tests {
    use fault_ml::Innovation;
    use fault_ml::learned::StrengthChange;
    use gnss_nav::SatelliteState;
    use gnss_nav::{GpsTime, Measurement};
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_carrier_that_slipped_is_not_heard() {
        let measurement = |prn| Measurement {
            satellite: SatelliteId::gps(prn),
            receive_time: GpsTime::new(2400, 0.0),
            pseudorange_m: 2.2e7,
            range_rate_mps: 100.0,
            pseudorange_variance_m2: 60.0,
            range_rate_variance_m2: 1e-4,
            cn0_dbhz: 40.0,
            state: SatelliteState {
                position_ecef_m: Vector3::zeros(),
                velocity_ecef_mps: Vector3::zeros(),
                clock_bias_s: 0.0,
                clock_drift: 0.0,
            },
            user_range_accuracy_m: 2.0,
        };
        // By its own deviation the filter expects 0.69 m/s.
        let step = |rate_mps, of_others_mps| {
            let innovation = |rate_mps, rate_sigma_mps| Innovation {
                code_m: 5.0,
                code_sigma_m: 8.0,
                rate_mps,
                rate_sigma_mps,
            };
            ChannelStep {
                satellite: 9,
                innovation: innovation(rate_mps, 0.69),
                given_others: innovation(of_others_mps, 0.025),
                cn0_dbhz: 40.0,
                cn0_now_hz: 1e4,
                others_change: StrengthChange::default(),
                tap_ratios: None,
            }
        };
        let (slipped, sound) = (SatelliteId::gps(9), SatelliteId::gps(16));
        let mut measurements = [measurement(9), measurement(16), measurement(24)];
        let quiet = [(slipped, step(0.54, 0.14)), (sound, step(-0.55, -0.03))];
        assert!(!close(&mut measurements, &quiet));
        assert_eq!(measurements[0], measurement(9));
        let shown = [(slipped, step(0.54, 0.94)), (sound, step(-0.55, -0.03))];
        assert!(close(&mut measurements, &shown));
        assert_eq!(measurements[0].range_rate_variance_m2, f64::INFINITY);
        assert_eq!(measurements[1..], [measurement(16), measurement(24)]);
        // A rate that was not measured contradicts nothing.
        let mut unheard = [measurement(9)];
        let infinite = step(0.0, 0.0);
        let given_others = Innovation {
            rate_sigma_mps: f64::INFINITY,
            ..infinite.given_others
        };
        let infinite = ChannelStep {
            given_others,
            ..infinite
        };
        assert!(!close(&mut unheard, &[(slipped, infinite)]));
    }
}
