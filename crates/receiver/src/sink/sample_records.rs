//! Records for the tests of the writers.

use gnss_nav::{Ephemeris, GpsTime, SatelliteId};
use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;

use crate::record::{
    CarrierPhase, ChannelRecord, Disposition, Lock, LoopMembership, Observation, ObservationEpoch,
    PvtRecord, Source, Status, TrackingRecord, VelocityRecord,
};
use gnss_nav::geodesy::Geodetic;

/// GPS time of the first sample.
pub(crate) fn start() -> GpsTime {
    GpsTime::new(2190, 540_000.0)
}

pub(crate) fn place() -> Geodetic {
    Geodetic::from_degrees(35.681_298, 139.766_247, 10.0)
}

pub(crate) fn pvt(time_s: f64) -> PvtRecord {
    PvtRecord {
        time_s,
        time: start() + time_s,
        position_ecef_m: place().to_ecef(),
        velocity: Some(VelocityRecord {
            ecef_mps: Vector3::new(0.01, -0.02, 0.03),
            clock_drift_mps: 0.25,
            sigma_mps: 0.05,
        }),
        clock_bias_m: 1234.5,
        satellites_used: 9,
        pdop: 1.9,
        source: Source::LeastSquares,
        sigma_enu_m: [0.5, 0.6, 1.1],
        position_covariance_ecef_m2: Matrix3::identity(),
        horizontal_protection_m: None,
        vertical_protection_m: None,
        status: Status::Fix,
        filter: None,
    }
}

pub(crate) fn channel(time_s: f64, prn: u8) -> ChannelRecord {
    ChannelRecord {
        time_s,
        satellite: SatelliteId::gps(prn),
        cn0_dbhz: Some(44.5),
        tracking: Some(TrackingRecord {
            lock: Lock::Carrier,
            membership: LoopMembership::Scalar,
            prompt: Complex64::new(12.5, -0.25),
            code_error_chips: 0.001,
            frequency_error_hz: -0.5,
        }),
        pseudorange_m: Some(21_000_000.125),
        range_rate_mps: Some(-321.5),
        innovation_code_m: None,
        innovation_rate_mps: None,
        disposition: Disposition::Use,
        scores: Vec::new(),
    }
}

pub(crate) fn observation(prn: u8, azimuth_deg: f64, elevation_deg: f64) -> Observation {
    Observation {
        satellite: SatelliteId::gps(prn),
        pseudorange_m: 21_000_000.125,
        doppler_hz: Some(1690.0),
        cn0_dbhz: Some(44.5),
        carrier_phase: Some(CarrierPhase {
            cycles: 1234.567,
            loss_of_lock: true,
            half_cycle: true,
        }),
        azimuth_rad: Some(azimuth_deg.to_radians()),
        elevation_rad: Some(elevation_deg.to_radians()),
    }
}

pub(crate) fn observations(time_s: f64) -> ObservationEpoch {
    let mut untracked = observation(31, 200.0, 20.0);
    untracked.carrier_phase = None;
    ObservationEpoch {
        time_s,
        time: start() + time_s,
        observations: vec![
            observation(7, 10.0, 70.0),
            observation(12, 100.0, 30.0),
            observation(25, 300.0, 45.0),
            untracked,
        ],
    }
}

pub(crate) fn ephemeris(prn: u8) -> Ephemeris {
    Ephemeris {
        satellite: SatelliteId::gps(prn),
        iodc: 0x155,
        iode: 0x55,
        health: 0,
        ura_index: 2,
        codes_on_l2: 1,
        l2_p_data_off: false,
        fit_interval_extended: false,
        toc: GpsTime::new(2190, 540_000.0),
        af0_s: -1.23e-4,
        af1: 2.5e-12,
        af2_per_s: 0.0,
        tgd_s: -1.1e-8,
        toe: GpsTime::new(2190, 540_000.0),
        sqrt_a: 5153.7,
        eccentricity: 0.01,
        m0_rad: 1.0,
        delta_n_rad_s: 4.5e-9,
        omega0_rad: -2.0,
        omega_dot_rad_s: -8.0e-9,
        i0_rad: 0.96,
        idot_rad_s: 1e-10,
        omega_rad: 0.5,
        cuc_rad: 1e-6,
        cus_rad: 2e-6,
        crc_m: 250.0,
        crs_m: -60.0,
        cic_rad: 1e-7,
        cis_rad: -1e-7,
    }
}
