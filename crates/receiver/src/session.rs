//! One run of the receiver over any source of correlator sums, with its files.

use std::path::PathBuf;

use fault_ml::learned::ModelKind;
use fault_ml::shape::ShapeSettings;
use gnss_nav::GpsTime;
use gnss_signal::{CorrelatorBank, SignalId};

use crate::ReceiverError;
use crate::config::{Input, Ionosphere, Mode, MonitorChoice, RunConfig, Troposphere};
use crate::cost::Meter;
use crate::models::default_model;
use crate::pipeline::{self, Aiding, Outcome, Settings, ShapeWatching, VectorSettings};
use crate::rinex_nav::{self, NavigationFile};
use crate::samples;
use crate::sink::outputs::{Ending, OutputSettings, Outputs, write_cost};
use crate::summary::Summary;
use crate::truth::{RunSpan, Truth};

/// A run whose options and input files are read.
pub struct Session {
    meter: Meter,
    config: RunConfig,
    settings: Settings,
    truth: Option<Truth>,
}

impl Session {
    /// Reads the navigation file and the truth that `config` names.
    ///
    /// # Errors
    /// Where one of them cannot be read or says something impossible.
    pub fn prepare(config: RunConfig) -> Result<Self, ReceiverError> {
        let meter = Meter::start();
        let nav = config.nav.as_deref().map(rinex_nav::read).transpose()?;
        let truth = config.truth.as_deref().map(Truth::read).transpose()?;
        Ok(Self {
            meter,
            settings: settings(&config, nav)?,
            truth,
            config,
        })
    }

    /// What the run is told.
    #[must_use]
    pub const fn config(&self) -> &RunConfig {
        &self.config
    }

    /// Receives everything that `bank` holds, writes the output files and compares with the truth.
    ///
    /// # Errors
    /// Where samples cannot be read or files not written; no file is left then.
    pub fn run(self, bank: impl CorrelatorBank) -> Result<Summary, ReceiverError> {
        let Self {
            meter,
            config,
            settings,
            truth,
        } = self;
        let mut outputs = Outputs::open(&OutputSettings {
            directory: config.out.clone(),
            monitors: monitors(&config),
            dump_taps: config.dump_taps,
            position_file: false,
            // Not the name of the input: a file and standard input give the same bytes.
            title: "GPS receiver run".to_owned(),
            inputs: inputs(&config),
        })?;
        let received = pipeline::run(bank, &settings, &mut |record| outputs.record(&record));
        let outcome = received.map_err(|error| match error {
            ReceiverError::Signal(error) => samples::in_recording(&config.recording.input, error),
            other => other,
        })?;
        samples::enough(&config.recording.input, outcome.signal_s)?;
        let cost = meter.cost(outcome.signal_s, outputs.channels_mean());
        let summary = outputs.finish(ending(&config, outcome, truth))?;
        if let Some(directory) = &config.out {
            write_cost(directory, &cost)?;
        }
        Ok(summary)
    }
}

fn settings(config: &RunConfig, nav: Option<NavigationFile>) -> Result<Settings, ReceiverError> {
    let signals: Result<Vec<_>, _> = config
        .prns
        .iter()
        .map(|prn| SignalId::gps_l1_ca(*prn))
        .collect();
    let mut aiding = Aiding {
        position_ecef_m: config.position.map(|place| place.to_ecef()),
        time: config.time.map(|time| time + config.recording.start_s),
        ..Aiding::default()
    };
    if let Some(file) = nav {
        if let Some(time) = aiding.time {
            reject_another_day(config, &file, time)?;
        }
        aiding.ephemerides = file.ephemerides;
        aiding.ionosphere = file.ionosphere;
    }
    Ok(Settings {
        signals: signals?,
        rate_hz: config.rate_hz,
        raim: config.raim,
        seed: config.seed,
        elevation_mask_rad: config.elevation_mask_rad,
        ionosphere: config.ionosphere == Ionosphere::Klobuchar,
        troposphere: config.troposphere == Troposphere::Saastamoinen,
        aiding,
        duration_s: config.recording.duration_s,
        dump_taps: config.dump_taps,
        shape: config
            .monitors
            .contains(&MonitorChoice::Ewma)
            .then_some(ShapeWatching {
                chart: ShapeSettings::default(),
                policy: config.policy,
            }),
        vector: (config.mode == Mode::Vector)
            .then(|| vector(config))
            .transpose()?,
        ..Settings::default()
    })
}

/// Files that are read.
fn inputs(config: &RunConfig) -> Vec<PathBuf> {
    let samples = match &config.recording.input {
        Input::File(path) => Some(path),
        Input::Stdin => None,
    };
    let files = [samples, config.nav.as_ref(), config.truth.as_ref()];
    files.into_iter().flatten().cloned().collect()
}

/// Monitors whose scores are written.
fn monitors(config: &RunConfig) -> Vec<String> {
    let names = config.watching().map(MonitorChoice::name);
    names
        .chain(config.raim.scored())
        .map(str::to_owned)
        .collect()
}

fn vector(config: &RunConfig) -> Result<VectorSettings, ReceiverError> {
    let default = VectorSettings::default();
    let learned = config.monitors.iter().filter_map(|monitor| match monitor {
        MonitorChoice::Innovation | MonitorChoice::Ewma => None,
        MonitorChoice::Svm => Some(ModelKind::Svm),
        MonitorChoice::Lstm => Some(ModelKind::Lstm),
    });
    let innovation = config.monitors.contains(&MonitorChoice::Innovation);
    Ok(VectorSettings {
        filter: config.filter,
        policy: config.policy,
        monitor: default.monitor.filter(|_| innovation),
        learned: learned.map(default_model).collect::<Result<_, _>>()?,
        ..default
    })
}

/// Ephemerides of another time than the recording's would silently help nothing.
fn reject_another_day(
    config: &RunConfig,
    file: &NavigationFile,
    time: GpsTime,
) -> Result<(), ReceiverError> {
    /// Longer than any fit interval in use, and shorter than a day.
    const FAR_S: f64 = 14.0 * 3600.0;
    let away_s = |toe: GpsTime| (toe - time).abs();
    let nearest = file.ephemerides.iter().map(|e| e.toe);
    let Some(nearest) = nearest.min_by(|a, b| away_s(*a).total_cmp(&away_s(*b))) else {
        return Ok(());
    };
    if away_s(nearest) <= FAR_S {
        return Ok(());
    }
    Err(ReceiverError::Content {
        path: config.nav.clone().unwrap_or_default(),
        what: format!(
            "the ephemeris nearest to the recording's {}:{:.0} is of {}:{:.0}: expected one of \
             the same day",
            time.week(),
            time.tow_s(),
            nearest.week(),
            nearest.tow_s()
        ),
    })
}

fn ending(config: &RunConfig, outcome: Outcome, truth: Option<Truth>) -> Ending {
    let span = RunSpan {
        start_s: config.recording.start_s,
        signal_s: outcome.signal_s,
        rate_hz: config.rate_hz,
    };
    Ending {
        signal_s: outcome.signal_s,
        no_fix_reason: outcome.no_fix_reason,
        truth: truth.map(|truth| (truth, span)),
    }
}
