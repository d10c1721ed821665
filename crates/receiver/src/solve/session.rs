//! One `receiver solve` with its files.

use std::path::PathBuf;

use gnss_nav::{EphemerisStore, Klobuchar};
use nalgebra::Vector3;

use super::{InjectedFault, SolveOutcome, Solver};
use crate::ReceiverError;
use crate::config::{Ionosphere, SolveConfig};
use crate::cost::Meter;
use crate::rinex_nav;
use crate::rinex_obs::ObservationReader;
use crate::sink::outputs::{Ending, OutputSettings, Outputs, write_cost};
use crate::summary::Summary;
use crate::truth::{RunSpan, Truth};

/// A solution whose options and input files are read.
pub struct SolveSession {
    meter: Meter,
    config: SolveConfig,
    reader: ObservationReader,
    solver: Solver,
    truth: Option<Truth>,
}

impl SolveSession {
    /// Reads the navigation files and the truth, and opens the observations.
    ///
    /// # Errors
    /// Where one of them cannot be read or says something impossible.
    pub fn prepare(config: SolveConfig) -> Result<Self, ReceiverError> {
        let meter = Meter::start();
        let (store, klobuchar) = navigation(&config.nav)?;
        let truth = config.truth.as_deref().map(Truth::read).transpose()?;
        let mut settings = config.settings.clone();
        settings.ionosphere = match config.ionosphere {
            Ionosphere::None => None,
            Ionosphere::Klobuchar => Some(klobuchar.ok_or_else(|| no_ionosphere(&config))?),
        };
        let reader = ObservationReader::open(&config.obs)?;
        let start = reader.header().position_ecef_m;
        Ok(Self {
            meter,
            solver: Solver::new(settings, store, start.unwrap_or_else(Vector3::zeros))?,
            config,
            reader,
            truth,
        })
    }

    /// Solves every epoch, writes the output files and compares with the truth.
    ///
    /// # Errors
    /// Where the observations are damaged or files not written; no file is left then.
    pub fn run(self) -> Result<Summary, ReceiverError> {
        let Self {
            meter,
            config,
            reader,
            mut solver,
            truth,
        } = self;
        let mut outputs = Outputs::open(&OutputSettings {
            directory: config.out.clone(),
            monitors: config
                .settings
                .raim
                .scored()
                .map(str::to_owned)
                .into_iter()
                .collect(),
            position_file: true,
            title: "GPS positions from observations".to_owned(),
            inputs: inputs(&config),
            ..OutputSettings::default()
        })?;
        for epoch in reader {
            solver.epoch(&epoch?, &mut |record| outputs.record(&record))?;
        }
        let outcome = solver.finish();
        reject_absent(&outcome.absent)?;
        let cost = meter.cost(outcome.signal_s, outputs.channels_mean());
        let summary = outputs.finish(ending(outcome, truth))?;
        if let Some(directory) = &config.out {
            write_cost(directory, &cost)?;
        }
        Ok(summary)
    }
}

/// Files that are read.
fn inputs(config: &SolveConfig) -> Vec<PathBuf> {
    let all = [&config.obs].into_iter().chain(&config.nav);
    all.chain(&config.truth).cloned().collect()
}

/// All ephemerides, and the ionosphere of the first file that has one.
fn navigation(paths: &[PathBuf]) -> Result<(EphemerisStore, Option<Klobuchar>), ReceiverError> {
    let mut store = EphemerisStore::new();
    let mut klobuchar = None;
    for path in paths {
        let file = rinex_nav::read(path)?;
        for ephemeris in file.ephemerides {
            store.insert(ephemeris);
        }
        klobuchar = klobuchar.or(file.ionosphere);
    }
    Ok((store, klobuchar))
}

fn no_ionosphere(config: &SolveConfig) -> ReceiverError {
    ReceiverError::Content {
        path: config.nav.first().cloned().unwrap_or_default(),
        what: "no Klobuchar parameters in the header: expected some, or --ionosphere none"
            .to_owned(),
    }
}

fn reject_absent(absent: &[InjectedFault]) -> Result<(), ReceiverError> {
    match absent.first() {
        None => Ok(()),
        Some(fault) => Err(ReceiverError::Option {
            what: format!(
                "--inject is '{fault}': expected a satellite that is observed {} s after the first epoch or later",
                fault.onset_s
            ),
        }),
    }
}

fn ending(outcome: SolveOutcome, truth: Option<Truth>) -> Ending {
    // Epochs are due when the file has them.
    let intervals = outcome.epochs.saturating_sub(1) as f64;
    let span = RunSpan {
        start_s: 0.0,
        signal_s: outcome.signal_s,
        rate_hz: if outcome.signal_s > 0.0 {
            intervals / outcome.signal_s
        } else {
            1.0
        },
    };
    Ending {
        signal_s: outcome.signal_s,
        no_fix_reason: outcome.no_fix_reason,
        truth: truth.map(|truth| (truth, span)),
    }
}
