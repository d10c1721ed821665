//! Acquisition: which satellites are there, at which code phase and Doppler.
//!
//! 1. [`baseband`]: any front end is brought to 2048 complex samples a code period.
//! 2. [`spectra`]: blocks of whole code periods are shifted by each Doppler offset within one line
//!    of the code spectrum, folded to one period and transformed; all codes share the result.
//! 3. [`search`]: for every code and Doppler a shifted product and one inverse transform give all
//!    code phases; powers are summed over the blocks, following the code Doppler. The best cells
//!    are looked at again on a grid twice as fine in both directions.
//! 4. [`threshold`]: from the false-alarm probability of the whole request.
//! 5. [`refine`]: Doppler, code phase and C/N0 from sums of one code period.
//! 6. Hits so weak that they may be the cross-correlation of a stronger satellite are dropped,
//!    one of those found or one not searched for (SBAS and QZSS send codes of the same family).
//!
//! A data bit edge inside a coherent block costs up to all of that block: of blocks of N code
//! periods one in 20 / N holds an edge, and every other edge is a change of sign. Blocks of 1 to 5
//! periods lose at most 0.6 dB on average; longer ones are for signals without data.

mod baseband;
mod code_spectrum;
mod grid;
mod kernels;
mod refine;
mod search;
mod spectra;
mod statistics;
#[cfg(test)]
mod tests;
mod threshold;

use std::collections::BTreeMap;

use num_complex::Complex32;
use rustfft::FftPlanner;

use crate::{AcquisitionHit, FrontEnd, SearchReport, SearchRequest, Signal, SignalError, SignalId};
use baseband::Baseband;
use grid::Grid;
use refine::{Refined, refine};
use search::{Cell, CodeSearch, Searcher};
use spectra::Spectra;
pub use statistics::SearchStatistics;
use threshold::{Thresholds, thresholds};

/// Samples in one code period at the acquisition rate: the main lobe of the code, in a length that
/// transforms fast.
const POINTS: usize = 2048;
/// Code phases of the fine grid: a quarter chip apart.
const FINE_POINTS: usize = 2 * POINTS;
/// Acquisition sample rate, Hz: [`POINTS`] in each code period of 1 ms.
const ACQUISITION_RATE_HZ: f64 = 2.048e6;
/// Longest coherent integration, code periods: one data bit.
const MAX_COHERENT_PERIODS: u32 = 20;
/// Longest search, code periods; bounds memory (48 KiB a period).
const MAX_PERIODS: u64 = 500;

/// Least C/N0 of a hit, dB-Hz: what a signal of 52 dB-Hz, the strongest received from the sky,
/// leaves by cross-correlation (-21.6 dB at the worst Doppler difference), and 0.6 dB.
const LEAST_CN0_DBHZ: f64 = 31.0;
/// A hit weaker than the strongest by more than this may be its cross-correlation, dB.
const CROSS_CORRELATION_DB: f64 = 20.5;

/// Duration of one code period, s.
fn code_period_s() -> f64 {
    Signal::GpsL1Ca.spec().code_period_s()
}

/// Searches samples of one front end for GPS L1 C/A signals.
pub struct AcquisitionEngine {
    front_end: FrontEnd,
    threads: usize,
    baseband: Baseband,
    /// Part of a full-band signal's C/N0 that the acquisition band keeps.
    band_gain: f64,
    codes: BTreeMap<SignalId, Vec<Complex32>>,
    planner: FftPlanner<f32>,
}

impl AcquisitionEngine {
    /// An engine for samples of `front_end`, on one thread.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] unless the sample rate is within 0.5 MHz to 1 GHz and the
    /// intermediate frequency finite and below the sample rate.
    pub fn new(front_end: FrontEnd) -> Result<Self, SignalError> {
        check_front_end(front_end)?;
        let baseband = Baseband::new(front_end, ACQUISITION_RATE_HZ);
        Ok(Self {
            front_end,
            threads: 1,
            band_gain: code_spectrum::band_gain(|f_hz| baseband.response(f_hz)),
            baseband,
            codes: BTreeMap::new(),
            planner: FftPlanner::new(),
        })
    }

    /// Spreads the codes of a search over up to `threads` threads; what is found does not depend
    /// on it.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads.max(1);
        self
    }

    /// Samples that `request` covers at `front_end`.
    #[must_use]
    pub fn samples_needed(front_end: FrontEnd, request: &SearchRequest) -> u64 {
        let periods = f64::from(request.coherent_periods) * f64::from(request.noncoherent_sums);
        (periods * code_period_s() * front_end.sample_rate_hz).ceil() as u64
    }

    /// Looks for the signals of `request` in `samples` (I, Q interleaved where complex), the first
    /// of which has the tick `request.start_tick`.
    ///
    /// Where `samples` are too few for all non-coherent sums, those that fit are made (up to 5 %
    /// of the last block may be missing); what exceeds the request is not used.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] where the request is outside its documented ranges or `samples`
    /// hold less than one coherent integration.
    pub fn search(
        &mut self,
        samples: &[i8],
        request: &SearchRequest,
    ) -> Result<SearchReport, SignalError> {
        let count = samples.len() / if self.front_end.complex { 2 } else { 1 };
        let grid = Grid::new(self.front_end, request, count)?;
        for signal in &request.signals {
            self.codes
                .entry(*signal)
                .or_insert_with(|| code_spectrum::conjugated(*signal));
        }
        let baseband = self.baseband.reduce(samples, grid.periods() * POINTS);
        let spectra = Spectra::new(grid, baseband, &mut self.planner);
        let thresholds = request_thresholds(grid, request)?;
        let codes: Vec<&[Complex32]> = request
            .signals
            .iter()
            .filter_map(|signal| self.codes.get(signal).map(Vec::as_slice))
            .collect();
        let searches = search_all(&spectra, &codes, thresholds, self.threads);
        let mut report = SearchReport {
            hits: Vec::new(),
            best_missed: None,
            threshold: thresholds.sum,
        };
        for ((signal, code), search) in request.signals.iter().zip(codes).zip(&searches) {
            let Some(cell) = search.cells.first() else {
                continue;
            };
            if cell.statistic > thresholds.sum {
                let noise = search.noise_power / grid.coherent as f64;
                let refined = refine(&spectra, code, *cell, noise, &mut self.planner);
                let tick = request.start_tick;
                let gain = self.band_gain;
                let hit = hit(*signal, tick, *cell, thresholds.sum, refined, gain);
                report.hits.push(hit);
            } else if report.best_missed.is_none_or(|(_, s)| cell.statistic > s) {
                report.best_missed = Some((*signal, cell.statistic));
            }
        }
        report.drop_cross_correlation();
        report.hits.sort_by_key(|hit| hit.signal);
        Ok(report)
    }

    /// Part of a white signal's C/N0 that this front end's samples keep in the band searched.
    #[must_use]
    pub const fn band_gain(&self) -> f64 {
        self.band_gain
    }
}

fn request_thresholds(grid: Grid, request: &SearchRequest) -> Result<Thresholds, SignalError> {
    let cells = grid.cells_per_code() * request.signals.len().max(1) as f64;
    let sums = grid.blocks as u32;
    thresholds(sums, cells, request.false_alarm_probability)
}

fn check_front_end(front_end: FrontEnd) -> Result<(), SignalError> {
    let refuse = |name, value: f64, expected| {
        Err(SignalError::Parameter {
            name,
            value: value.to_string(),
            expected,
        })
    };
    let rate_hz = front_end.sample_rate_hz;
    if !(0.5e6..=1e9).contains(&rate_hz) {
        return refuse("sample rate (Hz)", rate_hz, "500000 to 1e9");
    }
    let if_hz = front_end.intermediate_frequency_hz;
    if !if_hz.abs().le(&rate_hz) {
        let expected = "at most the sample rate in magnitude";
        return refuse("intermediate frequency (Hz)", if_hz, expected);
    }
    Ok(())
}

/// Searches every code; the codes are dealt to the threads in runs and come back in order.
fn search_all(
    spectra: &Spectra,
    codes: &[&[Complex32]],
    thresholds: Thresholds,
    threads: usize,
) -> Vec<CodeSearch> {
    let search_run = |codes: &[&[Complex32]]| -> Vec<CodeSearch> {
        let mut searcher = Searcher::new(&mut FftPlanner::new());
        codes
            .iter()
            .map(|code| searcher.search(spectra, code, thresholds))
            .collect()
    };
    let run = codes.len().div_ceil(threads).max(1);
    if codes.len() <= run {
        return search_run(codes);
    }
    std::thread::scope(|scope| {
        let workers: Vec<_> = codes
            .chunks(run)
            .map(|codes| {
                let builder = std::thread::Builder::new();
                (
                    codes,
                    builder.spawn_scoped(scope, move || search_run(codes)),
                )
            })
            .collect();
        workers
            .into_iter()
            .flat_map(|(codes, worker)| match worker.map(|worker| worker.join()) {
                Ok(Ok(searches)) => searches,
                Ok(Err(cause)) => std::panic::resume_unwind(cause),
                // The system has no thread left.
                Err(_) => search_run(codes),
            })
            .collect()
    })
}

impl SearchReport {
    /// Keeps the hits that the cross-correlation of no stronger signal can explain.
    pub fn drop_cross_correlation(&mut self) {
        let strongest = self.hits.iter().map(|hit| hit.cn0_dbhz).fold(0.0, f64::max);
        let least = LEAST_CN0_DBHZ.max(strongest - CROSS_CORRELATION_DB);
        self.hits.retain(|hit| hit.cn0_dbhz >= least);
    }
}

fn hit(
    signal: SignalId,
    tick: u64,
    cell: Cell,
    threshold: f64,
    refined: Refined,
    band_gain: f64,
) -> AcquisitionHit {
    let chips = f64::from(signal.spec().code_length_chips);
    let phase = (-refined.delay_samples * chips / POINTS as f64).rem_euclid(chips);
    let cn0_hz = refined.period_snr / (band_gain * code_period_s());
    AcquisitionHit {
        signal,
        tick,
        // rem_euclid of a tiny negative number rounds up to the modulus itself.
        code_phase_chips: if phase < chips { phase } else { 0.0 },
        doppler_hz: refined.doppler_hz,
        statistic: cell.statistic,
        threshold,
        cn0_dbhz: 10.0 * cn0_hz.max(1.0).log10(),
    }
}

/// A plan that finds what can be found in `duration_ms` of samples: code periods to integrate
/// coherently, and how many of those to sum by power.
///
/// Up to 19 ms: sums of single periods, which no data bit can cancel. From 20 ms on: blocks of four
/// periods (a bit edge falls into one in five), up to 60 ms, which reaches 33 dB-Hz.
#[must_use]
pub fn default_search(duration_ms: u32) -> (u32, u32) {
    match duration_ms {
        0..20 => (1, duration_ms.max(1)),
        20..60 => (4, duration_ms / 4),
        _ => (4, 15),
    }
}
