//! What a filter refuses, it refuses without a trace.

use rand::SeedableRng;

use super::super::NavFilter;
use super::*;
use crate::filter::{BatchFilter, Disposition, SequentialFilter};
use crate::made_up_sky::{constellation, measure, receiver};
use crate::{Measurement, NavError};

fn measurements() -> Vec<Measurement> {
    let store = constellation(&mut ChaCha8Rng::seed_from_u64(1));
    measure(&store, &receiver(), &ungated().model)
}

/// Runs `attempt` on both filters; it must fail and change nothing.
fn refused(attempt: impl Fn(&mut dyn NavFilter) -> Result<(), NavError>) -> NavError {
    let mut sequential: SequentialFilter = start(receiver(), ungated());
    let mut batch: BatchFilter = start(receiver(), ungated());
    let filters: [&mut dyn NavFilter; 2] = [&mut sequential, &mut batch];
    let errors = filters.map(|filter| {
        let error = attempt(filter).unwrap_err();
        assert_eq!(*filter.state(), receiver());
        assert_eq!(filter.covariance(), settled());
        error
    });
    errors.into_iter().next().unwrap()
}

#[test]
fn values_that_are_not_finite() {
    let spoil: [fn(&mut Measurement); 6] = [
        |m| m.pseudorange_m = f64::NAN,
        |m| m.range_rate_mps = f64::INFINITY,
        |m| m.pseudorange_variance_m2 = f64::INFINITY,
        |m| m.range_rate_variance_m2_s2 = f64::NAN,
        |m| m.pseudorange_variance_m2 = 0.0,
        |m| m.state.position_ecef_m.x = f64::NAN,
    ];
    for spoil in spoil {
        let mut measurements = measurements();
        spoil(&mut measurements[2]);
        let satellite = measurements[2].satellite;
        let error = refused(|filter| filter.innovations(&measurements).map(|_| ()));
        assert!(
            matches!(error, NavError::Measurement { satellite: named, .. } if named == satellite),
            "{error}"
        );
    }
}

#[test]
fn residuals_that_overflow() {
    let mut measurements = measurements();
    for m in &mut measurements {
        m.pseudorange_m = 1e308;
    }
    let error = refused(|filter| {
        let innovations = filter.innovations(&measurements)?;
        filter.update(&innovations, &[]).map(|_| ())
    });
    assert_eq!(error, NavError::Singular);
}

#[test]
fn times_that_cannot_be_predicted_to() {
    for step_s in [-1e-3, f64::NEG_INFINITY] {
        let error = refused(|filter| filter.predict(receiver().time + step_s));
        assert!(matches!(error, NavError::Value { .. }), "{error}");
    }
}

#[test]
fn measurements_of_another_epoch() {
    let mut late = measurements();
    late[0].receive_time = late[0].receive_time + 0.02;
    let error = refused(|filter| filter.innovations(&late).map(|_| ()));
    assert!(error.to_string().contains("predict to the epoch first"));
}

#[test]
fn innovations_of_another_state() {
    let error = refused(|filter| {
        let mut elsewhere = receiver();
        elsewhere.clock_bias_m += 1.0;
        let other: SequentialFilter = start(elsewhere, ungated());
        let innovations = other.innovations(&measurements())?;
        filter.update(&innovations, &[]).map(|_| ())
    });
    assert_eq!(error, NavError::StaleInnovations);
    let mut filter: SequentialFilter = start(receiver(), ungated());
    let mut measurements = measurements();
    measurements[0].pseudorange_m += 1.0;
    let innovations = filter.innovations(&measurements).unwrap();
    filter.update(&innovations, &[]).unwrap();
    let twice = filter.update(&innovations, &[]);
    assert_eq!(twice.unwrap_err(), NavError::StaleInnovations);
}

#[test]
fn factors_that_are_none() {
    let measurements = measurements();
    for variance_factor in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let list = [(
            measurements[0].satellite,
            Disposition::Deweight { variance_factor },
        )];
        let error = refused(|filter| {
            let innovations = filter.innovations(&measurements)?;
            filter.update(&innovations, &list).map(|_| ())
        });
        assert!(error.to_string().starts_with("variance factor"));
    }
}

#[test]
fn starts_that_are_none() {
    let new = |state, covariance, settings| {
        SequentialFilter::new(state, covariance, settings).unwrap_err()
    };
    let mut lost = receiver();
    lost.clock_drift_mps = f64::NAN;
    assert!(matches!(
        new(lost, settled(), ungated()),
        NavError::Value { .. }
    ));
    let mut asymmetric = settled();
    asymmetric[(0, 1)] = 0.1;
    let mut indefinite = settled();
    indefinite[(3, 3)] = -1.0;
    for covariance in [
        asymmetric,
        indefinite,
        Covariance::zeros(),
        settled() * f64::NAN,
    ] {
        assert_eq!(new(receiver(), covariance, ungated()), NavError::Singular);
    }
    for sigmas in [0.0, f64::NAN, f64::INFINITY] {
        let settings = FilterSettings {
            gate: Gate::Sigmas(sigmas),
            ..ungated()
        };
        assert!(
            new(receiver(), settled(), settings)
                .to_string()
                .starts_with("gate")
        );
    }
}
