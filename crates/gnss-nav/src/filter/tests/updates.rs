//! Epochs of a filter: what it uses, skips and learns.

use rand::SeedableRng;
use rand::seq::SliceRandom;

use super::super::NavFilter;
use super::*;
use crate::filter::{BatchFilter, Disposition, SequentialFilter, SkipReason, Skipped};
use crate::made_up_sky::{constellation, measure, receiver};
use crate::{Measurement, SatelliteId, least_squares};

fn gated(sigmas: f64) -> FilterSettings {
    FilterSettings {
        gate: Gate::Sigmas(sigmas),
        ..ungated()
    }
}

fn exact() -> Vec<Measurement> {
    let store = constellation(&mut ChaCha8Rng::seed_from_u64(1));
    measure(&store, &receiver(), &ungated().model)
}

fn noisy(seed: u64) -> Vec<Measurement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut measurements = exact();
    for m in &mut measurements {
        m.pseudorange_m += m.pseudorange_variance_m2.sqrt() * normal(&mut rng);
        m.range_rate_mps += m.range_rate_variance_m2_s2.sqrt() * normal(&mut rng);
    }
    measurements
}

/// A filter wrong by a draw of its covariance.
fn wrong<Way>(settings: FilterSettings) -> Ekf<Way> {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    start(
        displaced(&receiver(), &draw(&settled(), &mut rng)),
        settings,
    )
}

fn updated<Way: Correct>(
    mut filter: Ekf<Way>,
    measurements: &[Measurement],
    dispositions: &[(SatelliteId, Disposition)],
) -> (Ekf<Way>, crate::filter::Update) {
    let innovations = filter.innovations(measurements).unwrap();
    let update = filter.update(&innovations, dispositions).unwrap();
    (filter, update)
}

/// Both halves of what was skipped of `satellite`.
fn both(satellite: SatelliteId, reason: SkipReason) -> [Skipped; 2] {
    [Observable::Pseudorange, Observable::RangeRate].map(|observable| Skipped {
        satellite,
        observable,
        reason,
    })
}

#[test]
fn exact_measurements_bring_a_wrong_filter_to_the_truth() {
    let mut measurements = exact();
    for m in &mut measurements {
        (m.pseudorange_variance_m2, m.range_rate_variance_m2_s2) = (1e-6, 1e-8);
    }
    let (filter, update) = updated(
        wrong::<super::super::Sequential>(ungated()),
        &measurements,
        &[],
    );
    assert_eq!(update.used, 2 * measurements.len());
    let away = filter.state().position_ecef_m - receiver().position_ecef_m;
    // Noise of 1 mm; the neglected terms of 5 m squared over the range are below.
    assert!(away.norm() < 5e-3, "{away}");
    let away = filter.state().velocity_ecef_mps - receiver().velocity_ecef_mps;
    // Noise of 0.1 mm/s; the turn of the line of sight over 5 m, 1 mm/s.
    assert!(away.norm() < 5e-3, "{away}");
}

#[test]
fn both_filters_agree_epoch_after_epoch() {
    let mut batch: BatchFilter = wrong(gated(4.0));
    let mut sequential: SequentialFilter = wrong(gated(4.0));
    for seed in 0..20 {
        let mut measurements = noisy(seed);
        measurements[3].pseudorange_m += 200.0;
        let (b, of_batch) = updated(batch, &measurements, &[]);
        let (s, of_sequential) = updated(sequential, &measurements, &[]);
        assert_eq!(of_batch.skipped, of_sequential.skipped);
        assert!(!of_batch.skipped.is_empty());
        (batch, sequential) = (b, s);
        let away = batch.state().position_ecef_m - sequential.state().position_ecef_m;
        // Coordinates of 4e6 m step by 5e-10 m.
        assert!(away.norm() < 1e-8, "{away}");
        assert!(covariance_difference(&batch.covariance(), &sequential.covariance()) < 1e-9);
    }
}

#[test]
fn the_gate_skips_the_wrong_measurement_alone_whatever_the_order() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut measurements = exact();
    let (bad_code, bad_rate) = (measurements[1].satellite, measurements[4].satellite);
    measurements[1].pseudorange_m += 500.0;
    measurements[4].range_rate_mps -= 30.0;
    for _ in 0..20 {
        measurements.shuffle(&mut rng);
        let (_, update) = updated(
            wrong::<super::super::Sequential>(gated(4.0)),
            &measurements,
            &[],
        );
        let mut skipped = update.skipped;
        skipped.sort_by_key(|s| s.observable);
        let expected = [
            (bad_code, Observable::Pseudorange),
            (bad_rate, Observable::RangeRate),
        ];
        let expected = expected.map(|(satellite, observable)| Skipped {
            satellite,
            observable,
            reason: SkipReason::Gate,
        });
        assert_eq!(skipped, expected);
        assert_eq!(update.used, 2 * measurements.len() - 2);
    }
}

#[test]
fn dispositions_are_obeyed() {
    let measurements = noisy(1);
    let (first, second) = (measurements[0].satellite, measurements[1].satellite);
    let filter: SequentialFilter = wrong(ungated());
    let excluded = [(first, Disposition::Exclude)];
    let (without, update) = updated(filter.clone(), &measurements, &excluded);
    assert_eq!(update.skipped, both(first, SkipReason::Excluded));
    let (same, _) = updated(filter.clone(), &measurements[1..], &[]);
    assert_eq!(without.state(), same.state());

    let factor = Disposition::Deweight {
        variance_factor: 9.0,
    };
    let (deweighted, update) = updated(filter.clone(), &measurements, &[(second, factor)]);
    assert_eq!(update.skipped, []);
    let mut weaker = measurements.clone();
    weaker[1].pseudorange_variance_m2 *= 9.0;
    weaker[1].range_rate_variance_m2_s2 *= 9.0;
    let (same, _) = updated(filter, &weaker, &[]);
    assert_eq!(deweighted.state(), same.state());
    assert_eq!(deweighted.covariance(), same.covariance());
}

#[test]
fn what_is_not_measured_is_not_used() {
    let mut measurements = exact();
    measurements[2].range_rate_variance_m2_s2 = f64::INFINITY;
    measurements[2].range_rate_mps = f64::NAN;
    let mut settings = ungated();
    settings.model.elevation_mask_rad = 30f64.to_radians();
    let filter: SequentialFilter = wrong(settings);
    let innovations = filter.innovations(&measurements).unwrap();
    assert_eq!(innovations.satellites()[2].rate, None);
    let low = innovations
        .satellites()
        .iter()
        .filter(|s| s.look.elevation_rad < settings.model.elevation_mask_rad);
    let expected: Vec<Skipped> = low
        .flat_map(|s| both(s.satellite, SkipReason::BelowMask))
        .filter(|s| {
            s.satellite != measurements[2].satellite || s.observable == Observable::Pseudorange
        })
        .collect();
    let (_, update) = updated(filter, &measurements, &[]);
    assert!(!expected.is_empty());
    assert_eq!(update.skipped, expected);
}

#[test]
fn innovations_carry_their_variances() {
    let filter: SequentialFilter = wrong(ungated());
    let measurements = noisy(3);
    let innovations = filter.innovations(&measurements).unwrap();
    for (one, m) in innovations.satellites().iter().zip(&measurements) {
        assert_eq!(one.code.noise_variance(), m.pseudorange_variance_m2);
        // 25 m^2 along every line of sight, and the clock's.
        let expected = 50.0 + m.pseudorange_variance_m2;
        assert!((one.code.variance() / expected - 1.0).abs() < 1e-12);
        let nis = one.code.value().powi(2) / one.code.variance();
        assert_eq!(one.code.normalised_squared(), nis);
    }
}

#[test]
fn least_squares_starts_a_filter() {
    let measurements = noisy(4);
    let fix =
        least_squares::solve(&measurements, &ungated().model, &nalgebra::Vector3::zeros()).unwrap();
    let filter = SequentialFilter::from_solution(&fix, ungated()).unwrap();
    assert_eq!(filter.state().position_ecef_m, fix.position_ecef_m);
    assert!((filter.state().time - receiver().time).abs() < 1e-6);
    assert_eq!(filter.covariance()[(4, 4)], fix.covariance_m2[(2, 2)]);
    assert_eq!(filter.covariance()[(6, 0)], fix.covariance_m2[(3, 0)]);
    let velocity = fix.velocity.unwrap();
    assert_eq!(
        filter.covariance()[(7, 7)],
        velocity.covariance_m2_s2[(3, 3)]
    );

    let without = crate::Solution {
        velocity: None,
        ..fix
    };
    let filter = SequentialFilter::from_solution(&without, ungated()).unwrap();
    let (filter, _) = updated(filter, &measurements, &[]);
    let away = filter.state().velocity_ecef_mps - receiver().velocity_ecef_mps;
    // Deviation 0.06 m/s times a dilution of about 2, three times that.
    assert!(away.norm() < 0.4, "{away}");
}

#[test]
fn the_covariance_grows_over_a_gap() {
    let mut filter: SequentialFilter = wrong(ungated());
    let before = filter.covariance()[(0, 0)];
    let there = filter.state().time + 2.0;
    filter.predict(there).unwrap();
    assert_eq!(filter.state().time, there);
    // P + T^2 P_v + q T^3 / 3.
    let expected = before + 4.0 * 0.25 + 8.0 / 3.0;
    assert!((filter.covariance()[(0, 0)] - expected).abs() < 1e-12);
    let (filter, update) = updated(filter, &[], &[]);
    assert_eq!(update.used, 0);
    assert_eq!(filter.state().time, there);
}
