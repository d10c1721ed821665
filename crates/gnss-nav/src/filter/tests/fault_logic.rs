//! From skipped measurements to advice.

use rand::SeedableRng;

use super::super::NavFilter;
use super::*;
use crate::filter::{Advice, Disposition, FaultLogic, FaultThresholds, SequentialFilter};
use crate::made_up_sky::{constellation, measure, receiver};
use crate::{Measurement, NavError, SatelliteId};

fn exact() -> Vec<Measurement> {
    let store = constellation(&mut ChaCha8Rng::seed_from_u64(1));
    measure(&store, &receiver(), &ungated().model)
}

/// Advice after each of `epochs` epochs in which the first `wrong` satellites are far off.
fn advice(
    logic: &mut FaultLogic,
    epochs: usize,
    wrong: usize,
    dispositions: &[(SatelliteId, Disposition)],
) -> Vec<Advice> {
    let mut measurements = exact();
    for m in &mut measurements[..wrong] {
        m.pseudorange_m += 1e3;
    }
    let settings = FilterSettings {
        gate: Gate::Sigmas(4.0),
        ..ungated()
    };
    (0..epochs)
        .map(|_| {
            let mut filter: SequentialFilter = start(receiver(), settings);
            let innovations = filter.innovations(&measurements).unwrap();
            let update = filter.update(&innovations, dispositions).unwrap();
            logic.observe(&innovations, &update)
        })
        .collect()
}

fn logic() -> FaultLogic {
    FaultLogic::new(FaultThresholds::default()).unwrap()
}

fn named(count: usize) -> Vec<SatelliteId> {
    exact()[..count].iter().map(|m| m.satellite).collect()
}

#[test]
fn several_epochs_of_one_channel_isolate_it() {
    let mut logic = logic();
    let given = advice(&mut logic, 6, 1, &[]);
    assert_eq!(
        given[..4],
        [
            Advice::Nothing,
            Advice::Nothing,
            Advice::Nothing,
            Advice::Nothing
        ]
    );
    assert_eq!(
        given[4..],
        [Advice::Isolate(named(1)), Advice::Isolate(named(1))]
    );
    assert_eq!(logic.skipped_epochs(named(1)[0]), 6);
    // The window of ten forgets: five healthy epochs leave five of six, one more leaves four.
    let healthy = advice(&mut logic, 6, 0, &[]);
    assert_eq!(healthy[4], Advice::Isolate(named(1)));
    assert_eq!(healthy[5], Advice::Nothing);
}

#[test]
fn most_channels_reset_and_half_of_them_do_not() {
    let count = exact().len();
    for (wrong, resets) in [(count / 2, false), (count / 2 + 1, true), (count, true)] {
        let last = advice(&mut logic(), 5, wrong, &[]).pop().unwrap();
        let expected = if resets {
            Advice::Reset(named(wrong))
        } else {
            Advice::Isolate(named(wrong))
        };
        assert_eq!(last, expected);
    }
}

#[test]
fn excluded_satellites_take_no_part_and_are_forgotten() {
    let excluded: Vec<_> = named(1)
        .into_iter()
        .map(|s| (s, Disposition::Exclude))
        .collect();
    let mut fresh = logic();
    assert!(
        advice(&mut fresh, 12, 1, &excluded)
            .iter()
            .all(|a| *a == Advice::Nothing)
    );
    let mut logic = logic();
    advice(&mut logic, 5, 1, &[]);
    advice(&mut logic, 10, 1, &excluded);
    assert_eq!(logic.skipped_epochs(named(1)[0]), 0);
    advice(&mut logic, 3, 2, &[]);
    logic.forget(named(1)[0]);
    assert_eq!(logic.skipped_epochs(named(1)[0]), 0);
    assert_eq!(logic.skipped_epochs(named(2)[1]), 3);
    logic.clear();
    assert_eq!(logic.skipped_epochs(named(2)[1]), 0);
}

#[test]
fn thresholds_outside_their_range_are_refused() {
    let base = FaultThresholds::default();
    let refused = |thresholds| {
        let error = FaultLogic::new(thresholds).unwrap_err();
        assert!(matches!(error, NavError::Value { .. }), "{error}");
    };
    for window_epochs in [0, 65] {
        refused(FaultThresholds {
            window_epochs,
            ..base
        });
    }
    for epochs_to_isolate in [0, 11] {
        refused(FaultThresholds {
            epochs_to_isolate,
            ..base
        });
    }
    for fraction_to_reset in [-0.1, 1.1, f64::NAN] {
        refused(FaultThresholds {
            fraction_to_reset,
            ..base
        });
    }
}
