//! Innovations given those of the other satellites, against the filter that has heard only those.

use rand::SeedableRng;

use super::super::NavFilter;
use super::*;
use crate::filter::{Disposition, SequentialFilter};
use crate::made_up_sky::{constellation, measure, receiver};
use crate::{Measurement, SatelliteId};

fn measurements() -> Vec<Measurement> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let store = constellation(&mut rng);
    let mut all = measure(&store, &receiver(), &ungated().model);
    for m in &mut all {
        m.pseudorange_m += m.pseudorange_variance_m2.sqrt() * normal(&mut rng);
        m.range_rate_mps += m.range_rate_variance_m2_s2.sqrt() * normal(&mut rng);
    }
    all
}

/// Code and rate innovation, and their variances, of `satellite` once only `others` were taken in.
fn after_others(all: &[Measurement], satellite: SatelliteId, left_out: &[SatelliteId]) -> [f64; 4] {
    let mut filter: SequentialFilter = start(receiver(), ungated());
    let innovations = filter.innovations(all).unwrap();
    let excluded: Vec<_> = left_out
        .iter()
        .map(|s| (*s, Disposition::Exclude))
        .collect();
    filter.update(&innovations, &excluded).unwrap();
    let again = filter.innovations(all).unwrap();
    let own = again
        .satellites()
        .iter()
        .find(|s| s.satellite == satellite)
        .unwrap();
    let rate = own.rate.unwrap();
    [
        own.code.value(),
        own.code.variance(),
        rate.value(),
        rate.variance(),
    ]
}

#[test]
fn they_are_those_of_a_filter_that_has_heard_the_others() {
    let all = measurements();
    let filter: SequentialFilter = start(receiver(), ungated());
    let innovations = filter.innovations(&all).unwrap();
    let distrusted = all[2].satellite;
    let given = innovations
        .given_others(&filter.covariance(), |s| s != distrusted)
        .unwrap();
    assert_eq!(given.len(), all.len());
    for found in given {
        let mut left_out = vec![distrusted, found.satellite];
        left_out.dedup();
        let expected = after_others(&all, found.satellite, &left_out);
        let rate = found.rate.unwrap();
        let found = [
            found.code.value,
            found.code.variance,
            rate.value,
            rate.variance,
        ];
        // The state moves by a metre or two: ranges of 2e7 m bend by 1e-6 m, and round to 4e-9 m; range rates
        // depend on the position by 2e-4 1/s, which their rows leave out.
        let tolerances = [1e-4, 1e-4, 5e-4, 1e-4];
        for ((found, expected), tolerance) in found.iter().zip(expected).zip(tolerances) {
            assert!((found - expected).abs() < tolerance, "{found} {expected}");
        }
    }
}

#[test]
fn what_is_common_to_all_is_no_deviation() {
    let mut all = measurements();
    let filter: SequentialFilter = start(receiver(), ungated());
    let deviations = |all: &[Measurement]| {
        let innovations = filter.innovations(all).unwrap();
        let mut covariance = filter.covariance();
        // Nothing is known of the clock.
        (covariance[(6, 6)], covariance[(7, 7)]) = (1e12, 1e12);
        innovations.given_others(&covariance, |_| true).unwrap()
    };
    let before = deviations(&all);
    for m in &mut all {
        m.pseudorange_m += 300.0;
        m.range_rate_mps += 5.0;
    }
    for (before, after) in before.iter().zip(deviations(&all)) {
        // Of 1e12, in double precision.
        assert!((before.code.value - after.code.value).abs() < 1e-2);
        let rates = [before.rate, after.rate].map(|r| r.unwrap().value);
        assert!((rates[0] - rates[1]).abs() < 1e-2);
    }
}
