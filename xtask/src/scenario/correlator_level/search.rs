//! Acquisitions, drawn from the distribution of their detection statistic.
//!
//! Threshold, cells and sums are those of the real engine ([`AcquisitionEngine::statistics`]).
//!
//! - Noise: the largest of as many independent cells as the threshold counts on, each the mean of
//!   powers of complex noise (chi-square), so that false alarms come exactly as often as asked for.
//! - Signal: at the cell of its strongest ray's Doppler and code phase, rounded to the grid, the
//!   coherent sums of all blocks with bits, rays and code correlation (cut to the band searched)
//!   as they are, each with its own noise: a noncentral chi-square.
//! - Code phase by the same parabola as the engine's, so that reflections move it. Code phase,
//!   Doppler and C/N0 then err by the deviations that the engine has on samples.
//!
//! Each signal is drawn by itself. What strong signals leave in other codes is not drawn; the rule
//! that drops hits which may be that is applied.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use anyhow::Result;
use gnss_signal::{
    AcquisitionEngine, AcquisitionHit, MAX_TAPS, Replica, SearchReport, SearchRequest,
    SearchStatistics, SignalError, SignalId, TapOffsets,
};
use num_complex::Complex64;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::bank::{CorrelatorLevelBank, unreadable};
use super::code_correlation::CodeCorrelation;
use super::noise::{complex_normal, generator, normal};
use super::signal_sum::SignalSum;

/// Half of the band searched, chip rates.
const BAND_CHIP_RATES: f64 = 1.001;
/// Taps of the parabola through the code phase, chips.
const FIT_CHIPS: f64 = 0.25;
/// Variance of the code phase found, chips^2, times C/N0 and the time searched: what the engine has
/// on samples of 1 to 200 ms and 38 to 48 dB-Hz, to a quarter.
const CODE_VARIANCE: f64 = 0.18;
/// Variance of the Doppler found, Hz^2, times C/N0 and the time searched cubed, for short times: that
/// of an ideal estimator is 6 / (2 pi)^2 (Rife1974). Measured as the one above.
const DOPPLER_VARIANCE: f64 = 1.4 * 6.0 / (TAU * TAU);
/// Time from which on that no longer falls with the time searched, s: the engine links each bit to
/// its neighbours alone.
const LINKED_S: f64 = 0.1;

/// A signal as a search would find it.
struct Candidate {
    statistic: f64,
    code_phase_chips: f64,
    doppler_hz: f64,
    cn0_hz: f64,
}

impl CorrelatorLevelBank {
    /// Draws what `request` finds in the `held` samples from its start on.
    pub(super) fn draw_search(
        &mut self,
        request: &SearchRequest,
        held: u64,
    ) -> Result<SearchReport, SignalError> {
        let needed = AcquisitionEngine::samples_needed(self.front_end, request).min(held);
        let statistics = AcquisitionEngine::statistics(self.front_end, request, needed as usize)?;
        let band_gain = self.band_gain()?;
        let mut report = SearchReport {
            hits: Vec::new(),
            best_missed: None,
            threshold: statistics.threshold,
        };
        for signal in &request.signals {
            let search = Search {
                request,
                statistics: &statistics,
                band_gain,
                signal: *signal,
            };
            let best = search.best(self).map_err(unreadable)?;
            if best.statistic > statistics.threshold {
                report.hits.push(search.hit(&best));
            } else if report.best_missed.is_none_or(|(_, s)| best.statistic > s) {
                report.best_missed = Some((*signal, best.statistic));
            }
        }
        report.drop_cross_correlation();
        report.hits.sort_by_key(|hit| hit.signal);
        Ok(report)
    }

    /// Gain of the engine's front end, which is asked for once.
    fn band_gain(&mut self) -> Result<f64, SignalError> {
        if let Some(gain) = self.band_gain {
            return Ok(gain);
        }
        let gain = AcquisitionEngine::new(self.front_end)?.band_gain();
        self.band_gain = Some(gain);
        Ok(gain)
    }
}

/// The search for one signal.
struct Search<'a> {
    request: &'a SearchRequest,
    statistics: &'a SearchStatistics,
    band_gain: f64,
    signal: SignalId,
}

/// Where a signal stands as the search begins.
#[derive(Debug, Clone, Copy)]
struct Standing {
    doppler_hz: f64,
    code_phase_chips: f64,
}

impl Search<'_> {
    fn best(&self, bank: &mut CorrelatorLevelBank) -> Result<Candidate> {
        let mut generator = generator(&bank.seed, self.signal, self.request.start_tick, 0);
        let mut best = self.noise(&mut generator);
        for index in 0..bank.tracks.len() {
            if bank.tracks[index].signal != self.signal {
                continue;
            }
            let Some(standing) = self.strongest(bank, index)? else {
                continue;
            };
            let found = self.detect(bank, standing, &mut generator)?;
            if found.statistic > best.statistic {
                best = found;
            }
        }
        Ok(best)
    }

    /// Seconds that a block takes, and all of them.
    fn block_s(&self) -> f64 {
        f64::from(self.statistics.coherent_periods) * self.signal.spec().code_period_s()
    }

    fn duration_s(&self) -> f64 {
        self.block_s() * f64::from(self.statistics.noncoherent_sums)
    }

    /// The largest of all cells of noise.
    fn noise(&self, generator: &mut ChaCha8Rng) -> Candidate {
        let below: f64 = generator.random::<f64>().max(f64::MIN_POSITIVE);
        // Chance of one cell to lie above, without cancellation.
        let above = -(below.ln() / self.statistics.cells_per_code).exp_m1();
        let half_hz = self.request.doppler_half_width_hz;
        Candidate {
            statistic: upper_quantile(self.statistics.noncoherent_sums, above),
            code_phase_chips: 1023.0 * generator.random::<f64>(),
            doppler_hz: self.request.doppler_centre_hz
                + half_hz * (2.0 * generator.random::<f64>() - 1.0),
            cn0_hz: 0.0,
        }
        .with_noise_cn0(self)
    }

    /// The strongest ray of a transmitter, where it lies in the Doppler range.
    fn strongest(&self, bank: &mut CorrelatorLevelBank, index: usize) -> Result<Option<Standing>> {
        let start_s = bank.timeline.elapsed_s(self.request.start_tick);
        let middle_s = start_s + 0.5 * self.duration_s();
        let (segment, _) = bank.tracks[index].segment(middle_s)?;
        let x_s = middle_s - segment.middle_s;
        let rays = segment.rays.iter();
        let strongest = rays.max_by(|a, b| a.amplitude.at(x_s).total_cmp(&b.amplitude.at(x_s)));
        let half_hz = self.request.doppler_half_width_hz + 0.5 * self.statistics.doppler_step_hz;
        Ok(strongest
            .map(|ray| {
                let doppler_hz = ray.cycles.slope(x_s);
                let back = ray.chips.slope(x_s) * 0.5 * self.duration_s();
                Standing {
                    doppler_hz,
                    code_phase_chips: wrapped(ray.chips.at(x_s) - back),
                }
            })
            .filter(|s| (s.doppler_hz - self.request.doppler_centre_hz).abs() <= half_hz))
    }

    fn detect(
        &self,
        bank: &mut CorrelatorLevelBank,
        standing: Standing,
        generator: &mut ChaCha8Rng,
    ) -> Result<Candidate> {
        let step = self.statistics.code_step_chips;
        let cell = (standing.code_phase_chips / step).round() * step;
        let off_cell = standing.code_phase_chips - cell;
        let hz = self.statistics.doppler_step_hz;
        let bins = (standing.doppler_hz - self.request.doppler_centre_hz) / hz;
        let bin_hz = self.request.doppler_centre_hz + bins.round() * hz;
        let sums = self.block_sums(bank, standing, bin_hz, off_cell)?;
        let powers = |tap: usize| -> f64 { sums.iter().map(|s| s[tap].norm_sqr()).sum() };
        let noisy = sums
            .iter()
            .map(|s| (s[3] + complex_normal(generator)).norm_sqr());
        let statistic = noisy.sum::<f64>() / sums.len() as f64;
        // A tap that is late by k peaks on a signal early by k.
        let shift = -FIT_CHIPS * vertex(powers(0), powers(1), powers(2));

        let exact = self.block_sums(bank, standing, standing.doppler_hz, 0.0)?;
        let cn0_hz = power_without_bits(&exact) / self.block_s() / self.band_gain;
        let snr = (cn0_hz * self.duration_s()).max(1.0);
        let code = (CODE_VARIANCE / snr).sqrt() * normal(generator);
        let linked = 1.0 + (self.duration_s() / LINKED_S).powi(2);
        let doppler =
            (DOPPLER_VARIANCE * linked / snr).sqrt() / self.duration_s() * normal(generator);
        let estimated = cn0_hz * (1.0 + (2.0 / snr).sqrt() * normal(generator));
        Ok(Candidate {
            statistic,
            code_phase_chips: wrapped(standing.code_phase_chips + shift + code),
            doppler_hz: standing.doppler_hz + doppler,
            cn0_hz: estimated,
        })
    }

    /// Noise-free coherent sums of every block in units of their noise, at a Doppler: a quarter
    /// chip early, at the code phase, as much late, and `off_chips` late.
    fn block_sums(
        &self,
        bank: &mut CorrelatorLevelBank,
        standing: Standing,
        doppler_hz: f64,
        off_chips: f64,
    ) -> Result<Vec<[Complex64; 4]>> {
        let spec = self.signal.spec();
        let rate_hz = bank.front_end.sample_rate_hz;
        let code_rate_hz = spec.code_rate_hz * (1.0 + standing.doppler_hz / spec.carrier_hz);
        let block = |k: u32| {
            let ticks = f64::from(k) * self.block_s() * rate_hz;
            self.request.start_tick + ticks.round() as u64
        };
        let mut taps = [0.0; MAX_TAPS];
        taps[..4].copy_from_slice(&[-FIT_CHIPS, 0.0, FIT_CHIPS, off_chips]);
        let offsets = TapOffsets::new(&taps[..4])?;
        let mut all = Vec::with_capacity(self.statistics.noncoherent_sums as usize);
        for k in 0..self.statistics.noncoherent_sums {
            let (start_tick, end_tick) = (block(k), block(k + 1).min(bank.timeline.length_ticks));
            if end_tick <= start_tick {
                break;
            }
            let reception = bank.reception(self.signal, start_tick, end_tick, doppler_hz)?;
            let samples = (end_tick - start_tick) as f64;
            let since_s = (start_tick - self.request.start_tick) as f64 / rate_hz;
            let replica = Replica {
                signal: self.signal,
                start_tick,
                end_tick,
                code_phase_chips: wrapped(standing.code_phase_chips + code_rate_hz * since_s),
                code_rate_hz,
                carrier_phase_cycles: 0.0,
                carrier_frequency_hz: bank.front_end.intermediate_frequency_hz + doppler_hz,
                tap_offsets: offsets,
            };
            let density = reception.density * bank.model.carrier_part;
            let sum = SignalSum {
                timeline: &bank.timeline,
                replica: &replica,
                correlation: &BAND_LIMITED,
                taps_chips: &taps,
                signal_grid: None,
                intermediate_frequency_hz: bank.front_end.intermediate_frequency_hz,
                scale: reception.scale * (self.band_gain / (density * samples)).sqrt(),
            };
            let mut sums = [Complex64::default(); 4];
            for track in bank.tracks.iter_mut().filter(|t| t.signal == self.signal) {
                sum.add(track, &mut sums)?;
            }
            all.push(sums);
        }
        Ok(all)
    }

    fn hit(&self, found: &Candidate) -> AcquisitionHit {
        AcquisitionHit {
            signal: self.signal,
            tick: self.request.start_tick,
            code_phase_chips: found.code_phase_chips,
            doppler_hz: found.doppler_hz,
            statistic: found.statistic,
            threshold: self.statistics.threshold,
            cn0_dbhz: 10.0 * found.cn0_hz.max(1.0).log10(),
        }
    }
}

impl Candidate {
    /// The C/N0 that a peak of noise feigns.
    fn with_noise_cn0(mut self, search: &Search) -> Self {
        self.cn0_hz = (self.statistic - 1.0).max(0.0) / search.block_s() / search.band_gain;
        self
    }
}

/// Mean power of the prompt sums of blocks, as it were without bits, which the engine finds: of two
/// neighbours of half a bit at most, one has no change of sign in it.
fn power_without_bits(blocks: &[[Complex64; 4]]) -> f64 {
    let whole = |pair: &[[Complex64; 4]]| {
        let powers = pair.iter().map(|sums| sums[1].norm_sqr());
        powers.fold(0.0, f64::max)
    };
    let pairs = blocks.chunks(2);
    let count = pairs.len().max(1) as f64;
    pairs.map(whole).sum::<f64>() / count
}

/// A code phase in [0, code length), chips.
fn wrapped(chips: f64) -> f64 {
    let phase = chips.rem_euclid(1023.0);
    if phase < 1023.0 { phase } else { 0.0 }
}

/// Place of the maximum of the parabola through values at -1, 0, 1; within them.
fn vertex(before: f64, middle: f64, after: f64) -> f64 {
    let curvature = before - 2.0 * middle + after;
    if curvature < 0.0 {
        (0.5 * (before - after) / curvature).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}

/// The mean of `sums` unit powers of complex noise that is exceeded with probability `above`.
fn upper_quantile(sums: u32, above: f64) -> f64 {
    let degrees = 2.0 * f64::from(sums);
    let Ok(distribution) = ChiSquared::new(degrees) else {
        return 0.0;
    };
    let (mut low, mut high) = (0.0, 2.0 * degrees + 1e3);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if distribution.sf(middle) > above {
            low = middle;
        } else {
            high = middle;
        }
    }
    high / degrees
}

/// The peak of the code's autocorrelation cut to the band of the search.
static BAND_LIMITED: LazyLock<CodeCorrelation> = LazyLock::new(band_limited);

fn band_limited() -> CodeCorrelation {
    const STEPS: u32 = 200;
    let weight = |x: f64| {
        let half_turn = std::f64::consts::PI * x;
        (half_turn.sin() / half_turn).powi(2)
    };
    let frequency = |k: u32| BAND_CHIP_RATES * (f64::from(k) + 0.5) / f64::from(STEPS);
    let lines: Vec<_> = (0..STEPS)
        .map(|k| (frequency(k), weight(frequency(k))))
        .collect();
    let total: f64 = lines.iter().map(|(_, weight)| weight).sum();
    CodeCorrelation::peak(|lag| {
        let lines = lines.iter();
        let sum: f64 = lines
            .map(|(frequency, weight)| weight * (TAU * frequency * lag).cos())
            .sum();
        sum / total
    })
}
