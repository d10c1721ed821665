//! The receiver's position error at the correlator level against that on samples.

use std::fmt;
use std::num::NonZeroUsize;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use gnss_signal::{CorrelatorBank, IfCorrelatorBank, InstructionSet};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use receiver::pipeline::{Aiding, Settings, run};
use receiver::record::{EventKind, PvtRecord, Record};

use super::verdict;
use crate::scenario::built::Scenario;
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::if_signal::{Options, Synthesiser};
use crate::scenario::make::Level;
use crate::scenario::spec::ScenarioFile;

/// Signal of a run, s, and what is not judged of it: the receiver's first, unsmoothed second.
const RUN_S: f64 = 2.0;
const UNJUDGED_S: f64 = 1.0;
/// Seeds on samples begin here, so that no run shares one.
const FIRST_SEED_ON_SAMPLES: u64 = 1_000_000;
/// Resamplings of the bootstrap.
const RESAMPLINGS: usize = 2000;
/// Standard error over rms that is asked for.
pub const LARGEST_RELATIVE_ERROR: f64 = 0.04;
/// Threads that runs are shared by.
const THREADS: u64 = 2;

/// A receiver at rest under satellites of one C/N0, without atmosphere.
pub(crate) fn at_rest(duration_s: f64, seed: u64) -> Result<Scenario> {
    let text = format!(
        "description = 'at rest'
start = {{ week = 2350, tow_s = 392400 }}
duration_s = {duration_s:?}
constellation = {{ elevation_mask_deg = 10 }}
trajectory = {{ kind = 'static', at = {{ lat_deg = 52.3, lon_deg = 10.5, height_m = 120 }} }}
clock = {{ drift = 2e-7 }}
propagation = {{ ionosphere = 'none', troposphere = 'none' }}
cn0 = {{ fixed_dbhz = 45 }}
front_end = {{ format = 'ci8', sample_rate_hz = 2.6e6, bandwidth_hz = 2.08e6 }}"
    );
    let file = ScenarioFile::parse("at rest", "at rest", Path::new(""), text)?;
    Scenario::new(&file, Some(seed))
}

/// The receiver for it, told ephemerides, place and time where it is `assisted`.
pub(crate) fn settings(scenario: &Scenario, assisted: bool) -> Settings {
    let place = scenario.truth.trajectory.at(0.0).position_ecef_m;
    let aiding = if assisted {
        Aiding {
            ephemerides: scenario.heard.iter().map(|h| h.broadcast).collect(),
            ionosphere: None,
            position_ecef_m: Some(place.add_scalar(5e3)),
            time: Some(scenario.truth.start + 3.0),
        }
    } else {
        Aiding::default()
    };
    Settings {
        ionosphere: false,
        troposphere: false,
        aiding,
        ..Settings::default()
    }
}

/// Solutions and number of acquisitions of a run.
pub(crate) fn receive(
    bank: impl CorrelatorBank,
    settings: &Settings,
) -> Result<(Vec<PvtRecord>, usize)> {
    let (mut solutions, mut acquired) = (Vec::new(), 0);
    run(bank, settings, &mut |record| {
        match record {
            Record::Pvt(pvt) => solutions.push(pvt),
            Record::Event(event) => {
                acquired += usize::from(matches!(event.kind, EventKind::Acquired(_)));
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok((solutions, acquired))
}

/// How far a solution is from the truth, m.
pub(crate) fn error_m(scenario: &Scenario, solution: &PvtRecord) -> f64 {
    let place = scenario.truth.trajectory.at(0.0).position_ecef_m;
    (solution.position_ecef_m - place).norm()
}

/// Mean square position error of one assisted run, m^2.
fn run_error_m2(level: Level, number: u64) -> Result<f64> {
    let seed = match level {
        Level::Correlator => number,
        Level::If => FIRST_SEED_ON_SAMPLES + number,
    };
    let scenario = at_rest(RUN_S, seed)?;
    let settings = settings(&scenario, true);
    let (solutions, acquired) = match level {
        Level::Correlator => receive(CorrelatorLevelBank::new(scenario.scene())?, &settings)?,
        Level::If => {
            let options = Options {
                threads: NonZeroUsize::new(1),
                ..Options::default()
            };
            let source = Synthesiser::with_options(scenario.scene(), options)?;
            let bank = IfCorrelatorBank::new(source, RUN_S, InstructionSet::detect())?;
            receive(bank, &settings)?
        }
    };
    ensure!(
        acquired == scenario.heard.len(),
        "seed {seed}: {acquired} satellites acquired"
    );
    let judged = solutions.iter().filter(|s| s.time_s > UNJUDGED_S);
    let squares: Vec<f64> = judged.map(|s| error_m(&scenario, s).powi(2)).collect();
    ensure!(
        squares.len() >= 5,
        "seed {seed}: {} solutions",
        squares.len()
    );
    Ok(mean(&squares))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Position error over all runs of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionError {
    /// Root mean square, m.
    pub rms_m: f64,
    /// Its standard error by bootstrap over runs, m.
    pub error_m: f64,
}

impl PositionError {
    /// From mean squares of independent runs, m^2.
    fn of(squares_m2: &[f64]) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let mut resampled = || {
            let draw = |_| squares_m2[random.random_range(0..squares_m2.len())];
            let drawn: Vec<f64> = (0..squares_m2.len()).map(draw).collect();
            mean(&drawn).sqrt()
        };
        let all: Vec<f64> = (0..RESAMPLINGS).map(|_| resampled()).collect();
        let middle = mean(&all);
        let squares: Vec<f64> = all.iter().map(|x| (x - middle).powi(2)).collect();
        Self {
            rms_m: mean(squares_m2).sqrt(),
            error_m: mean(&squares).sqrt(),
        }
    }
}

/// Position errors at both levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Runs of each.
    pub runs: u64,
    /// At the correlator level.
    pub correlator: PositionError,
    /// On samples.
    pub samples: PositionError,
}

/// Receives `runs` short assisted runs at each level, shared by two threads; the result does not
/// depend on that.
///
/// # Errors
/// Where a run fails, or misses a satellite.
pub fn compare(runs: u64) -> Result<Comparison> {
    ensure!(runs > 0, "runs: expected at least one");
    let squares = |level: Level| -> Result<Vec<f64>> {
        let part = |thread: u64| -> Result<Vec<f64>> {
            let numbers = (thread..runs).step_by(THREADS as usize);
            numbers.map(|number| run_error_m2(level, number)).collect()
        };
        let parts: Vec<Vec<f64>> = std::thread::scope(|scope| {
            let handles: Vec<_> = (0..THREADS).map(|t| scope.spawn(move || part(t))).collect();
            let joined = handles.into_iter().map(|handle| {
                let result = handle.join();
                result.map_err(|_| anyhow::anyhow!("a run panicked"))?
            });
            joined.collect::<Result<_>>()
        })?;
        Ok(parts.concat())
    };
    Ok(Comparison {
        runs,
        correlator: PositionError::of(&squares(Level::Correlator).context("correlator level")?),
        samples: PositionError::of(&squares(Level::If).context("samples")?),
    })
}

impl Comparison {
    /// Difference over its standard error.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        let (a, b) = (self.correlator, self.samples);
        (a.rms_m - b.rms_m) / a.error_m.hypot(b.error_m)
    }

    /// Whether the levels agree within three standard errors, each of at most
    /// [`LARGEST_RELATIVE_ERROR`].
    #[must_use]
    pub fn holds(&self) -> bool {
        let known = |e: PositionError| e.error_m <= LARGEST_RELATIVE_ERROR * e.rms_m;
        self.deviation().abs() <= 3.0 && known(self.correlator) && known(self.samples)
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| level | runs | position error, rms (m) | standard error (m) | (%) |"
        )?;
        writeln!(f, "|---|---|---|---|---|")?;
        for (name, error) in [("correlator", self.correlator), ("samples", self.samples)] {
            writeln!(
                f,
                "| {name} | {} | {:.4} | {:.4} | {:.2} |",
                self.runs,
                error.rms_m,
                error.error_m,
                100.0 * error.error_m / error.rms_m
            )?;
        }
        let verdict = verdict(self.holds());
        write!(
            f,
            "{:+.2} standard errors apart; bounds 3, and 4 % each: {verdict}",
            self.deviation()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bootstrap_has_the_error_of_a_mean() {
        // Mean squares of exponential numbers: the root errs by half the relative error of the
        // mean, 1 / sqrt(n). A deviation of 200 numbers is known to 10 % here.
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let draw = |_| -9.0 * (1.0 - random.random::<f64>()).ln();
        let squares: Vec<f64> = (0..200).map(draw).collect();
        let error = PositionError::of(&squares);
        assert!((error.rms_m / 3.0 - 1.0).abs() < 3.0 * 0.5 / 200f64.sqrt());
        let expected = 0.5 * error.rms_m / 200f64.sqrt();
        assert!((error.error_m / expected - 1.0).abs() < 0.3, "{error:?}");
    }

    #[test]
    fn positions_err_as_on_samples() {
        // A few runs: enough to see an error of a half.
        let comparison = compare(6).unwrap();
        assert!(comparison.deviation().abs() < 3.0, "{comparison}");
        assert!(!comparison.holds(), "six runs tell no rms to 4 %");
    }
}
