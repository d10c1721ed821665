//! A single short curve; all of it is the command's.

use super::report::{figures, report};
use super::study::{Cell, Study};
use crate::scenario::make::Level;
use fault_ml::learned::ModelKind;
use fault_ml::metrics::BalancedAccuracy;

#[test]
fn a_report_holds_every_length_and_says_which_is_above() {
    let accuracy = |hits: usize| {
        let decisions = (0..10)
            .map(move |k| (k < hits, true))
            .chain([(false, false)]);
        let value = BalancedAccuracy::of(decisions);
        crate::train::paper::Accuracy {
            all: value,
            steady: value,
            by_class: vec![(30, value)],
            steady_by_class: vec![(30, value)],
        }
    };
    let cell = |kind, length, hits: [usize; 2]| Cell {
        kind,
        length,
        trainings: hits.map(accuracy).to_vec(),
    };
    let study = Study {
        level: Level::Correlator,
        seeds: 2,
        cells: vec![
            cell(ModelKind::Lstm, 50, [9, 7]),
            cell(ModelKind::Svm, 50, [5, 5]),
        ],
        flights: Vec::new(),
    };
    // Half of 0.8 and 1, and its scatter.
    let (mean, deviation) = study.cells[0].mean_and_deviation(|a| a.all.value());
    assert!((mean - 0.9).abs() < 1e-12 && (deviation - 0.0707).abs() < 1e-4);
    let text = report(&study, &super::report::checks(&study));
    assert!(
        text.contains("| 50 | 0.9000 +- 0.0707 | 0.7500 +- 0.0000 |"),
        "{text}"
    );
    assert!(text.contains("is above the machine"), "{text}");
    assert_eq!(figures(&study)["accuracy"][1]["length"], 50);
}
