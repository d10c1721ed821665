//! Doppler, code phase and C/N0 of a detection, from partial sums of one code period each.
//!
//! The sums of a data bit are added coherently, for every position the bit edge can have, and
//! neighbouring bits with whichever relative sign gives more power. (Without that sign, one change
//! of sign in a few milliseconds looks like a frequency half a bin off.)

use num_complex::{Complex32, Complex64};
use rustfft::FftPlanner;

use super::search::{Cell, code_slip};
use super::spectra::{Spectra, wipe_off};
use super::{POINTS, code_period_s};
use crate::Signal;

/// Positions of the code replica within one acquisition sample: 1/16 chip apart.
const SUBSAMPLES: usize = 8;
/// Replica positions between the three points of the code phase fit: a quarter chip, where the
/// band-limited correlation is still a parabola.
const FIT_STEP: i64 = 4;
/// Replica positions searched either side of the detected cell.
const FIT_RANGE: i64 = 5;
/// Frequencies tried within the inverse of the longest coherent sum.
const STEPS_PER_BIN: f64 = 8.0;

/// Farthest that the Doppler may lie from the detected bin, Hz: a quarter of a bin of the shortest
/// coherent integration, and noise.
const MAX_RANGE_HZ: f64 = 300.0;
/// Periods from which on the phases of their sums say more than the power within each.
const PHASE_PERIODS: usize = 3;

/// Refined values of one detection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Refined {
    pub(super) doppler_hz: f64,
    /// Delay of the code's start after the first sample, acquisition samples.
    pub(super) delay_samples: f64,
    /// Power of the signal in one code period over that of the noise.
    pub(super) period_snr: f64,
}

/// Frequency and data bit edge that fit best, and how well.
#[derive(Debug, Clone, Copy)]
struct BitFit {
    offset_hz: f64,
    /// Periods before the first bit edge.
    edge: usize,
    power: f64,
}

/// Replica of one code at every [`SUBSAMPLES`]th of a sample, in the units of the search.
struct Replicas(Vec<Vec<f32>>);

/// Refines `cell`, whose noise has the power `noise_power` in one code period.
pub(super) fn refine(
    spectra: &Spectra,
    code: &[Complex32],
    cell: Cell,
    noise_power: f64,
    planner: &mut FftPlanner<f32>,
) -> Refined {
    let replicas = Replicas::new(code, planner);
    // A change of sign inside a coherent block splits its peak: 0.8 of a bin covers both parts.
    let range_hz = (0.8 / spectra.grid().block_s()).min(MAX_RANGE_HZ);
    let mut doppler_hz = spectra.grid().doppler_hz(cell.quarter);
    let mut position = (cell.delay_samples * SUBSAMPLES as f64).round() as i64;
    if spectra.grid().periods() < PHASE_PERIODS {
        doppler_hz += power_vertex(spectra, &replicas, doppler_hz, position);
    }
    let sums = partial_sums(spectra, &replicas, doppler_hz, position);
    let fit = best_fit(&sums, range_hz);
    doppler_hz += fit.offset_hz;
    let delay_samples = fit_delay(spectra, &replicas, doppler_hz, position, fit.edge);
    position = (delay_samples * SUBSAMPLES as f64).round() as i64;
    let sums = partial_sums(spectra, &replicas, doppler_hz, position);
    let fit = best_fit(&sums, 0.25 * range_hz);
    Refined {
        doppler_hz: doppler_hz + fit.offset_hz,
        delay_samples: delay_samples.rem_euclid(POINTS as f64),
        period_snr: period_snr(&sums, fit, noise_power),
    }
}

/// Distance to the Doppler of the largest power of single periods, Hz.
fn power_vertex(spectra: &Spectra, replicas: &Replicas, doppler_hz: f64, position: i64) -> f64 {
    let step_hz = 0.25 / code_period_s();
    let power = |offset_hz: f64| -> f64 {
        partial_sums(spectra, replicas, doppler_hz + offset_hz, position)
            .iter()
            .map(Complex64::norm_sqr)
            .sum()
    };
    step_hz * vertex(power(-step_hz), power(0.0), power(step_hz))
}

impl Replicas {
    fn new(code: &[Complex32], planner: &mut FftPlanner<f32>) -> Self {
        let inverse = planner.plan_fft_inverse(POINTS);
        let replica = |position: usize| {
            let delay = position as f64 / SUBSAMPLES as f64;
            let mut spectrum: Vec<Complex32> = code
                .iter()
                .enumerate()
                .map(|(k, line)| {
                    let line_number = k as f64 - if k < POINTS / 2 { 0.0 } else { POINTS as f64 };
                    let turns = -line_number * delay / POINTS as f64;
                    let ramp = Complex64::from_polar(1.0, std::f64::consts::TAU * turns);
                    line.conj() * Complex32::new(ramp.re as f32, ramp.im as f32)
                })
                .collect();
            inverse.process(&mut spectrum);
            spectrum.iter().map(|value| value.re).collect()
        };
        Self((0..SUBSAMPLES).map(replica).collect())
    }

    /// Correlates one code period with the replica delayed by `position`.
    fn correlate(&self, samples: &[Complex32], position: i64) -> Complex32 {
        let turned = position.rem_euclid((POINTS * SUBSAMPLES) as i64) as usize;
        let replica = &self.0[turned % SUBSAMPLES];
        let (before, after) = samples.split_at(turned / SUBSAMPLES);
        let (head, tail) = replica.split_at(POINTS - before.len());
        dot(after, head) + dot(before, tail)
    }
}

fn dot(samples: &[Complex32], replica: &[f32]) -> Complex32 {
    let mut lanes = [Complex32::default(); 8];
    let chunks = samples.chunks_exact(8).zip(replica.chunks_exact(8));
    for (samples, replica) in chunks {
        for ((lane, sample), value) in lanes.iter_mut().zip(samples).zip(replica) {
            *lane += sample * value;
        }
    }
    let whole = samples.len() / 8 * 8;
    let rest = samples[whole..].iter().zip(&replica[whole..]);
    lanes.iter().sum::<Complex32>() + rest.map(|(s, r)| s * r).sum::<Complex32>()
}

/// One prompt sum for every code period, at a Doppler and a replica position (at the first sample;
/// later ones move with the code Doppler).
fn partial_sums(
    spectra: &Spectra,
    replicas: &Replicas,
    doppler_hz: f64,
    position: i64,
) -> Vec<Complex64> {
    let carrier = wipe_off(doppler_hz, POINTS);
    let mut mixed = vec![Complex32::default(); POINTS];
    spectra
        .periods()
        .enumerate()
        .map(|(period, samples)| {
            mix(samples, &carrier, &mut mixed);
            let sum = replicas.correlate(&mixed, moved(position, doppler_hz, period));
            let cycles = doppler_hz * code_period_s() * period as f64;
            let turn = Complex64::from_polar(1.0, -std::f64::consts::TAU * cycles.fract());
            Complex64::new(f64::from(sum.re), f64::from(sum.im)) * turn
        })
        .collect()
}

/// Replica position in the middle of code period `period`.
fn moved(position: i64, doppler_hz: f64, period: usize) -> i64 {
    let time_s = (period as f64 + 0.5) * code_period_s();
    position - (code_slip(doppler_hz) * time_s * SUBSAMPLES as f64).round() as i64
}

fn mix(samples: &[Complex32], carrier: &[Complex32], mixed: &mut [Complex32]) {
    for ((mixed, sample), carrier) in mixed.iter_mut().zip(samples).zip(carrier) {
        *mixed = sample * carrier;
    }
}

/// Best frequency within `range_hz` of the one wiped off, over all positions of the bit edge.
fn best_fit(sums: &[Complex64], range_hz: f64) -> BitFit {
    let bit = Signal::GpsL1Ca.spec().code_periods_per_bit as usize;
    if sums.len() < PHASE_PERIODS {
        return best_edge(sums, 0.0);
    }
    let longest = sums.len().min(bit);
    let step_hz = 1.0 / (STEPS_PER_BIN * longest as f64 * code_period_s());
    let steps = (range_hz / step_hz).ceil() as i64;
    let at = |offset_hz: f64| best_edge(sums, offset_hz);
    let fits: Vec<BitFit> = (-steps..=steps).map(|k| at(k as f64 * step_hz)).collect();
    let best = fits
        .iter()
        .copied()
        .max_by(|a, b| a.power.total_cmp(&b.power))
        .unwrap_or_else(|| at(0.0));
    let power = |offset_hz: f64| edge_power(&running_sums(sums, offset_hz), best.edge);
    let shift = vertex(
        power(best.offset_hz - step_hz),
        best.power,
        power(best.offset_hz + step_hz),
    );
    let offset_hz = best.offset_hz + shift * step_hz;
    BitFit { offset_hz, ..best }
}

fn best_edge(sums: &[Complex64], offset_hz: f64) -> BitFit {
    let bit = Signal::GpsL1Ca.spec().code_periods_per_bit as usize;
    let running = running_sums(sums, offset_hz);
    let mut best = BitFit {
        offset_hz,
        edge: 0,
        power: edge_power(&running, 0),
    };
    for edge in 1..bit.min(sums.len()) {
        let power = edge_power(&running, edge);
        if power > best.power {
            best = BitFit {
                offset_hz,
                edge,
                power,
            };
        }
    }
    best
}

/// Sums of all periods before each, with `offset_hz` wiped off.
fn running_sums(sums: &[Complex64], offset_hz: f64) -> Vec<Complex64> {
    let turn = -std::f64::consts::TAU * offset_hz * code_period_s();
    let mut total = Complex64::default();
    let mut running = vec![total];
    for (period, sum) in sums.iter().enumerate() {
        total += sum * Complex64::from_polar(1.0, turn * period as f64);
        running.push(total);
    }
    running
}

/// Ends of the data bits within `periods`, where the first ends after `edge` periods (zero: a bit
/// begins with the first).
fn bit_ends(periods: usize, edge: usize) -> impl Iterator<Item = usize> {
    let bit = Signal::GpsL1Ca.spec().code_periods_per_bit as usize;
    let first = if edge == 0 { bit } else { edge };
    (first..periods).step_by(bit).chain([periods])
}

/// Sums of each data bit.
fn bit_sums(running: &[Complex64], edge: usize) -> impl Iterator<Item = Complex64> {
    let mut start = 0;
    bit_ends(running.len() - 1, edge).map(move |end| {
        let sum = running[end] - running[start];
        start = end;
        sum
    })
}

/// Power of the bits and of each with the next, at the relative sign that gives more.
fn edge_power(running: &[Complex64], edge: usize) -> f64 {
    let mut last = Complex64::default();
    let mut power = 0.0;
    for bit in bit_sums(running, edge) {
        power += bit.norm_sqr() + 2.0 * (bit * last.conj()).re.abs();
        last = bit;
    }
    power
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

/// Delay at which the power, added up as `edge` says, is largest; acquisition samples.
fn fit_delay(
    spectra: &Spectra,
    replicas: &Replicas,
    doppler_hz: f64,
    position: i64,
    edge: usize,
) -> f64 {
    let reach = FIT_RANGE + FIT_STEP;
    let powers: Vec<f64> = (-reach..=reach)
        .map(|k| {
            let sums = partial_sums(spectra, replicas, doppler_hz, position + k);
            edge_power(&running_sums(&sums, 0.0), edge)
        })
        .collect();
    let inner = FIT_STEP as usize..powers.len() - FIT_STEP as usize;
    let step = FIT_STEP as usize;
    let best = inner
        .max_by(|a, b| powers[*a].total_cmp(&powers[*b]))
        .unwrap_or(step);
    let shift = vertex(powers[best - step], powers[best], powers[best + step]) * step as f64;
    (position as f64 + best as f64 - reach as f64 + shift) / SUBSAMPLES as f64
}

/// Signal over noise power in one period: a sum over L periods has signal power L^2 and noise
/// power L in units of those of one.
fn period_snr(sums: &[Complex64], fit: BitFit, noise_power: f64) -> f64 {
    let running = running_sums(sums, fit.offset_hz);
    let power: f64 = bit_sums(&running, fit.edge).map(|bit| bit.norm_sqr()).sum();
    let mut start = 0;
    let mut square_lengths = 0.0;
    for end in bit_ends(sums.len(), fit.edge) {
        square_lengths += ((end - start) as f64).powi(2);
        start = end;
    }
    (power / noise_power - sums.len() as f64) / square_lengths
}
