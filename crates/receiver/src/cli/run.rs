//! `receiver run`.

use std::io::Write;

use gnss_nav::GpsTime;
use gnss_signal::{IfCorrelatorBank, InstructionSet, SignalId};

use super::print;
use crate::ReceiverError;
use crate::config::{Ionosphere, Isa, RunConfig, RunOptions, Troposphere};
use crate::cost::Meter;
use crate::pipeline::{self, Aiding, Outcome, Settings};
use crate::record::Record;
use crate::rinex_nav::{self, NavigationFile};
use crate::samples::{self, Source};
use crate::sink::outputs::{Ending, OutputSettings, Outputs, write_cost};
use crate::summary::Summary;
use crate::truth::{RunSpan, Truth};

/// Samples kept, s: a channel starts at the first sample of its acquisition, so that no
/// navigation bit is lost while the search runs.
const HISTORY_S: f64 = 2.0;

pub(super) fn run(options: RunOptions, out: &mut dyn Write) -> Result<(), ReceiverError> {
    let meter = Meter::start();
    let config = options.check()?;
    let nav = config.nav.as_deref().map(rinex_nav::read).transpose()?;
    let truth = config.truth.as_deref().map(Truth::read).transpose()?;
    let settings = settings(&config, nav)?;
    let (source, progress) = samples::open(&config.recording, config.quiet)?;
    let mut outputs = Outputs::open(&OutputSettings {
        directory: config.out.clone(),
        monitors: Vec::new(),
        dump_taps: config.dump_taps,
        // Not the name of the input: a file and standard input give the same bytes.
        title: "GPS receiver run".to_owned(),
    })?;
    let received = receive(source, &config, &settings, &mut |record| {
        outputs.record(&record)
    });
    progress.finish();
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
    print(out, &text(&config, &summary))
}

/// The one place where samples enter the pipeline.
fn receive(
    source: Source,
    config: &RunConfig,
    settings: &Settings,
    sink: &mut dyn FnMut(Record) -> Result<(), ReceiverError>,
) -> Result<Outcome, ReceiverError> {
    let bank = IfCorrelatorBank::new(source, HISTORY_S, instruction_set(config.isa))?
        .with_search_threads(config.threads);
    pipeline::run(bank, settings, sink)
}

fn instruction_set(isa: Isa) -> InstructionSet {
    match isa {
        Isa::Auto => InstructionSet::detect(),
        Isa::Reference => InstructionSet::Reference,
        Isa::Portable => InstructionSet::Portable,
        Isa::Avx2 => InstructionSet::Avx2,
        Isa::Avx512 => InstructionSet::Avx512,
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
        elevation_mask_rad: config.elevation_mask_rad,
        ionosphere: config.ionosphere == Ionosphere::Klobuchar,
        troposphere: config.troposphere == Troposphere::Saastamoinen,
        aiding,
        duration_s: config.recording.duration_s,
        dump_taps: config.dump_taps,
        ..Settings::default()
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

/// What is said on the screen; the reason for no fix comes last.
fn text(config: &RunConfig, summary: &Summary) -> String {
    let files = config.out.as_ref().map_or_else(String::new, |directory| {
        format!("{:<12}{}\n", "files", directory.display())
    });
    format!("{files}{summary}")
}
