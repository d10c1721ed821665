//! Snapshots of a made-up constellation, with noise and wrong priors.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::geodesy::Geodetic;
use crate::made_up_sky::{constellation, normal, reference_time};
use crate::measurement::ErrorModel;
use crate::prediction::{ReceiverState, predict};

const FALSE_ALARM: f64 = 1e-4;
const CODE_SIGMA_M: f64 = 10.0;
const DOPPLER_SIGMA_HZ: f64 = 5.0;

fn truth_time() -> GpsTime {
    reference_time() + 0.123_456_7
}

struct World {
    store: EphemerisStore,
    receiver: ReceiverState,
    measurements: Vec<SnapshotMeasurement>,
}

/// A receiver somewhere, with the satellites above 10 degrees.
fn world(seed: u64) -> World {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let store = constellation(&mut rng);
    let (lat, lon) = (
        rng.random_range(-70.0..70.0),
        rng.random_range(-180.0..180.0),
    );
    let receiver = ReceiverState {
        time: truth_time(),
        position_ecef_m: Geodetic::from_degrees(lat, lon, 500.0).to_ecef(),
        velocity_ecef_mps: Vector3::new(20.0, -80.0, 5.0),
        clock_drift_mps: 400.0,
    };
    let measurements = store
        .iter()
        .filter_map(|ephemeris| {
            let expected = predict(ephemeris, &receiver).unwrap();
            let visible = expected.look.elevation_rad > 10f64.to_radians();
            visible.then(|| {
                let noise_s = CODE_SIGMA_M * normal(&mut rng) / SPEED_OF_LIGHT_MPS;
                let sent = expected.transmit_time + noise_s;
                SnapshotMeasurement {
                    satellite: ephemeris.satellite,
                    transmit_fraction_s: sent.fraction_s() % 1e-3,
                    doppler_hz: expected.doppler_hz + DOPPLER_SIGMA_HZ * normal(&mut rng),
                    code_variance_m2: CODE_SIGMA_M.powi(2),
                    doppler_variance_hz2: DOPPLER_SIGMA_HZ.powi(2),
                }
            })
        })
        .collect();
    World {
        store,
        receiver,
        measurements,
    }
}

/// A prior `away_m` in a direction that differs from seed to seed and `late_s` off.
fn prior(world: &World, seed: u64, away_m: f64, late_s: f64) -> Prior {
    let geodetic = Geodetic::from_ecef(&world.receiver.position_ecef_m);
    let (sin, cos) = (seed as f64).sin_cos();
    let enu = Vector3::new(sin, cos, 0.0) * away_m;
    let position = world.receiver.position_ecef_m + geodetic.enu_from_ecef().transpose() * enu;
    Prior::new(truth_time() + late_s, Some(position))
}

fn model() -> MeasurementModel {
    MeasurementModel {
        errors: ErrorModel::TRACKING_NOISE_ONLY,
        ..MeasurementModel::default()
    }
}

fn solved(world: &World, prior: &Prior) -> SnapshotSolution {
    solve(
        &world.measurements,
        &world.store,
        prior,
        &model(),
        FALSE_ALARM,
    )
    .unwrap()
}

/// Errors within five times their own standard deviations.
fn assert_right(world: &World, found: &SnapshotSolution) {
    let solution = &found.solution;
    let error = (solution.position_ecef_m - world.receiver.position_ecef_m).norm();
    let sigma = solution
        .covariance_m2
        .fixed_view::<3, 3>(0, 0)
        .trace()
        .sqrt();
    assert!(error < 5.0 * sigma, "{error} m at {sigma} m");
    let late_s = solution.receive_time - truth_time();
    // Rounding to the code phases adds half a millisecond.
    assert!(late_s.abs() < 5.0 * found.time_sigma_s + 1e-3, "{late_s} s");
    let velocity = solution.velocity.unwrap();
    let miss = (velocity.velocity_ecef_mps - world.receiver.velocity_ecef_mps).norm();
    let sigma = velocity
        .covariance_m2_s2
        .fixed_view::<3, 3>(0, 0)
        .trace()
        .sqrt();
    assert!(miss < 5.0 * sigma, "{miss} m/s at {sigma} m/s");
}

#[test]
fn wrong_priors_give_the_same_answer() {
    for seed in 0..20 {
        let world = world(seed);
        let good = solved(&world, &prior(&world, seed, 0.0, 0.0));
        assert_right(&world, &good);
        for (away_m, late_s) in [(27e3, 15.0), (27e3, -15.0), (100e3, 60.0), (100e3, -60.0)] {
            let found = solved(&world, &prior(&world, seed, away_m, late_s));
            let apart = found.solution.position_ecef_m - good.solution.position_ecef_m;
            // The prior pulls by (10 m DOP / 100 km)^2 of its error.
            assert!(
                apart.norm() < 1.0,
                "{seed} {away_m} {late_s}: {}",
                apart.norm()
            );
            assert!((found.solution.receive_time - good.solution.receive_time).abs() < 2e-3);
        }
    }
}

#[test]
fn time_agrees_with_the_code_modulo_a_millisecond() {
    let world = world(3);
    let found = solved(&world, &prior(&world, 3, 10e3, 5.0));
    let off_ms = (found.solution.receive_time - truth_time()) * 1e3;
    // 1e-3 ms is 300 m, thirty times the noise.
    assert!((off_ms - off_ms.round()).abs() < 1e-3, "{off_ms}");
}

#[test]
fn wrong_satellites_are_taken_out() {
    for seed in 0..10 {
        let mut world = world(seed);
        // Two redundant satellites have to be left.
        let wrong = world.measurements.len().saturating_sub(7).min(2);
        let ids: Vec<SatelliteId> = world.measurements[..wrong]
            .iter()
            .map(|m| m.satellite)
            .collect();
        for (k, m) in world.measurements[..wrong].iter_mut().enumerate() {
            m.transmit_fraction_s = (m.transmit_fraction_s + 3.3e-4 * (1 + k) as f64) % 1e-3;
            m.doppler_hz += 900.0;
        }
        let found = solved(&world, &prior(&world, seed, 27e3, 15.0));
        assert_eq!(found.solution.excluded, ids, "seed {seed}");
        assert_right(&world, &found);
    }
}

#[test]
fn without_a_position_the_dopplers_find_it() {
    for seed in 0..10 {
        let world = world(seed);
        let mut prior = Prior::new(truth_time() + 1.0, None);
        prior.time_uncertainty_s = 5.0;
        assert_right(&world, &solved(&world, &prior));
    }
}

#[test]
fn five_satellites_suffice_near_the_truth() {
    let mut world = world(4);
    world.measurements.truncate(5);
    let found = solved(&world, &prior(&world, 4, 20e3, 10.0));
    assert_eq!(found.solution.consistency, Consistency::Untested);
    assert_right(&world, &found);
}

#[test]
fn what_cannot_be_solved_is_an_error() {
    let mut world = world(1);
    let prior = prior(&world, 1, 0.0, 0.0);
    let run = |m: &[SnapshotMeasurement], prior: &Prior| {
        solve(m, &world.store, prior, &model(), FALSE_ALARM)
    };
    let few = run(&world.measurements[..4], &prior);
    assert_eq!(
        few,
        Err(NavError::TooFew {
            found: 4,
            needed: 5
        })
    );
    let far = Prior {
        time: prior.time + 1e6,
        ..prior
    };
    assert!(matches!(
        run(&world.measurements, &far),
        Err(NavError::TooFew { .. })
    ));
    let never = Prior {
        time_uncertainty_s: f64::NAN,
        ..prior
    };
    assert!(matches!(
        run(&world.measurements, &never),
        Err(NavError::Value { .. })
    ));
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for m in &mut world.measurements {
        m.transmit_fraction_s = rng.random_range(0.0..1e-3);
    }
    let random = solve(
        &world.measurements,
        &world.store,
        &prior,
        &model(),
        FALSE_ALARM,
    );
    assert!(matches!(random, Err(NavError::NoFit { .. })), "{random:?}");
}

#[test]
fn the_elevation_mask_holds_whatever_it_leaves() {
    let world = world(3);
    let prior = prior(&world, 3, 10e3, 5.0);
    let masked_at = |elevation_mask_rad| {
        let model = MeasurementModel {
            elevation_mask_rad,
            ..model()
        };
        solve(
            &world.measurements,
            &world.store,
            &prior,
            &model,
            FALSE_ALARM,
        )
    };
    let all = masked_at(0.0).unwrap().solution;
    let mut elevations: Vec<f64> = all.satellites.iter().map(|s| s.elevation_rad).collect();
    elevations.sort_by(f64::total_cmp);
    assert!(elevations.len() > UNKNOWNS);
    // Half way between two satellites, of which five are above, and then four.
    let leaving = |count: usize| {
        let at = elevations.len() - count;
        0.5 * (elevations[at - 1] + elevations[at])
    };
    let five = masked_at(leaving(5)).unwrap().solution;
    assert_eq!(five.satellites.len(), 5);
    assert_eq!(five.masked.len(), elevations.len() - 5);
    let four = masked_at(leaving(4));
    assert!(
        matches!(
            four,
            Err(NavError::TooFew {
                found: 4,
                needed: 5
            })
        ),
        "{four:?}"
    );
}

#[test]
fn the_right_milliseconds_pass_the_screen_and_one_wrong_does_not() {
    for seed in 0..10 {
        let world = world(seed);
        let prior = prior(&world, seed, 150e3, -55.0);
        let (channels, _) = usable(&world.measurements, &world.store, &prior);
        let anchor = anchor::from_prior(&prior, &channels).unwrap();
        let mut ranged: Vec<fit::Ranged> = channels
            .iter()
            .map(|&channel| {
                let expected = predict(channel.ephemeris, &world.receiver).unwrap();
                let pseudorange_m = SPEED_OF_LIGHT_MPS * (truth_time() - expected.transmit_time);
                let milliseconds = (pseudorange_m + channel.fraction_m) / CA_PERIOD_M;
                fit::Ranged {
                    channel,
                    milliseconds: milliseconds.round() as i64,
                }
            })
            .collect();
        let start = (anchor.position_ecef_m, anchor.time);
        let screen = |ranged: &[_]| screen::Screen::new(ranged, &anchor, &model(), start, 2.0);
        assert!(screen(&ranged).lets_pass(&[]), "seed {seed}");
        ranged[2].milliseconds += 1;
        let wrong = screen(&ranged);
        assert!(!wrong.lets_pass(&[]), "seed {seed}");
        assert!(wrong.lets_pass(&[2]), "seed {seed}");
    }
}
