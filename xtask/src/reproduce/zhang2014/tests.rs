//! The settled loop against reference figures, and short runs of the rest.

use std::path::{Path, PathBuf};

use super::correlation::Correlation;
use super::map::map;
use super::rays::{self, Detection};
use super::urban::{Way, urban};
use crate::order::quantile;
use fault_ml::shape::ChartSettings;

/// The reference map, or `None`, said aloud, where there is none.
fn reference() -> Option<String> {
    let data = std::env::var_os("GNSS_TEST_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let text = std::fs::read_to_string(data.join("../oracle/multipath_map.csv")).ok();
    #[allow(clippy::print_stderr, reason = "a skip must not be silent")]
    if text.is_none() {
        eprintln!("SKIPPED: no reference figures (multipath_map.csv)");
    }
    text
}

#[test]
fn errors_and_observables_are_those_of_the_reference_map() {
    let Some(text) = reference() else {
        return;
    };
    let ours = map(&Correlation::Triangle, 0.5);
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), ours.len());
    for (row, point) in rows.iter().zip(&ours) {
        assert!((row[0] - point.delay_chips).abs() < 1e-9);
        assert!((row[1] - point.phase_deg).abs() < 1e-9);
        assert!(
            (row[2] - point.error_chips).abs() < 0.01,
            "{row:?} {point:?}"
        );
        // Within a step of the observable, where two taps are nearly the same.
        assert!(
            (row[3] - point.observed_chips).abs() < 0.101,
            "{row:?} {point:?}"
        );
    }
    let off = rows
        .iter()
        .zip(&ours)
        .filter(|(row, p)| (row[3] - p.observed_chips).abs() > 0.01);
    assert!(off.count() < 8);
}

#[test]
fn the_chart_sees_both_reflections_and_nothing_before() {
    let runs: Vec<_> = (0..8)
        .map(|seed| rays::run(ChartSettings::default(), seed).unwrap())
        .collect();
    let seen = Detection::of(&runs, 0);
    assert_eq!(seen.early_alarms, 0);
    // The bounds, of which sixty seeds are in the report.
    assert!(
        quantile(seen.delays_s.iter().copied(), 0.5) < 0.13,
        "{:?}",
        seen.delays_s
    );
    assert!(
        quantile(seen.correlations.iter().copied(), 0.5) > 0.91,
        "{:?}",
        seen.correlations
    );
}

#[test]
fn exclusion_gets_near_what_knowing_the_reflections_gets() {
    let all = urban(4).unwrap();
    let error = |way: Way| {
        let place = Way::ALL.iter().position(|w| *w == way).unwrap();
        all.iter().map(|u| u.errors_m[place].0).sum::<f64>()
    };
    assert!(error(Way::Known) < error(Way::Both) && error(Way::Both) < 0.5 * error(Way::Plain));
    let flagged = all.iter().map(|u| u.flagged).sum::<f64>() / all.len() as f64;
    assert!((0.4..0.95).contains(&flagged), "{flagged}");
}
