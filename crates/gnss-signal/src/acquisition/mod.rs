//! Acquisition: which satellites are there, at which code phase and Doppler.
//!
//! 1. [`baseband`]: any front end is brought to 2048 complex samples a code period.
//! 2. [`spectra`]: blocks of whole code periods are shifted by each Doppler offset within one line
//!    of the code spectrum, folded to one period and transformed; all codes share the result.
//! 3. [`search`]: for every code and Doppler a shifted product and one inverse transform give all
//!    code phases; powers are summed over the blocks, following the code Doppler. The best cells
//!    are looked at again on a grid twice as fine in both directions.
//! 4. [`threshold`]: from the false-alarm probability of the whole request.
//! 5. [`cross_correlation`]: drops what stronger satellites explain.
//! 6. [`refine`]: Doppler, code phase and C/N0 from sums of one code period.
//!
//! A data bit edge inside a coherent block costs up to all of that block: of blocks of N code
//! periods one in 20 / N holds an edge, and every other edge is a change of sign. Blocks of 1 to 5
//! periods lose at most 0.6 dB on average; longer ones are for signals without data.

mod baseband;
mod code_spectrum;
mod cross_correlation;
mod grid;
mod refine;
mod search;
mod spectra;
mod threshold;

use std::collections::BTreeMap;

use num_complex::Complex32;
use rustfft::FftPlanner;

use crate::{AcquisitionHit, FrontEnd, SearchReport, SearchRequest, Signal, SignalError, SignalId};
use baseband::Baseband;
use cross_correlation::{Detection, without_cross_correlation};
use grid::Grid;
use search::{CodeSearch, Searcher};
use spectra::Spectra;

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
        let cells = grid.cells_per_code() * request.signals.len().max(1) as f64;
        let sums = grid.blocks as u32;
        let threshold = threshold::threshold(sums, cells, request.false_alarm_probability)?;
        let codes: Vec<&[Complex32]> = request
            .signals
            .iter()
            .filter_map(|signal| self.codes.get(signal).map(Vec::as_slice))
            .collect();
        let searches = search_all(&spectra, &codes, threshold, self.threads);
        let kept = detections(&searches, threshold);
        let kept = without_cross_correlation(kept, &codes, grid, &mut self.planner);
        let hits = kept
            .iter()
            .map(|found| {
                let noise = searches[found.index].noise_power / grid.coherent as f64;
                let code = codes[found.index];
                let refined = refine::refine(&spectra, code, found.cell, noise, &mut self.planner);
                hit(request, found, refined, threshold, self.band_gain)
            })
            .collect();
        Ok(SearchReport {
            best_missed: best_missed(request, &searches, &kept),
            hits,
            threshold,
        })
    }
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
    threshold: f64,
    threads: usize,
) -> Vec<CodeSearch> {
    let search_run = |codes: &[&[Complex32]]| -> Vec<CodeSearch> {
        let mut searcher = Searcher::new(&mut FftPlanner::new());
        codes
            .iter()
            .map(|code| searcher.search(spectra, code, threshold))
            .collect()
    };
    let run = codes.len().div_ceil(threads).max(1);
    if codes.len() <= run {
        return search_run(codes);
    }
    std::thread::scope(|scope| {
        let workers: Vec<_> = codes
            .chunks(run)
            .map(|codes| scope.spawn(move || search_run(codes)))
            .collect();
        workers
            .into_iter()
            .flat_map(|worker| match worker.join() {
                Ok(searches) => searches,
                Err(cause) => std::panic::resume_unwind(cause),
            })
            .collect()
    })
}

fn detections(searches: &[CodeSearch], threshold: f64) -> Vec<Detection> {
    let mut found = Vec::new();
    for (index, search) in searches.iter().enumerate() {
        let above = search.cells.iter().filter(|c| c.statistic > threshold);
        found.extend(above.map(|cell| Detection { index, cell: *cell }));
    }
    found
}

fn hit(
    request: &SearchRequest,
    found: &Detection,
    refined: refine::Refined,
    threshold: f64,
    band_gain: f64,
) -> AcquisitionHit {
    let signal = request.signals[found.index];
    let chips = f64::from(signal.spec().code_length_chips);
    let phase = (-refined.delay_samples * chips / POINTS as f64).rem_euclid(chips);
    let cn0_hz = refined.period_snr / (band_gain * code_period_s());
    AcquisitionHit {
        signal,
        tick: request.start_tick,
        // rem_euclid of a tiny negative number rounds up to the modulus itself.
        code_phase_chips: if phase < chips { phase } else { 0.0 },
        doppler_hz: refined.doppler_hz,
        statistic: found.cell.statistic,
        threshold,
        cn0_dbhz: 10.0 * cn0_hz.max(1.0).log10(),
    }
}

/// The largest statistic among the codes without a hit.
fn best_missed(
    request: &SearchRequest,
    searches: &[CodeSearch],
    kept: &[Detection],
) -> Option<(SignalId, f64)> {
    searches
        .iter()
        .enumerate()
        .filter(|(index, _)| kept.iter().all(|found| found.index != *index))
        .filter_map(|(index, search)| {
            let cell = search.cells.first()?;
            Some((request.signals[index], cell.statistic))
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))
}
