//! The linearised measurements against numerical derivatives, with all delays modelled.

use rand::SeedableRng;

use super::super::NavFilter;
use super::*;
use crate::Klobuchar;
use crate::filter::{Innovations, SequentialFilter};
use crate::made_up_sky::{constellation, measure, receiver};

const KLOBUCHAR: Klobuchar = Klobuchar {
    alpha: [1.77e-8, -7.451e-9, -5.96e-8, 1.192e-7],
    beta: [131_100.0, -131_100.0, 65_540.0, -262_100.0],
};

/// Through empty space, and through both delays.
fn both_models() -> [FilterSettings; 2] {
    let mut delayed = ungated();
    delayed.model.troposphere = true;
    delayed.model.ionosphere = Some(KLOBUCHAR);
    [ungated(), delayed]
}

/// Innovations of a filter displaced by `step` in state `index`.
fn innovations(settings: &FilterSettings, index: usize, step: f64) -> Innovations {
    let store = constellation(&mut ChaCha8Rng::seed_from_u64(1));
    let measurements = measure(&store, &receiver(), &settings.model);
    let mut error = States::zeros();
    error[index] = step;
    let filter: SequentialFilter = start(displaced(&receiver(), &error), *settings);
    filter.innovations(&measurements).unwrap()
}

#[test]
fn a_filter_that_knows_all_expects_what_is_measured() {
    // Steps of a 2.5e7 m pseudorange (4 nm); and what the satellite moves during the delay, which
    // the prediction leaves out: 30 m / c times 1 km/s.
    for (settings, allowed_m) in both_models().iter().zip([1e-7, 1e-4]) {
        let innovations = innovations(settings, 0, 0.0);
        assert!(innovations.satellites().len() >= 6);
        for one in innovations.satellites() {
            assert!(one.code.value().abs() < allowed_m, "{one:?}");
            // What the satellite accelerates during the delay, and rounding of 1 km/s.
            assert!(one.rate.unwrap().value().abs() < 1e-7, "{one:?}");
        }
    }
}

#[test]
fn rows_are_the_derivatives_of_the_measurements() {
    // The turning frame, 6e-6; and the troposphere's thinning with height, 3e-4 over the sine of
    // the elevation, at 10 degrees and more. Both are left out.
    for (settings, allowed) in both_models().iter().zip([1e-5, 2e-3]) {
        for index in 0..STATES {
            assert_derivatives(settings, index, allowed);
        }
    }
}

fn assert_derivatives(settings: &FilterSettings, index: usize, allowed: f64) {
    let step = 10.0;
    let (at, ahead, behind) = (
        innovations(settings, index, 0.0),
        innovations(settings, index, step),
        innovations(settings, index, -step),
    );
    for (k, one) in at.satellites.iter().enumerate() {
        let (a, b) = (&ahead.satellites[k], &behind.satellites[k]);
        let code = (b.code.value() - a.code.value()) / (2.0 * step);
        let difference = (code - one.code.row().element(index)).abs();
        assert!(difference < allowed, "code by {index}: {difference}");
        let (a, b, row) = (a.rate.unwrap(), b.rate.unwrap(), one.rate.unwrap());
        let rate = (b.value() - a.value()) / (2.0 * step);
        let difference = (rate - row.row().element(index)).abs();
        // By position the turn of the line of sight, left out; else rounding of 1 km/s over 20.
        let allowed = if index.is_multiple_of(2) { 2e-4 } else { 1e-10 };
        assert!(difference < allowed, "rate by {index}: {difference}");
    }
}
