//! Statistics: the covariance is that of the error, and stays one.

use nalgebra::Cholesky;
use rand::SeedableRng;

use super::super::batch::Batch;
use super::super::sequential::Sequential;
use super::*;
use crate::chi_square_threshold;

const SEEDS: usize = 100;
const EPOCHS: usize = 60;

/// Sums over `seeds` runs of NEES and NIS, epoch by epoch.
fn sums<Way: Correct>(satellites: usize, seeds: usize) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); EPOCHS];
    for seed in 0..seeds {
        let run = run::<Way>(satellites, seed as u64);
        for (sum, (nees, nis)) in sums.iter_mut().zip(run) {
            *sum = (sum.0 + nees, sum.1 + nis);
        }
    }
    sums
}

/// Whether `value` lies within the central `probability` of chi-square with `freedom` degrees.
fn is_within(value: f64, freedom: usize, probability: f64) -> bool {
    let tail = (1.0 - probability) / 2.0;
    let low = chi_square_threshold(freedom, 1.0 - tail).unwrap();
    let high = chi_square_threshold(freedom, tail).unwrap();
    (low..high).contains(&value)
}

/// NEES and NIS of every epoch of a linear system driven by exactly the noises assumed.
fn run<Way: Correct>(satellites: usize, seed: u64) -> Vec<(f64, f64)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (interval_s, noise) = (0.1, ungated().process_noise);
    let position = made_up_sky::receiver().position_ecef_m;
    let q = reference::noise(interval_s, &noise, &position);
    let mut p = settled();
    // Error of the estimate: estimate minus truth.
    let mut error = draw(&p, &mut rng);
    (0..EPOCHS)
        .map(|_| {
            error = reference::carry(&error, interval_s) - draw(&q, &mut rng);
            p = Blocks::from_interleaved(&p)
                .propagated(interval_s, &noise, &position)
                .interleaved();
            let rows = measured(random_rows(satellites, &mut rng), &error, &mut rng);
            let (correction, after, nis) = correct::<Way>(&p, &rows);
            error += correction;
            p = after;
            (error.dot(&Cholesky::new(p).unwrap().solve(&error)), nis)
        })
        .collect()
}

/// `rows` with the residuals an estimate wrong by `error` leaves.
fn measured(mut rows: Vec<Row>, error: &States, rng: &mut ChaCha8Rng) -> Vec<Row> {
    for row in &mut rows {
        row.residual = row.variance.sqrt() * normal(rng) - dense(row).dot(error);
    }
    rows
}

fn assert_consistent<Way: Correct>(satellites: usize) {
    let sums = sums::<Way>(satellites, SEEDS);
    let nees = sums
        .iter()
        .filter(|s| is_within(s.0, 8 * SEEDS, 0.95))
        .count();
    let freedom = 2 * satellites * SEEDS;
    let nis = sums
        .iter()
        .filter(|s| is_within(s.1, freedom, 0.95))
        .count();
    // 95 % expected; 90 % leaves room for epochs that are not independent.
    assert!(
        10 * nees >= 9 * EPOCHS && 10 * nis >= 9 * EPOCHS,
        "{nees} {nis}"
    );
}

#[test]
fn nees_and_nis_are_those_of_a_consistent_filter() {
    assert_consistent::<Sequential>(7);
    assert_consistent::<Batch>(7);
}

#[test]
fn three_satellites_leave_an_honest_covariance() {
    // What is not observed stays as it was from epoch to epoch, so that epochs are no sample of
    // anything: one of them over more seeds is.
    let seeds = 6 * SEEDS;
    let (nees, nis) = sums::<Sequential>(3, seeds)[EPOCHS - 1];
    assert!(
        is_within(nees, 8 * seeds, 0.99),
        "{}",
        nees / (8 * seeds) as f64
    );
    assert!(
        is_within(nis, 6 * seeds, 0.99),
        "{}",
        nis / (6 * seeds) as f64
    );
}

#[test]
fn the_covariance_stays_positive_definite_over_a_million_updates() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let noise = ungated().process_noise;
    let position = made_up_sky::receiver().position_ecef_m;
    let epochs: Vec<Vec<Row>> = (0..64).map(|_| random_rows(8, &mut rng)).collect();
    let prior = Blocks::from_interleaved(&(Covariance::identity() * 1e10));
    let mut corrected = Corrected::prior(&prior);
    // 16 scalar updates an epoch.
    for epoch in 0..62_500 {
        let p = corrected.covariance.propagated(0.02, &noise, &position);
        let rows = epochs[epoch % epochs.len()].iter().copied();
        corrected = Sequential::correct(&p, rows).unwrap();
        if epoch % 500 == 0 {
            let p = corrected.covariance.interleaved();
            assert_eq!(p, p.transpose(), "epoch {epoch}");
            assert!(Cholesky::new(p).is_some(), "epoch {epoch}: {p}");
        }
    }
    assert!(corrected.is_finite());
}
