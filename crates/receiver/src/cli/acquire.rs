//! `receiver acquire`.

use std::fmt::Write as _;
use std::io::Write;

use gnss_nav::SatelliteId;
use gnss_signal::{
    AcquisitionHit, CorrelatorBank, IfCorrelatorBank, InstructionSet, SearchRequest, SignalId,
    default_search,
};
use serde_json::json;

use super::print;
use crate::ReceiverError;
use crate::config::{AcquireConfig, AcquireOptions};
use crate::record::Acquired;
use crate::samples::{self, Source};
use crate::summary::AcquiredSatellite;

/// Signal used, ms: as much as `run` looks at first.
const SIGNAL_MS: u32 = 60;
/// Probability that noise alone yields any satellite in the whole command.
const FALSE_ALARM_PROBABILITY: f64 = 1e-3;

pub(super) fn acquire(options: &AcquireOptions, out: &mut dyn Write) -> Result<(), ReceiverError> {
    let config = options.check()?;
    let (source, _) = samples::open(&config.recording, true)?;
    let found = search(source, &config).map_err(|error| match error {
        ReceiverError::Signal(error) => samples::in_recording(&config.recording.input, error),
        other => other,
    })?;
    let acquired: Vec<AcquiredSatellite> = found.hits.iter().map(satellite).collect();
    if config.json {
        print(out, &format!("{}\n", json!({ "acquired": acquired })))
    } else if acquired.is_empty() {
        print(out, &nothing(&config, &found))
    } else {
        print(out, &table(&acquired, &found))
    }
}

struct Found {
    hits: Vec<AcquisitionHit>,
    signal_ms: u32,
    best_missed: Option<(SignalId, f64, f64)>,
}

fn search(source: Source, config: &AcquireConfig) -> Result<Found, ReceiverError> {
    let wanted_ms = config.integration_ms.unwrap_or(SIGNAL_MS);
    let history_s = f64::from(wanted_ms + 2) * 1e-3;
    let mut bank = IfCorrelatorBank::new(source, history_s, InstructionSet::detect())?
        .with_search_threads(config.threads);
    let ticks_per_ms = bank.front_end().sample_rate_hz * 1e-3;
    let held = bank.advance_to((f64::from(wanted_ms) * ticks_per_ms).ceil() as u64)?;
    samples::enough(&config.recording.input, held as f64 / ticks_per_ms * 1e-3)?;
    // A last period that lacks a twentieth is taken for whole.
    let signal_ms = ((held as f64 / ticks_per_ms + 0.05) as u32).min(wanted_ms);
    let (coherent_periods, noncoherent_sums) = plan(signal_ms);
    let signals = config.prns.iter().map(|prn| SignalId::gps_l1_ca(*prn));
    let report = bank.search(&SearchRequest {
        signals: signals.collect::<Result<_, _>>()?,
        start_tick: 0,
        doppler_centre_hz: 0.0,
        doppler_half_width_hz: config.doppler_max_hz,
        coherent_periods,
        noncoherent_sums,
        false_alarm_probability: FALSE_ALARM_PROBABILITY,
    })?;
    Ok(Found {
        best_missed: report.best_missed.map(|(id, s)| (id, s, report.threshold)),
        hits: report.hits,
        signal_ms,
    })
}

/// Coherent periods and non-coherent sums for so many milliseconds.
fn plan(signal_ms: u32) -> (u32, u32) {
    if signal_ms > 60 {
        (4, signal_ms / 4)
    } else {
        default_search(signal_ms)
    }
}

fn satellite(hit: &AcquisitionHit) -> AcquiredSatellite {
    (&Acquired {
        satellite: SatelliteId::gps(hit.signal.prn()),
        doppler_hz: hit.doppler_hz,
        code_phase_chips: hit.code_phase_chips,
        statistic: hit.statistic,
        cn0_dbhz: hit.cn0_dbhz,
    })
        .into()
}

fn table(acquired: &[AcquiredSatellite], found: &Found) -> String {
    let mut text =
        String::from("sat   Doppler (Hz)   code phase (chips)   C/N0 (dB-Hz)   statistic\n");
    for s in acquired {
        let _ = writeln!(
            text,
            "{:4}{:>14.1}{:>21.3}{:>15.1}{:>12.2}",
            s.sat, s.doppler_hz, s.code_phase_chips, s.cn0_dbhz, s.statistic
        );
    }
    let _ = writeln!(
        text,
        "{} satellites in {} ms of signal",
        acquired.len(),
        found.signal_ms
    );
    text
}

fn nothing(config: &AcquireConfig, found: &Found) -> String {
    let samples = &config.recording.samples;
    let closest = found
        .best_missed
        .map_or_else(String::new, |(signal, statistic, threshold)| {
            format!("; closest was {signal} with {statistic:.2} of the {threshold:.2} needed")
        });
    format!(
        "no satellite acquired: looked for {} satellites (PRN {} to {}) within +-{:.1} kHz in {} \
         ms of {} samples at {:.6} MHz, intermediate frequency {:.6} MHz{closest}. Wrong format, \
         sample rate or intermediate frequency?\n",
        config.prns.len(),
        config.prns.first().unwrap_or(&0),
        config.prns.last().unwrap_or(&0),
        config.doppler_max_hz / 1e3,
        found.signal_ms,
        samples.format,
        samples.sample_rate_hz / 1e6,
        samples.intermediate_frequency_hz / 1e6,
    )
}
