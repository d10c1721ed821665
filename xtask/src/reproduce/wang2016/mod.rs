//! `Wang2016`: integrity monitoring by particle filters moved by a swarm, on simulated and on real
//! data.
//!
//! Everything that judges takes [`fault_ml::Sight`]s: made up in [`setting`], of recorded observations
//! in [`real`].

pub mod calibrated;
pub mod checks;
pub mod detector;
mod explain;
pub mod figures;
pub mod performance;
pub mod real;
pub mod report;
pub mod setting;
pub mod simulate;
pub mod study;
#[cfg(test)]
mod tests;

use anyhow::Result;

use self::calibrated::Calibrated;
use self::figures::Shown;
use self::real::RealStudy;
use self::study::{Study, case};
use super::Outcome;

/// Repeats the paper on simulated data, and on a recording where it is present.
///
/// # Errors
/// Where a campaign or a picture cannot be made.
pub fn reproduce() -> Result<Outcome> {
    let geometry = setting::geometry()?;
    let study = Study::run(&geometry)?;
    let calibrated = Calibrated::run(&geometry)?;
    let real = RealStudy::run()?;
    let mut checks = checks::checks(&study, &calibrated)?;
    checks.extend(real.iter().flat_map(checks::on_real_data));
    let shown = case(&study.paper, "pf")?.campaign;
    let shown = Shown {
        geometry: &geometry,
        truth: shown.truth,
        sigma_m: shown.sigma_m,
        bootstrap: study::bootstrap(),
        swarm: study::swarmed(study::SWARM),
    };
    Ok(Outcome {
        paper: "wang2016",
        figures: report::figures(&study, &calibrated, real.as_ref()),
        report: report::report(&study, &calibrated, real.as_ref(), &checks)?,
        pictures: shown.pictures()?,
        tables: Vec::new(),
        checks,
    })
}
