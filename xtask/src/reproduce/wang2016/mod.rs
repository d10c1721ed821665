//! `Wang2016`: integrity monitoring by particle filters moved by a swarm, on simulated data.

pub mod detector;
pub mod performance;
pub mod setting;
pub mod simulate;
pub mod study;

use anyhow::Result;

use super::Outcome;

/// Repeats the paper on simulated data.
///
/// # Errors
/// Where a campaign or a picture cannot be made.
pub fn reproduce() -> Result<Outcome> {
    let geometry = setting::geometry()?;
    let study = study::Study::run(&geometry)?;
    for (name, cases) in [
        ("paper", &study.paper),
        ("matched", &study.matched),
        ("corr", &study.correlated),
        ("scan", &study.scan),
    ] {
        for case in cases {
            let stats = case.runs[0].clean_largest.len();
            let eff = performance::mean(case.runs.iter().map(|r| r.steps[0].effective));
            let rms = performance::mean(case.runs.iter().map(|r| r.clean_square_m2)).sqrt();
            let err: Vec<f64> = (0..3)
                .map(|s| performance::mean(case.runs.iter().map(|r| r.steps[s].error_m)))
                .collect();
            let spread = performance::mean(case.runs.iter().map(|r| r.spread_m));
            eprintln!(
                "{name} {} {}: neff {eff:.1} rms {rms:.2} spread {spread:.2} err {err:.1?}",
                case.key, case.label
            );
            for s in 0..stats {
                let p = performance::Performance::new(&case.runs, s, 20.0);
                let q = performance::Performance::at_false_alarm_share(&case.runs, s, 0.05);
                eprintln!(
                    "   {s}: FA {:.3} del {:?} p95 {:?} id {:.2?} det {:.2?} | tau5 {:.1} del {:?} p95 {:?} id {:.2?} det {:.2?}",
                    p.false_alarm_runs,
                    p.delay_median_s,
                    p.delay_p95_s,
                    p.identified,
                    p.detected,
                    q.threshold,
                    q.delay_median_s,
                    q.delay_p95_s,
                    q.identified,
                    q.detected
                );
            }
        }
    }
    Ok(Outcome {
        paper: "wang2016",
        figures: serde_json::json!({}),
        checks: vec![],
        report: String::new(),
        pictures: vec![],
    })
}
