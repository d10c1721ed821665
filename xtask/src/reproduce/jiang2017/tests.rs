//! One seed at the correlator level; all of them, and the samples, are the command's.

use super::checks::checks;
use super::receivers::Variant;
use super::study::Study;
use crate::scenario::make::Level;

#[test]
fn the_paper_s_filter_runs_off_and_exclusion_holds_it() {
    let study = Study::run(Level::Correlator, 1).unwrap();
    for case in &study.cases {
        let number = case.blockage.number;
        let after = |variant| case.runs(variant).map(|run| run.after_m).sum::<f64>();
        // The bounds of the command.
        assert!(after(Variant::Paper) > 50.0, "scenario {number}");
        assert!(after(Variant::Product) < 3.0, "scenario {number}");
    }
    for check in checks(&study) {
        assert!(check.holds, "{check:?}");
    }
}
