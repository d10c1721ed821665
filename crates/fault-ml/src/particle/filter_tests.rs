//! One filter against the Kalman filter, which is exact where noise is normal.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::filter::{Epoch, Filter, Outcome};
use super::*;
use crate::classical::{KalmanFilter, KalmanParameters};
use crate::test_sky::{designs, sights};
use crate::{STATES, Sight};

/// Residuals of an ordinary epoch, m.
fn ordinary() -> Vec<Sight> {
    sights(&designs(), |id| {
        [2.0, -1.0, 3.5, 0.5, -2.5, 1.0, -4.0, 0.0, 1.5][id as usize]
    })
}

fn one_step(parameters: ParticleParameters, left_out: Option<usize>, seed: u64) -> Outcome {
    let parameters = parameters.check().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut filter = Filter::new(&parameters, &mut random);
    let epoch = Epoch {
        sights: &ordinary(),
        left_out,
        elapsed_s: 1.0,
    };
    filter.step(epoch, &parameters, None, &mut random)
}

/// ln p(y) and state of the Kalman filter after the same epoch.
fn exact(left_out: Option<usize>) -> (f64, [f64; STATES]) {
    let mut filter = KalmanFilter::new(&KalmanParameters::default());
    let sights = ordinary();
    let used = sights
        .iter()
        .enumerate()
        .filter(|(s, _)| Some(*s) != left_out);
    let (log, _) = filter.epoch(used.map(|(_, sight)| sight));
    (log, filter.state_m())
}

/// Largest distance of a coordinate from the exact one, m.
fn apart_m(found: &[f64; STATES], exact: &[f64; STATES]) -> f64 {
    found
        .iter()
        .zip(exact)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

#[test]
fn many_particles_come_to_the_kalman_filter() {
    for left_out in [None, Some(4)] {
        let (log, state) = exact(left_out);
        for clock in [ClockState::Sampled, ClockState::Marginalised] {
            let parameters = ParticleParameters {
                particles: 10_000,
                clock,
                ..ParticleParameters::default()
            };
            let found = one_step(parameters, left_out, 3);
            // Posterior deviations of 2 m at most over sqrt(N_eff > 400): 0.1 m; three of them.
            // The logarithm of the mean scatters by 1/sqrt(N_eff) = 0.05.
            assert!(
                apart_m(&found.estimate_m, &state) < 0.3,
                "{found:?} {state:?}"
            );
            assert!((found.log_evidence - log).abs() < 0.15, "{found:?} {log}");
        }
    }
}

#[test]
fn integrating_the_clock_out_leaves_more_particles() {
    let mean = |clock| {
        let parameters = ParticleParameters {
            clock,
            ..ParticleParameters::default()
        };
        (0..40)
            .map(|seed| one_step(parameters, None, seed).effective)
            .sum::<f64>()
            / 40.0
    };
    // One coordinate less to hit with the same fifty particles.
    assert!(mean(ClockState::Marginalised) > 1.3 * mean(ClockState::Sampled));
}

#[test]
fn a_corrected_swarm_keeps_the_posterior_and_an_uncorrected_one_does_not() {
    let (_, state) = exact(None);
    let mean_error = |order| {
        let settings = SwarmSettings {
            order,
            ..SwarmSettings::default()
        };
        let parameters = ParticleParameters::wang2016(Movement::Swarm(settings));
        let outcomes = (0..40).map(|seed| one_step(parameters, None, seed));
        let outcomes: Vec<_> = outcomes.collect();
        let effective = outcomes.iter().map(|o| o.effective).sum::<f64>() / 40.0;
        let apart = outcomes.iter().map(|o| apart_m(&o.estimate_m, &state));
        (apart.sum::<f64>() / 40.0, effective)
    };
    let (corrected_m, corrected_effective) = mean_error(SwarmOrder::Corrected);
    // Deviations of 2 m over sqrt(50): the largest of four is 0.4 m on average; the prior is the
    // cloud's, whose mean scatters by 3 / sqrt(50).
    assert!(corrected_m < 0.6, "{corrected_m}");
    assert!(corrected_effective > 40.0, "{corrected_effective}");
    // The other goes to the least-squares point, without the prior of 3 m.
    let least_squares = crate::classical::LeastSquaresFit::new(&ordinary()).unwrap();
    assert!(apart_m(&least_squares.state_m, &state) > 0.5);
    let (moved_m, _) = mean_error(SwarmOrder::MoveThenWeigh);
    assert!(moved_m > 1.2 * corrected_m, "{moved_m} {corrected_m}");
}
