//! Satellites, receivers and noise for tests.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::measurement::{self, RawMeasurement};
use crate::{
    Ephemeris, EphemerisStore, Geodetic, GpsTime, Measurement, MeasurementModel, NavState,
    SatelliteId,
};

/// Time of the orbits of [`constellation`].
pub(crate) fn reference_time() -> GpsTime {
    GpsTime::new(2190, 540_000.0)
}

/// 30 satellites in six planes, with the eccentricities and harmonics of real ones.
pub(crate) fn constellation(rng: &mut ChaCha8Rng) -> EphemerisStore {
    let reference = reference_time();
    (0..30u8)
        .map(|k| Ephemeris {
            satellite: SatelliteId::gps(k + 1),
            iodc: 1,
            iode: 1,
            health: 0,
            ura_index: 0,
            codes_on_l2: 0,
            l2_p_data_off: false,
            fit_interval_extended: false,
            toc: reference,
            af0_s: rng.random_range(-5e-4..5e-4),
            af1: rng.random_range(-1e-11..1e-11),
            af2_per_s: 0.0,
            tgd_s: 5e-9,
            toe: reference,
            sqrt_a: 5153.6 + rng.random_range(-0.1..0.1),
            eccentricity: rng.random_range(0.0..0.02),
            m0_rad: f64::from(k / 6) * 1.26 + f64::from(k % 6) * 0.4 - f64::from(k),
            delta_n_rad_s: 4.5e-9,
            omega0_rad: f64::from(k % 6) * 1.047,
            omega_dot_rad_s: -8e-9,
            i0_rad: 0.96,
            idot_rad_s: 1e-10,
            omega_rad: f64::from(k),
            cuc_rad: 1e-6,
            cus_rad: 8e-6,
            crc_m: 230.0,
            crs_m: 20.0,
            cic_rad: 1e-7,
            cis_rad: -1e-7,
        })
        .collect()
}

/// A number of mean 0 and variance 1.
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    // Sum of twelve uniform variables: variance 1, no tails, which no test here needs.
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

/// A receiver on an aircraft, its clock late by a third of a millisecond.
pub(crate) fn receiver() -> NavState {
    NavState {
        time: reference_time() + 0.123_456_7,
        position_ecef_m: Geodetic::from_degrees(48.1, 11.6, 520.0).to_ecef(),
        velocity_ecef_mps: Vector3::new(60.0, -180.0, 25.0),
        clock_bias_m: -1e5,
        clock_drift_mps: 210.0,
    }
}

/// What `receiver` measures without noise of all satellites above 10 degrees, given the variances
/// of 45 dB-Hz over 20 ms.
pub(crate) fn measure(
    store: &EphemerisStore,
    receiver: &NavState,
    model: &MeasurementModel,
) -> Vec<Measurement> {
    let receive_time = receiver.receiver_clock();
    let raw: Vec<RawMeasurement> = store
        .iter()
        .filter_map(|ephemeris| {
            let expected = receiver.expect(ephemeris, receive_time, model).ok()?;
            (expected.look.elevation_rad > 10f64.to_radians()).then(|| RawMeasurement {
                satellite: ephemeris.satellite,
                transmit_time: expected.transmit_time,
                pseudorange_m: RawMeasurement::pseudorange_m(receive_time, expected.transmit_time),
                range_rate_mps: expected.range_rate_mps,
                pseudorange_variance_m2: 5.8 * 5.8,
                range_rate_variance_m2_s2: 0.06 * 0.06,
                cn0_dbhz: 45.0,
            })
        })
        .collect();
    measurement::form(receive_time, &raw, store).measurements
}
