//! Made-up observations, solved.

use gnss_nav::constants::L1_WAVELENGTH_M;
use gnss_nav::{
    Ephemeris, EphemerisStore, Geodetic, GpsTime, MeasurementModel, NavState, RawMeasurement,
    SatelliteId,
};
use nalgebra::Vector3;

use super::*;
use crate::record::{EventKind, PvtRecord, Record, Status};
use crate::rinex_obs::{ObservedEpoch, ObservedSatellite};

fn reference() -> GpsTime {
    GpsTime::new(2190, 540_000.0)
}

/// Thirty satellites in six planes on circles.
fn constellation() -> EphemerisStore {
    let orbit = |k: u8| Ephemeris {
        satellite: SatelliteId::gps(k + 1),
        iodc: 1,
        iode: 1,
        health: 0,
        ura_index: 0,
        codes_on_l2: 0,
        l2_p_data_off: false,
        fit_interval_extended: false,
        toc: reference(),
        af0_s: 1e-5 * f64::from(k),
        af1: 0.0,
        af2_per_s: 0.0,
        tgd_s: 0.0,
        toe: reference(),
        sqrt_a: 5153.6,
        eccentricity: 0.0,
        m0_rad: f64::from(k / 6) * 1.26 + f64::from(k % 6) * 0.7,
        delta_n_rad_s: 0.0,
        omega0_rad: f64::from(k % 6) * 1.047,
        omega_dot_rad_s: -8e-9,
        i0_rad: 0.96,
        idot_rad_s: 0.0,
        omega_rad: 0.0,
        cuc_rad: 0.0,
        cus_rad: 0.0,
        crc_m: 0.0,
        crs_m: 0.0,
        cic_rad: 0.0,
        cis_rad: 0.0,
    };
    (0..30).map(orbit).collect()
}

/// A car at 20 m/s, its clock late.
fn start() -> NavState {
    NavState {
        time: reference() + 10.0,
        position_ecef_m: Geodetic::from_degrees(48.1, 11.6, 520.0).to_ecef(),
        velocity_ecef_mps: Vector3::new(12.0, -16.0, 0.0),
        clock_bias_m: -5e4,
        clock_drift_mps: 30.0,
    }
}

/// What it observes every second without noise, for so long.
fn drive(seconds: u32) -> Vec<ObservedEpoch> {
    let store = constellation();
    (0..seconds)
        .map(|k| observe(&store, &start().at(start().time + f64::from(k))))
        .collect()
}

fn observe(store: &EphemerisStore, state: &NavState) -> ObservedEpoch {
    let time = state.receiver_clock();
    let model = MeasurementModel::default();
    let satellites = store.iter().filter_map(|ephemeris| {
        let expected = state.expect(ephemeris, time, &model).ok()?;
        let is_up = expected.look.elevation_rad > 15f64.to_radians();
        is_up.then(|| ObservedSatellite {
            satellite: ephemeris.satellite,
            pseudorange_m: RawMeasurement::pseudorange_m(time, expected.transmit_time),
            phase_cycles: None,
            loss_of_lock: 0,
            doppler_hz: Some(-expected.range_rate_mps / L1_WAVELENGTH_M),
            cn0_dbhz: Some(45.0),
        })
    });
    ObservedEpoch {
        time,
        line: 1,
        missing: 0,
        satellites: satellites.collect(),
    }
}

fn settings() -> SolveSettings {
    SolveSettings {
        troposphere: false,
        ..SolveSettings::default()
    }
}

struct Reported {
    outcome: SolveOutcome,
    pvt: Vec<PvtRecord>,
    events: Vec<(f64, Option<SatelliteId>, EventKind)>,
}

impl Reported {
    fn names(&self) -> Vec<&'static str> {
        let kinds = self.events.iter();
        kinds
            .map(|(_, _, kind)| crate::sink::events::kind_name(kind))
            .collect()
    }

    /// Largest distance from the truth, m.
    fn worst_m(&self) -> f64 {
        let off = |p: &PvtRecord| {
            (p.position_ecef_m - start().at(start().time + p.time_s).position_ecef_m).norm()
        };
        self.pvt.iter().map(off).fold(0.0, f64::max)
    }
}

fn solve(settings: SolveSettings, epochs: &[ObservedEpoch]) -> Reported {
    let mut solver = Solver::new(settings, constellation(), Vector3::zeros()).unwrap();
    let (mut pvt, mut events) = (Vec::new(), Vec::new());
    for epoch in epochs {
        let mut sink = |record| {
            match record {
                Record::Pvt(record) => pvt.push(record),
                Record::Event(e) => events.push((e.time_s, e.satellite, e.kind)),
                _ => {}
            }
            Ok(())
        };
        solver.epoch(epoch, &mut sink).unwrap();
    }
    Reported {
        outcome: solver.finish(),
        pvt,
        events,
    }
}

#[test]
fn exact_observations_give_the_truth_by_either_way() {
    let epochs = drive(30);
    assert!(epochs[0].satellites.len() >= 7);
    let alone = solve(settings(), &epochs);
    // Convergence stops below 1e-4 m; the drift times a second of travel is left out, 1e-5 m.
    assert!(alone.worst_m() < 1e-3, "{}", alone.worst_m());
    assert_eq!(alone.names(), ["first_fix", "integrity_changed"]);
    assert!(alone.pvt.iter().all(|p| p.vertical_protection_m.is_some()));
    let mut kinematic = settings();
    kinematic.kinematic = Some(KinematicSettings::default());
    let filtered = solve(kinematic, &epochs);
    assert_eq!(filtered.pvt.len(), 30);
    // The filter's range rates leave the position out: 2e-4 1/s times its error.
    assert!(filtered.worst_m() < 1e-2, "{}", filtered.worst_m());
    let speed = filtered.pvt[29].velocity.unwrap().ecef_mps - start().velocity_ecef_mps;
    assert!(speed.norm() < 1e-2);
}

#[test]
fn a_step_and_a_ramp_are_found_and_a_second_one_after_them() {
    let epochs = drive(60);
    let first = epochs[0].satellites[1].satellite;
    let second = epochs[0].satellites[4].satellite;
    let mut with_faults = settings();
    with_faults.faults = vec![
        format!("{first}:80@20").parse().unwrap(),
        format!("{second}:4@30:ramp").parse().unwrap(),
    ];
    let reported = solve(with_faults, &epochs);
    let excluded: Vec<_> = reported
        .events
        .iter()
        .filter_map(|(time_s, satellite, kind)| match kind {
            EventKind::Excluded { residual_m, .. } => Some((*time_s, *satellite, *residual_m)),
            _ => None,
        })
        .collect();
    assert_eq!(excluded.len(), 2, "{excluded:?}");
    assert!((excluded[0].0 - 20.0).abs() < 1e-4 && excluded[0].1 == Some(first));
    assert!((excluded[0].2.unwrap() - 80.0).abs() < 0.1);
    // 4 m/s reach the deviations of 2.5 to 4 m, times the root of the threshold, in seconds.
    assert!((31.0..45.0).contains(&excluded[1].0) && excluded[1].1 == Some(second));
    assert!(reported.outcome.absent.is_empty());
}

#[test]
fn what_was_injected_and_never_came_is_reported() {
    let epochs = drive(5);
    let mut with_faults = settings();
    let never = "G33:15@2".parse().unwrap();
    let late = format!("{}:15@100", epochs[0].satellites[0].satellite);
    with_faults.faults = vec![never, late.parse().unwrap()];
    let absent = solve(with_faults, &epochs).outcome.absent;
    assert_eq!(absent.len(), 2);
}

#[test]
fn a_jump_of_the_clock_and_an_outage_do_not_disturb_the_filter() {
    let store = constellation();
    let mut epochs = drive(40);
    for (k, epoch) in (0..).zip(epochs.iter_mut()) {
        let mut state = start().at(start().time + f64::from(k));
        if k >= 20 {
            state.clock_bias_m += gnss_nav::constants::SPEED_OF_LIGHT_MPS * 1e-3;
        }
        *epoch = observe(&store, &state);
        if (25..30).contains(&k) {
            epoch.satellites.clear();
        }
    }
    let mut kinematic = settings();
    kinematic.kinematic = Some(KinematicSettings::default());
    let reported = solve(kinematic, &epochs);
    assert_eq!(reported.pvt.len(), 40);
    let predicted = reported
        .pvt
        .iter()
        .filter(|p| p.status == Status::Predicted);
    assert_eq!(predicted.count(), 5);
    // Records are stamped with the receiver's own time, which is a millisecond later from the jump
    // on: 2 cm of a car at 20 m/s.
    assert!(reported.worst_m() < 0.03, "{}", reported.worst_m());
    let sigma = |k: usize| reported.pvt[k].sigma_enu_m[0];
    assert!(sigma(29) > sigma(24));
}

#[test]
fn three_satellites_bad_times_and_no_ephemeris_are_told() {
    let mut few = drive(3);
    for epoch in &mut few {
        epoch.satellites.truncate(3);
    }
    let reported = solve(settings(), &few);
    assert!(reported.pvt.is_empty());
    let why = reported.outcome.no_fix_reason.unwrap();
    assert!(why.contains("at most 3 GPS satellites"), "{why}");
    let mut twice = drive(4);
    twice[2].time = twice[1].time;
    let reported = solve(settings(), &twice);
    assert_eq!((reported.pvt.len(), reported.outcome.epochs), (3, 3));
    assert!(reported.names().contains(&"epoch_skipped"));
    let mut old = drive(2);
    for epoch in &mut old {
        epoch.time = epoch.time + 86_400.0;
    }
    let why = solve(settings(), &old).outcome.no_fix_reason.unwrap();
    assert!(why.contains("0 of them healthy"), "{why}");
    let why = solve(settings(), &[]).outcome.no_fix_reason.unwrap();
    assert_eq!(why, "the file holds no epoch");
}

#[test]
fn a_bias_of_all_is_taken_for_the_clock() {
    let mut epochs = drive(3);
    for satellite in &mut epochs[1].satellites {
        satellite.pseudorange_m += 1_000.0;
    }
    let reported = solve(settings(), &epochs);
    // The satellites are taken 3.3 microseconds earlier: millimetres.
    assert!(reported.worst_m() < 0.02, "{}", reported.worst_m());
}
