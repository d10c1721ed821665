//! Orbits and the store on made-up ephemerides.

use super::*;
use crate::constants::{EARTH_RATE_RAD_S, MU_M3_PER_S2};

/// A circular equatorial orbit over longitude zero at `toe`.
fn circular(prn: u8, toe: GpsTime) -> Ephemeris {
    Ephemeris {
        satellite: SatelliteId::gps(prn),
        iodc: 1,
        iode: 1,
        health: 0,
        ura_index: 0,
        codes_on_l2: 0,
        l2_p_data_off: false,
        fit_interval_extended: false,
        toc: toe,
        af0_s: 1e-4,
        af1: 1e-11,
        af2_per_s: 0.0,
        tgd_s: 2e-8,
        toe,
        sqrt_a: 5_153.6,
        eccentricity: 0.0,
        m0_rad: 0.0,
        delta_n_rad_s: 0.0,
        omega0_rad: EARTH_RATE_RAD_S * toe.tow_s(),
        omega_dot_rad_s: 0.0,
        i0_rad: 0.0,
        idot_rad_s: 0.0,
        omega_rad: 0.0,
        cuc_rad: 0.0,
        cus_rad: 0.0,
        crc_m: 0.0,
        crs_m: 0.0,
        cic_rad: 0.0,
        cis_rad: 0.0,
    }
}

fn toe() -> GpsTime {
    GpsTime::new(2190, 7_200.0)
}

#[test]
fn circular_orbit_at_toe() {
    let state = circular(1, toe()).state_at(toe()).unwrap();
    let radius_m = 5_153.6f64.powi(2);
    // Speed in inertial space less that of the turning frame.
    let speed_mps = (MU_M3_PER_S2 / radius_m).sqrt() - EARTH_RATE_RAD_S * radius_m;
    // Rounding of 2.66e7 m.
    assert!((state.position_ecef_m - Vector3::new(radius_m, 0.0, 0.0)).norm() < 1e-7);
    assert!((state.velocity_ecef_mps - Vector3::new(0.0, speed_mps, 0.0)).norm() < 1e-9);
    assert_eq!(state.clock_bias_s, 1e-4 - 2e-8);
    assert_eq!(state.clock_drift, 1e-11);
}

#[test]
fn transmission_by_the_satellites_own_clock() {
    let satellite_time = toe() + 100.0;
    let (time, state) = circular(1, toe())
        .state_at_transmission(satellite_time)
        .unwrap();
    // The clock is 99.98 us ahead, and 1 ns more by its drift.
    assert!((satellite_time - time - state.clock_bias_s).abs() < 1e-13);
}

#[test]
fn week_rollover_does_not_matter() {
    let end = GpsTime::new(2189, 604_784.0);
    let before = circular(1, end)
        .state_at(GpsTime::new(2190, 1_000.0))
        .unwrap();
    let again = circular(1, end).state_at(end + 1_016.0).unwrap();
    assert_eq!(before, again);
}

#[test]
fn absurd_elements_are_errors() {
    let good = circular(1, toe());
    let absurd = [
        Ephemeris {
            eccentricity: 1.0,
            ..good
        },
        Ephemeris {
            eccentricity: f64::NAN,
            ..good
        },
        Ephemeris {
            sqrt_a: 0.0,
            ..good
        },
        Ephemeris {
            m0_rad: f64::INFINITY,
            ..good
        },
        Ephemeris {
            af0_s: f64::NAN,
            ..good
        },
        Ephemeris {
            crc_m: f64::INFINITY,
            ..good
        },
    ];
    for ephemeris in absurd {
        assert!(matches!(
            ephemeris.state_at(toe()),
            Err(NavError::Orbit { .. })
        ));
    }
}

#[test]
fn accuracy_and_fit_interval_follow_the_standard() {
    let good = circular(1, toe());
    for (index, metres) in [(0, 2.0), (1, 2.828), (6, 16.0), (7, 32.0), (15, 8_192.0)] {
        let ephemeris = Ephemeris {
            ura_index: index,
            ..good
        };
        assert!((ephemeris.user_range_accuracy_m() - metres).abs() < 1e-3);
    }
    for (iodc, hours) in [(1, 6.0), (240, 8.0), (496, 14.0), (1023, 26.0)] {
        let ephemeris = Ephemeris {
            iodc,
            fit_interval_extended: true,
            ..good
        };
        assert_eq!(ephemeris.fit_interval_h(), hours);
    }
}

#[test]
fn store_selects_the_nearest_valid_issue() {
    let mut store = EphemerisStore::new();
    let satellite = SatelliteId::gps(1);
    assert!(store.insert(circular(1, toe())));
    assert!(!store.insert(circular(1, toe())));
    assert!(store.insert(circular(1, toe() + 7_200.0)));
    let chosen = |late_s: f64| {
        store
            .select(satellite, toe() + late_s)
            .map(|e| e.toe - toe())
    };
    assert_eq!(chosen(-7_200.0), Some(0.0));
    assert_eq!(chosen(3_599.0), Some(0.0));
    assert_eq!(chosen(3_600.0), Some(7_200.0));
    assert_eq!(chosen(14_400.0), Some(7_200.0));
    assert_eq!(chosen(14_401.0), None);
    assert_eq!(store.select(SatelliteId::gps(2), toe()), None);
    assert_eq!(store.iter().count(), 2);
    // Uploaded anew for the same time under another issue.
    let corrected = Ephemeris {
        iode: 99,
        ..circular(1, toe())
    };
    assert!(store.insert(corrected));
    assert_eq!(store.select(satellite, toe()), Some(&corrected));
}
