//! Range rates that oscillators were too far away to measure.
//!
//! What a faulty satellite makes of the filter the filter makes of every oscillator. Beyond some Hz a discriminator takes
//! one frequency for another, so that the healthy channels then err by metres a second until they are back in place, and
//! nothing but what the filter says without that satellite shows that they do.

use gnss_nav::constants::L1_WAVELENGTH_M;
use gnss_nav::filter::Innovations;
use gnss_nav::{Measurement, SatelliteId};
use gnss_signal::tracking::DopplerReach;

/// What is expected has to be certain to this part of what is told, one deviation, to say that something lay beyond.
const CERTAIN: f64 = 0.5;

/// Takes range rates out of `measurements` that lay out of reach if what `innovations` expect is true, and says whether
/// there were any. Oscillators are compared as they were when they measured, before the epoch: at 1 g a hertz or two.
pub(super) fn leave_out(
    measurements: &mut [Measurement],
    innovations: &Innovations,
    reaches: &[(SatelliteId, DopplerReach)],
) -> bool {
    let mut any = false;
    for innovation in innovations.satellites() {
        let satellite = innovation.satellite;
        let Some(rate) = &innovation.rate else {
            continue;
        };
        let Some((_, reach)) = reaches.iter().find(|(s, _)| *s == satellite) else {
            continue;
        };
        let of = measurements.iter_mut().find(|m| m.satellite == satellite);
        let Some(measurement) = of else { continue };
        let expected_hz = (rate.value() - measurement.range_rate_mps) / L1_WAVELENGTH_M;
        let sigma_hz = (rate.variance() - rate.noise_variance()).sqrt() / L1_WAVELENGTH_M;
        if sigma_hz <= CERTAIN * reach.width_hz && !reach.holds(expected_hz) {
            measurement.range_rate_variance_m2_s2 = f64::INFINITY;
            any = true;
        }
    }
    any
}

#[cfg(test)]
mod tests {
    use gnss_nav::filter::{BatchFilter, Covariance, FilterSettings, NavFilter};
    use gnss_nav::{GpsTime, NavState, SatelliteState};
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn what_lay_out_of_reach_is_not_heard() {
        let time = GpsTime::new(2400, 0.0);
        // It rises at 100 m/s towards a satellite overhead: a Doppler of 525.5 Hz.
        let state = NavState {
            time,
            position_ecef_m: Vector3::new(6.378e6, 0.0, 0.0),
            velocity_ecef_mps: Vector3::new(100.0, 0.0, 0.0),
            clock_bias_m: 0.0,
            clock_drift_mps: 0.0,
        };
        let knowing = |sigma: f64| {
            let covariance = Covariance::identity() * sigma * sigma;
            BatchFilter::new(state, covariance, FilterSettings::default()).unwrap()
        };
        let measurement = |prn, range_rate_mps| Measurement {
            satellite: SatelliteId::gps(prn),
            receive_time: time,
            pseudorange_m: 2.0e7,
            range_rate_mps,
            pseudorange_variance_m2: 60.0,
            range_rate_variance_m2_s2: 0.04,
            cn0_dbhz: 45.0,
            state: SatelliteState {
                position_ecef_m: Vector3::new(2.6378e7, 0.0, 0.0),
                velocity_ecef_mps: Vector3::zeros(),
                clock_bias_s: 0.0,
                clock_drift: 0.0,
            },
            user_range_accuracy_m: 2.0,
        };
        // The last two are taken for signals 50 Hz, 9.5 m/s, away.
        let mut measurements = [
            measurement(3, -100.2),
            measurement(9, -109.5),
            measurement(16, -90.5),
        ];
        let innovations = knowing(0.5).innovations(&measurements).unwrap();
        let reach = |prn, oscillator_hz| {
            let width_hz = 12.5;
            let reach = DopplerReach {
                oscillator_hz,
                width_hz,
            };
            (SatelliteId::gps(prn), reach)
        };
        let near = [reach(3, 536.0), reach(9, 515.0), reach(16, 525.0)];
        assert!(!leave_out(&mut measurements, &innovations, &near));
        let far = [reach(3, 536.0), reach(9, 566.0), reach(16, 485.0)];
        let unsure = knowing(1.0).innovations(&measurements).unwrap();
        assert!(!leave_out(&mut measurements, &unsure, &far));
        assert!(leave_out(&mut measurements, &innovations, &far));
        let heard = measurements.map(|m| m.range_rate_variance_m2_s2.is_finite());
        assert_eq!(heard, [true, false, false]);
    }
}
