//! Batch, sequential and reference give the same, in any order.

use proptest::prelude::*;
use rand::SeedableRng;
use rand::seq::SliceRandom;

use super::super::batch::Batch;
use super::super::correction::{Correct, Corrected};
use super::super::covariance;
use super::super::sequential::Sequential;
use super::*;
use crate::dynamics::{AccelerationNoise, ProcessNoise};

fn batch(p: &Covariance, rows: &[Row]) -> Corrected {
    Batch::correct(p, rows.iter().copied()).unwrap()
}

fn sequential(p: &Covariance, rows: &[Row]) -> Corrected {
    Sequential::correct(p, rows.iter().copied()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_two_ways_and_the_reference_agree(seed in any::<u64>(), satellites in 1usize..33) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let rows = random_rows(satellites, &mut rng);
        let (x, after) = reference::update_rows(&p, &rows);
        let (b, s) = (batch(&p, &rows), sequential(&p, &rows));
        for corrected in [b, s] {
            // What must hold; rounding leaves about 1e-12.
            prop_assert!(state_difference(&corrected.error, &x, &after) < 1e-9);
            prop_assert!(covariance_difference(&corrected.covariance, &after) < 1e-9);
        }
        prop_assert!((b.normalised_squared / s.normalised_squared - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_order_does_not_matter(seed in any::<u64>(), satellites in 2usize..33) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let mut rows = random_rows(satellites, &mut rng);
        let straight = sequential(&p, &rows);
        rows.shuffle(&mut rng);
        let shuffled = sequential(&p, &rows);
        // What must hold; 64 updates of values near 1 round to a few 1e-15 each.
        let after = &straight.covariance;
        prop_assert!(state_difference(&shuffled.error, &straight.error, after) < 1e-12);
        prop_assert!(covariance_difference(&shuffled.covariance, after) < 1e-12);
    }

    #[test]
    fn the_prediction_is_that_of_the_reference(seed in any::<u64>(), t in 0.0..10.0f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let noise = ProcessNoise {
            acceleration: AccelerationNoise::isotropic(rng.random_range(0.0..100.0)),
            ..ProcessNoise::default()
        };
        let position = made_up_sky::receiver().position_ecef_m;
        let ours = covariance::propagated(&p, t, &noise, &position);
        let dense = reference::predict(&p, t, &noise);
        // A few roundings of each element.
        prop_assert!(covariance_difference(&ours, &dense) < 1e-14);
    }

    #[test]
    fn symmetry_is_kept_to_the_last_bit(seed in any::<u64>()) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let p = (p + p.transpose()) * 0.5;
        let noise = ProcessNoise {
            acceleration: AccelerationNoise { horizontal_m2_per_s3: 3.0, vertical_m2_per_s3: 0.7 },
            ..ProcessNoise::default()
        };
        let position = made_up_sky::receiver().position_ecef_m;
        let p = covariance::propagated(&p, 0.37, &noise, &position);
        let after = sequential(&p, &random_rows(5, &mut rng)).covariance;
        prop_assert_eq!(p, p.transpose());
        prop_assert_eq!(after, after.transpose());
    }
}

#[test]
fn no_measurement_changes_nothing() {
    let p = settled();
    for corrected in [batch(&p, &[]), sequential(&p, &[])] {
        assert_eq!(corrected, Corrected::prior(&p));
    }
}
