//! Parallel code phase search of one code: coarse grid, then the best cells on a finer one.
//!
//! What stands out of a Doppler bin need not be the satellite: the codes of stronger ones, and
//! interference that repeats with the code period (tones, a comb from a digital bus), leave a
//! pattern over the code phases that stays the same from block to block. Such clutter shows in the
//! mean of the bin over all code phases: by the excess over the other bins. Its peaks are
//! distributed at worst as powers of complex noise of that mean, so a cell has to exceed the
//! threshold by what a single such power can reach. (The cross-correlation of two C/A codes is
//! milder: its largest power, at -21.6 dB, is 7 times its mean.)

use std::sync::Arc;

use num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::kernels;
use super::spectra::Spectra;
use super::threshold::Thresholds;
use super::{ACQUISITION_RATE_HZ, FINE_POINTS, POINTS};
use crate::Signal;

/// Coarse cells of one code looked at again on the fine grid.
const CANDIDATES: usize = 3;
/// A cell is looked at again where it exceeds the noise by at least this part of what the
/// threshold does: the coarse grid loses at most 2.1 dB against the fine one (a quarter chip
/// 1.2 dB, a quarter bin 0.9 dB), the rest is for noise.
const PROMISING_PART: f64 = 0.5;
/// Chips either side of a peak left out of the noise mean.
const PEAK_CHIPS: usize = 2;

/// A cell of the search grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    /// Doppler bin, quarters of the inverse coherent time.
    pub(super) quarter: i64,
    /// Delay of the code's start after the first sample, acquisition samples.
    pub(super) delay_samples: f64,
    /// Power over the mean under noise, less what clutter may add.
    pub(super) statistic: f64,
}

/// What one code shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CodeSearch {
    /// Best cells, best first.
    pub(super) cells: Vec<Cell>,
    /// Mean power of one block under noise, correlator units.
    pub(super) noise_power: f64,
}

/// Best cell and mean of one coarse Doppler bin.
struct BinSummary {
    bin: i64,
    point: usize,
    power: f64,
    mean: f64,
}

/// Transforms and buffers of one searching thread.
pub(super) struct Searcher {
    coarse: Arc<dyn Fft<f32>>,
    fine: Arc<dyn Fft<f32>>,
    product: Vec<Complex32>,
    scratch: Vec<Complex32>,
    power: Vec<f32>,
}

impl Searcher {
    pub(super) fn new(planner: &mut FftPlanner<f32>) -> Self {
        let coarse = planner.plan_fft_inverse(POINTS);
        let fine = planner.plan_fft_inverse(FINE_POINTS);
        let scratch = coarse
            .get_inplace_scratch_len()
            .max(fine.get_inplace_scratch_len());
        Self {
            coarse,
            fine,
            product: vec![Complex32::default(); FINE_POINTS],
            scratch: vec![Complex32::default(); scratch],
            power: vec![0.0; FINE_POINTS],
        }
    }

    /// Searches all bins for the code with the conjugated spectrum `code`.
    pub(super) fn search(
        &mut self,
        spectra: &Spectra,
        code: &[Complex32],
        thresholds: Thresholds,
    ) -> CodeSearch {
        let half_bins = spectra.grid().half_bins;
        let bins: Vec<BinSummary> = (-half_bins..=half_bins)
            .map(|bin| {
                self.sum_powers(spectra, code, 2 * bin, POINTS);
                summarise(bin, &self.power[..POINTS])
            })
            .collect();
        let noise = median(bins.iter().map(|bin| bin.mean).collect());
        let promising = 1.0 + PROMISING_PART * (thresholds.sum - 1.0);
        let mut cells: Vec<Cell> = separate_peaks(bins)
            .into_iter()
            .enumerate()
            .filter(|(rank, bin)| *rank == 0 || bin.power >= promising * noise)
            .map(|(_, bin)| self.resolve(spectra, code, &bin, noise, thresholds))
            .collect();
        cells.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
        CodeSearch {
            cells,
            noise_power: noise / spectra.grid().blocks as f64,
        }
    }

    /// The best cell of the fine grid around the peak of a coarse bin.
    fn resolve(
        &mut self,
        spectra: &Spectra,
        code: &[Complex32],
        peak: &BinSummary,
        noise: f64,
        thresholds: Thresholds,
    ) -> Cell {
        let limit = 2 * spectra.grid().half_bins;
        // Two standard deviations of the mean of a bin of noise.
        let spread = 2.0 / (1023.0 * spectra.grid().blocks as f64).sqrt();
        let mut best = Cell {
            quarter: 2 * peak.bin,
            delay_samples: peak.point as f64,
            statistic: 0.0,
        };
        let quarters = 2 * peak.bin - 1..=2 * peak.bin + 1;
        for quarter in quarters.filter(|quarter| quarter.abs() <= limit) {
            self.sum_powers(spectra, code, quarter, FINE_POINTS);
            let mean = summarise(quarter, &self.power).mean;
            let clutter = thresholds.single * (mean / noise - 1.0 - spread).max(0.0);
            for offset in 0..5 {
                let point = (2 * peak.point + FINE_POINTS + offset - 2) % FINE_POINTS;
                let statistic = f64::from(self.power[point]) / noise - clutter;
                if statistic > best.statistic {
                    let samples_per_point = POINTS as f64 / FINE_POINTS as f64;
                    best = Cell {
                        quarter,
                        delay_samples: point as f64 * samples_per_point,
                        statistic,
                    };
                }
            }
        }
        best
    }

    /// Sums the correlation powers of all blocks in one Doppler bin over `points` code phases,
    /// each block shifted by its code Doppler to the code phases of the first sample.
    fn sum_powers(&mut self, spectra: &Spectra, code: &[Complex32], quarter: i64, points: usize) {
        let grid = spectra.grid();
        let (lines, blocks) = spectra.shifted(quarter);
        let transform = if points == POINTS {
            &self.coarse
        } else {
            &self.fine
        };
        let product = &mut self.product[..points];
        let power = &mut self.power[..points];
        power.fill(0.0);
        let slip_per_s = code_slip(grid.doppler_hz(quarter)) * points as f64 / POINTS as f64;
        for (index, block) in blocks.chunks_exact(POINTS).enumerate() {
            multiply(block, lines, code, product);
            transform.process_with_scratch(product, &mut self.scratch);
            let middle_s = (index as f64 + 0.5) * grid.block_s();
            let slip = (slip_per_s * middle_s).round() as i64;
            let slip = (-slip).rem_euclid(points as i64) as usize;
            kernels::add_powers(&product[slip..], &mut power[..points - slip]);
            kernels::add_powers(&product[..slip], &mut power[points - slip..]);
        }
    }
}

/// Acquisition samples per second by which a code with Doppler comes early.
pub(super) fn code_slip(doppler_hz: f64) -> f64 {
    doppler_hz / Signal::GpsL1Ca.spec().carrier_hz * ACQUISITION_RATE_HZ
}

/// Spectrum of the correlation of a block, moved down by `lines`, with a code, zero-padded to the
/// length of `product`.
fn multiply(block: &[Complex32], lines: i64, code: &[Complex32], product: &mut [Complex32]) {
    let half = POINTS / 2;
    let first = lines.rem_euclid(POINTS as i64) as usize;
    let padded = product.len();
    product[half..padded - half].fill(Complex32::default());
    let (low, high) = code.split_at(half);
    multiply_from(block, first, low, &mut product[..half]);
    multiply_from(
        block,
        (first + half) % POINTS,
        high,
        &mut product[padded - half..],
    );
}

/// `product[k] = block[(first + k) mod length] * code[k]`.
fn multiply_from(block: &[Complex32], first: usize, code: &[Complex32], product: &mut [Complex32]) {
    let until_wrap = (block.len() - first).min(code.len());
    let (code_before, code_after) = code.split_at(until_wrap);
    let (before, after) = product.split_at_mut(until_wrap);
    kernels::multiply(&block[first..], code_before, before);
    kernels::multiply(block, code_after, after);
}

/// Peak of a coarse bin and the mean of what is not within two chips of it.
fn summarise(bin: i64, power: &[f32]) -> BinSummary {
    let (mut point, mut peak) = (0, f32::MIN);
    let mut lanes = [0.0_f32; 16];
    for (chunk, values) in power.chunks_exact(16).enumerate() {
        let mut largest = values[0];
        for (lane, value) in lanes.iter_mut().zip(values) {
            *lane += value;
            largest = largest.max(*value);
        }
        if largest > peak {
            peak = largest;
            point = 16 * chunk + values.iter().position(|v| *v == largest).unwrap_or(0);
        }
    }
    let total: f64 = lanes.iter().map(|lane| f64::from(*lane)).sum();
    let reach = PEAK_CHIPS * power.len() / 1023;
    let near: f64 = (0..=2 * reach)
        .map(|k| f64::from(power[(point + power.len() + k - reach) % power.len()]))
        .sum();
    BinSummary {
        bin,
        point,
        power: f64::from(peak),
        mean: (total - near) / (power.len() - 2 * reach - 1) as f64,
    }
}

/// The best [`CANDIDATES`] bins whose peaks are not one and the same.
fn separate_peaks(mut bins: Vec<BinSummary>) -> Vec<BinSummary> {
    bins.sort_by(|a, b| b.power.total_cmp(&a.power));
    let mut kept: Vec<BinSummary> = Vec::new();
    for bin in bins {
        let seen = kept.iter().any(|other| {
            let apart = bin.point.abs_diff(other.point);
            (bin.bin - other.bin).abs() <= 2 && apart.min(POINTS - apart) <= 2
        });
        if !seen {
            kept.push(bin);
        }
        if kept.len() == CANDIDATES {
            break;
        }
    }
    kept
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
