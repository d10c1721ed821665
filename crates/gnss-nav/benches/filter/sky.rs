//! A receiver under satellites spread through the sky.

use gnss_nav::dynamics::{AccelerationNoise, ClockNoise, ProcessNoise};
use gnss_nav::filter::{Covariance, FilterSettings};
use gnss_nav::{
    Geodetic, GpsTime, Measurement, MeasurementModel, NavState, SatelliteId, SatelliteState,
};
use nalgebra::Vector3;

pub(crate) fn state() -> NavState {
    NavState {
        time: GpsTime::new(2190, 540_000.0),
        position_ecef_m: Geodetic::from_degrees(48.1, 11.6, 520.0).to_ecef(),
        velocity_ecef_mps: Vector3::new(60.0, -180.0, 25.0),
        clock_bias_m: -1e5,
        clock_drift_mps: 210.0,
    }
}

/// 5 m and 0.5 m/s.
pub(crate) fn covariance() -> Covariance {
    Covariance::from_diagonal(&nalgebra::SVector::from_fn(|i, _| {
        if i % 2 == 0 { 25.0 } else { 0.25 }
    }))
}

/// Horizontal and vertical motion told apart, the default gate, no delays.
pub(crate) fn settings() -> FilterSettings {
    FilterSettings {
        process_noise: ProcessNoise {
            acceleration: AccelerationNoise {
                horizontal_m2_per_s3: 1.0,
                vertical_m2_per_s3: 0.1,
            },
            clock: ClockNoise::tcxo(),
        },
        ..FilterSettings::default()
    }
}

/// What `receiver` measures of `satellites` above 10 degrees, a metre off.
pub(crate) fn measurements(receiver: &NavState, satellites: usize) -> Vec<Measurement> {
    let ecef = Geodetic::from_ecef(&receiver.position_ecef_m)
        .enu_from_ecef()
        .transpose();
    (0..satellites)
        .map(|k| {
            let azimuth = 2.4 * k as f64;
            let elevation = 0.2 + 1.3 * (k as f64 + 0.5) / satellites as f64;
            let (sin, cos) = elevation.sin_cos();
            let direction = ecef * Vector3::new(azimuth.sin() * cos, azimuth.cos() * cos, sin);
            let state = SatelliteState {
                position_ecef_m: receiver.position_ecef_m + direction * 2.2e7,
                velocity_ecef_mps: ecef * Vector3::new(2e3, -1e3 * sin, 500.0 * cos),
                clock_bias_s: 1e-4,
                clock_drift: 1e-11,
            };
            measure(k, state, receiver)
        })
        .collect()
}

fn measure(k: usize, state: SatelliteState, receiver: &NavState) -> Measurement {
    let model = MeasurementModel::default();
    let predicted = model.predict(&state, &receiver.position_ecef_m, receiver.time);
    let rate = predicted
        .line_of_sight
        .range_rate_mps(&receiver.velocity_ecef_mps);
    Measurement {
        satellite: SatelliteId::gps(k as u8 + 1),
        receive_time: receiver.receiver_clock(),
        pseudorange_m: predicted.pseudorange_m + receiver.clock_bias_m + 1.0,
        range_rate_mps: rate + receiver.clock_drift_mps,
        pseudorange_variance_m2: 33.0,
        range_rate_variance_m2_s2: 0.0036,
        cn0_dbhz: 45.0,
        state,
        user_range_accuracy_m: 2.0,
    }
}
