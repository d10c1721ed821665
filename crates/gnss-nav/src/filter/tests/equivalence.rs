//! Batch, sequential and reference give the same, in any order.

use proptest::prelude::*;
use rand::SeedableRng;
use rand::seq::SliceRandom;

use super::super::batch::Batch;
use super::super::sequential::Sequential;
use super::*;
use crate::Geodetic;
use crate::dynamics::{AccelerationNoise, ProcessNoise};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_two_ways_and_the_reference_agree(seed in any::<u64>(), satellites in 1usize..33) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let rows = random_rows(satellites, &mut rng);
        let (x, after) = reference::update_rows(&p, &rows);
        let (batch, sequential) = (correct::<Batch>(&p, &rows), correct::<Sequential>(&p, &rows));
        for (error, covariance, _) in [batch, sequential] {
            // What must hold; rounding leaves about 1e-12.
            prop_assert!(state_difference(&error, &x, &after) < 1e-9);
            prop_assert!(covariance_difference(&covariance, &after) < 1e-9);
        }
        prop_assert!((batch.2 / sequential.2 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_order_does_not_matter(seed in any::<u64>(), satellites in 2usize..33) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let mut rows = random_rows(satellites, &mut rng);
        let (straight, after, _) = correct::<Sequential>(&p, &rows);
        rows.shuffle(&mut rng);
        let (shuffled, also, _) = correct::<Sequential>(&p, &rows);
        // What must hold; 64 updates of values near 1 round to a few 1e-15 each.
        prop_assert!(state_difference(&shuffled, &straight, &after) < 1e-12);
        prop_assert!(covariance_difference(&also, &after) < 1e-12);
    }

    #[test]
    fn the_prediction_is_that_of_the_reference(seed in any::<u64>(), t in 0.0..10.0f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let noise = ProcessNoise {
            acceleration: AccelerationNoise {
                horizontal_m2_per_s3: rng.random_range(0.0..100.0),
                vertical_m2_per_s3: rng.random_range(0.0..100.0),
            },
            ..ProcessNoise::default()
        };
        // On the ellipsoid, where its normal is the vertical.
        let position = Geodetic::from_degrees(48.1, 11.6, 0.0).to_ecef();
        let ours = Blocks::from_interleaved(&p).propagated(t, &noise, &position).interleaved();
        let dense = reference::predict(&p, t, &noise, &position);
        // Rounding of the rotation and of each element.
        prop_assert!(covariance_difference(&ours, &dense) < 1e-12);
    }

    #[test]
    fn symmetry_is_kept_to_the_last_bit(seed in any::<u64>()) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let p = random_covariance(&mut rng);
        let noise = ProcessNoise {
            acceleration: AccelerationNoise { horizontal_m2_per_s3: 3.0, vertical_m2_per_s3: 0.7 },
            ..ProcessNoise::default()
        };
        let position = made_up_sky::receiver().position_ecef_m;
        let p = Blocks::from_interleaved(&p).propagated(0.37, &noise, &position).interleaved();
        let (_, after, _) = correct::<Sequential>(&p, &random_rows(5, &mut rng));
        prop_assert_eq!(p, p.transpose());
        prop_assert_eq!(after, after.transpose());
    }
}

#[test]
fn no_measurement_changes_nothing() {
    let nothing = (States::zeros(), settled(), 0.0);
    assert_eq!(correct::<Batch>(&settled(), &[]), nothing);
    assert_eq!(correct::<Sequential>(&settled(), &[]), nothing);
}
