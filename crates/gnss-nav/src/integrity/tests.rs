//! Made-up epochs with faults.

use nalgebra::Vector3;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::made_up_sky::{constellation, measure, normal, receiver};
use crate::measurement::ErrorModel;
use crate::{Geodetic, NavState};

const SIGMA_M: f64 = 2.0;
const LAT_DEG: f64 = 0.0;
const LON_DEG: f64 = 60.0;

fn model() -> MeasurementModel {
    MeasurementModel {
        errors: ErrorModel::TRACKING_NOISE_ONLY,
        ..MeasurementModel::default()
    }
}

/// A receiver with eleven satellites in sight.
fn observer() -> NavState {
    NavState {
        position_ecef_m: Geodetic::from_degrees(LAT_DEG, LON_DEG, 100.0).to_ecef(),
        ..receiver()
    }
}

/// The first `count` satellites above 10 degrees, with noise of the stated deviation.
fn epoch(count: usize, seed: u64) -> Vec<Measurement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let store = constellation(&mut ChaCha8Rng::seed_from_u64(1));
    let mut all = measure(&store, &observer(), &model());
    all.truncate(count);
    assert_eq!(all.len(), count);
    for one in &mut all {
        one.pseudorange_variance_m2 = SIGMA_M * SIGMA_M;
        one.pseudorange_m += SIGMA_M * normal(&mut rng);
    }
    all
}

fn solved(measurements: &[Measurement]) -> Assured {
    let settings = IntegritySettings::default();
    solve(measurements, &model(), &Vector3::zeros(), &settings).unwrap()
}

fn error_m(assured: &Assured) -> f64 {
    (assured.solution.position_ecef_m - observer().position_ecef_m).norm()
}

#[test]
fn parity_is_the_chi_square_and_forgets_what_is_taken_out() {
    let mut measurements = epoch(8, 3);
    let clean = least_squares::solve(&measurements, &model(), &Vector3::zeros()).unwrap();
    let parity = Parity::of(&clean).unwrap();
    // Both are the same quadratic form; rounding of 2e7 m pseudoranges, 4 nm, over 2 m.
    assert!((parity.chi_square() - clean.chi_square).abs() < 1e-7);
    let before = parity.without(&[2, 5]).unwrap();
    measurements[2].pseudorange_m += 40.0;
    measurements[5].pseudorange_m -= 70.0;
    let faulty = least_squares::solve(&measurements, &model(), &Vector3::zeros()).unwrap();
    let parity = Parity::of(&faulty).unwrap();
    assert!(parity.chi_square() > 100.0);
    // The geometry turns by the 100 m of displacement over 2e7 m.
    assert!((parity.without(&[2, 5]).unwrap() - before).abs() < 1e-2);
    assert_eq!(parity.without(&[0, 1, 2, 3, 4]), None);
    assert_eq!(parity.without(&[9]), None);
}

#[test]
fn leaving_one_out_is_what_a_solution_without_it_gives() {
    let measurements = epoch(7, 5);
    let all = least_squares::solve(&measurements, &model(), &Vector3::zeros()).unwrap();
    let parity = Parity::of(&all).unwrap();
    for left_out in 0..7 {
        let mut rest = measurements.clone();
        rest.remove(left_out);
        let without = least_squares::solve(&rest, &model(), &all.position_ecef_m).unwrap();
        let foreseen = parity.without(&[left_out]).unwrap();
        // Linear against iterated: metres over 2e7 m.
        assert!((foreseen - without.chi_square).abs() < 1e-4);
    }
}

#[test]
fn a_fault_of_code_periods_is_taken_out_where_six_satellites_are_left_to_tell() {
    for fault_m in [3e3, -3e5, 6e5] {
        for bad in 0..7 {
            let mut measurements = epoch(7, 2);
            measurements[bad].pseudorange_m += fault_m;
            let assured = solved(&measurements);
            let name = measurements[bad].satellite;
            assert_eq!(assured.solution.excluded, [name], "{fault_m} m");
            assert_eq!(assured.solution.consistency, Consistency::Passed);
        }
    }
    let mut five = epoch(5, 2);
    five[2].pseudorange_m += 3e3;
    let assured = solved(&five);
    assert_eq!(assured.solution.consistency, Consistency::Failed);
    assert!(assured.misfits.is_empty() && assured.solution.satellites.len() == 5);
    assert_eq!(assured.protection, None);
}

#[test]
fn errors_that_lay_the_mask_elsewhere_are_taken_out() {
    let masked = MeasurementModel {
        elevation_mask_rad: 10f64.to_radians(),
        ..model()
    };
    let settings = IntegritySettings::default();
    let found = |measurements: &[Measurement]| {
        let assured = solve(measurements, &masked, &Vector3::zeros(), &settings).unwrap();
        assert_eq!(assured.solution.consistency, Consistency::Passed);
        assert!(error_m(&assured) < 30.0);
        let misfits = assured.misfits.iter();
        assert!(misfits.clone().all(|m| m.place == Place::InUse));
        let names: Vec<SatelliteId> = misfits.map(|m| m.satellite).collect();
        assert_eq!(names, assured.solution.excluded);
        names
    };
    for fault_m in [6e6, -6e6, 1.5e7, f64::NAN] {
        for bad in 0..7 {
            let mut measurements = epoch(7, 2);
            measurements[bad].pseudorange_m += fault_m;
            assert_eq!(
                found(&measurements),
                [measurements[bad].satellite],
                "{fault_m} m"
            );
        }
    }
    let mut two = epoch(9, 2);
    two[6].pseudorange_m -= 3e6;
    two[1].pseudorange_m += 6e6;
    assert_eq!(found(&two), [two[1].satellite, two[6].satellite]);
    // A gross error, and one of a few hundred metres.
    two[6].pseudorange_m += 3e6 + 300.0;
    assert_eq!(found(&two), [two[1].satellite, two[6].satellite]);
}

#[test]
fn one_and_several_faults_are_taken_out_and_named() {
    for (faults, count) in [(1, 8), (2, 9), (3, 10)] {
        let mut measurements = epoch(count, 11);
        let names: Vec<SatelliteId> = (0..faults)
            .map(|k| {
                let one = &mut measurements[2 * k + 1];
                one.pseudorange_m += [90.0, -400.0, 6_000.0][k];
                one.satellite
            })
            .collect();
        let assured = solved(&measurements);
        let found: Vec<SatelliteId> = assured.misfits.iter().map(|m| m.satellite).collect();
        assert_eq!(found, names, "{faults} faults");
        assert_eq!(assured.solution.consistency, Consistency::Passed);
        // Noise of 2 m times a dilution below 5, three deviations.
        assert!(error_m(&assured) < 30.0);
        let residual_m = assured.misfits[0].residual_m;
        assert!((residual_m - 90.0).abs() < 30.0, "{residual_m}");
        assert!(assured.misfits[0].score > assured.misfits[0].threshold);
    }
}

#[test]
fn without_redundancy_nothing_is_vouched_for() {
    let four = solved(&epoch(4, 1));
    assert_eq!(four.solution.consistency, Consistency::Untested);
    assert_eq!(four.protection, None);
    // With five a fault shows, and nobody can say whose it is.
    let mut five = epoch(5, 1);
    five[0].pseudorange_m += 3_000.0;
    let five = solved(&five);
    assert_eq!(five.solution.consistency, Consistency::Failed);
    assert!(five.misfits.is_empty() && five.protection.is_none());
    let three = solve(
        &epoch(3, 1),
        &model(),
        &Vector3::zeros(),
        &IntegritySettings::default(),
    );
    assert!(matches!(three, Err(NavError::TooFew { .. })));
}

#[test]
fn a_bias_of_all_satellites_is_the_clocks() {
    let mut measurements = epoch(8, 2);
    for one in &mut measurements {
        one.pseudorange_m += 5_000.0;
    }
    let assured = solved(&measurements);
    assert!(assured.misfits.is_empty());
    assert!(error_m(&assured) < 30.0);
}

#[test]
fn a_satellite_below_the_mask_is_named_too() {
    let mut measurements = epoch(9, 4);
    let looks = solved(&measurements).solution.satellites;
    let low = looks
        .iter()
        .min_by(|a, b| a.elevation_rad.total_cmp(&b.elevation_rad))
        .unwrap();
    let masked = MeasurementModel {
        elevation_mask_rad: low.elevation_rad + 1e-3,
        ..model()
    };
    let at = looks.iter().position(|s| s.satellite == low.satellite);
    measurements[at.unwrap()].pseudorange_m -= 500.0;
    let settings = IntegritySettings::default();
    let assured = solve(&measurements, &masked, &Vector3::zeros(), &settings).unwrap();
    assert_eq!(assured.misfits.len(), 1);
    let misfit = assured.misfits[0];
    assert_eq!(
        (misfit.satellite, misfit.place),
        (low.satellite, Place::Unused)
    );
    assert!(assured.solution.excluded.is_empty());
}

#[test]
fn errors_beyond_the_protection_level_show() {
    // For each satellite the bias that is hardest to see: the one whose parity is the square root of
    // the threshold on average. Of the epochs in which it goes unnoticed at most 1e-3 may have an
    // error above the level; half of the faulty epochs go unnoticed, so of 7 x 60 none should.
    let settings = IntegritySettings::default();
    let (mut unnoticed, mut beyond) = (0, 0);
    for satellite in 0..7 {
        for seed in 0..60 {
            let mut measurements = epoch(7, 100 + seed);
            let clean = least_squares::solve(&measurements, &model(), &Vector3::zeros()).unwrap();
            let parity = Parity::of(&clean).unwrap();
            let explained = parity.redundancy(satellite).unwrap();
            let threshold = chi_square_threshold(3, settings.false_alarm_probability).unwrap();
            measurements[satellite].pseudorange_m += SIGMA_M * (threshold / explained).sqrt();
            let assured = solved(&measurements);
            let Some(levels) = assured.protection.filter(|_| assured.misfits.is_empty()) else {
                continue;
            };
            unnoticed += 1;
            let truth = observer().position_ecef_m;
            let enu = Geodetic::from_ecef(&truth).enu_from_ecef()
                * (assured.solution.position_ecef_m - truth);
            let is_beyond =
                enu.x.hypot(enu.y) > levels.horizontal_m || enu.z.abs() > levels.vertical_m;
            beyond += usize::from(is_beyond);
        }
    }
    assert!(unnoticed > 100, "{unnoticed}");
    assert_eq!(beyond, 0, "of {unnoticed}");
}

#[test]
fn false_alarms_come_at_the_stated_rate() {
    let settings = IntegritySettings {
        false_alarm_probability: 0.05,
        ..IntegritySettings::default()
    };
    let alarms = (0..400)
        .filter(|seed| {
            let assured = solve(
                &epoch(7, 1_000 + seed),
                &model(),
                &observer().position_ecef_m,
                &settings,
            )
            .unwrap();
            !assured.misfits.is_empty() || assured.solution.consistency == Consistency::Failed
        })
        .count();
    // 20 expected, standard deviation 4.4; the sum of twelve has lighter tails than a normal law.
    assert!((7..=33).contains(&alarms), "{alarms}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn no_pseudorange_makes_it_panic(
        count in 4usize..10,
        values in prop::collection::vec(prop_oneof![
            Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(-1e300), 1e7..4e7f64
        ], 10),
    ) {
        let mut measurements = epoch(count, 1);
        for (one, value) in measurements.iter_mut().zip(values) {
            one.pseudorange_m = value;
        }
        let settings = IntegritySettings::default();
        let _ = solve(&measurements, &model(), &Vector3::zeros(), &settings);
    }
}
