//! A gate on range rates, by what the other channels say.
//!
//! What the filter expects of a rate is no better than the frequency of the clock, 0.7 m/s after 20 ms, so that its own gate
//! lets the carrier pass that has slipped. Between two or three carriers that are taken for good to centimetres a second
//! it would then seek a velocity that suits them all, and by it steer the other channels off their signals (a noisy
//! oscillator did so once in 1700 runs of 400 s). Given the others a rate is expected to centimetres a second as well.

use gnss_nav::Measurement;
use gnss_nav::filter::GivenOthers;

use super::monitors::CONTRADICTS_SIGMAS;

/// Takes range rates out of `measurements` that contradict those of the others, by what is `given` them, and says
/// whether there were any.
pub(super) fn close(measurements: &mut [Measurement], given: &[GivenOthers]) -> bool {
    let mut any = false;
    for measurement in measurements {
        let mut given = given.iter();
        let given = given.find(|given| given.satellite == measurement.satellite);
        if given.is_some_and(contradicts) {
            measurement.range_rate_variance_m2_s2 = f64::INFINITY;
            any = true;
        }
    }
    any
}

fn contradicts(given: &GivenOthers) -> bool {
    let most2 = CONTRADICTS_SIGMAS * CONTRADICTS_SIGMAS;
    let rate = given.rate.as_ref();
    rate.is_some_and(|rate| rate.normalised_squared() > most2)
}

#[cfg(test)]
mod tests {
    use gnss_nav::filter::Deviation;
    use gnss_nav::{GpsTime, SatelliteId, SatelliteState};
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
            range_rate_variance_m2_s2: 1e-4,
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
        let given = |prn, of_others_mps| GivenOthers {
            satellite: SatelliteId::gps(prn),
            code: Deviation {
                value: 5.0,
                variance: 64.0,
            },
            rate: Some(Deviation {
                value: of_others_mps,
                variance: 0.025 * 0.025,
            }),
        };
        let mut measurements = [measurement(9), measurement(16), measurement(24)];
        let quiet = [given(9, 0.14), given(16, -0.03)];
        assert!(!close(&mut measurements, &quiet));
        assert_eq!(measurements[0], measurement(9));
        let slipped = [given(9, 0.94), given(16, -0.03)];
        assert!(close(&mut measurements, &slipped));
        assert_eq!(measurements[0].range_rate_variance_m2_s2, f64::INFINITY);
        assert_eq!(measurements[1..], [measurement(16), measurement(24)]);
        // A rate that was not measured contradicts nothing.
        let unheard = GivenOthers {
            rate: None,
            ..given(9, 0.94)
        };
        assert!(!close(&mut [measurement(9)], &[unheard]));
    }
}
