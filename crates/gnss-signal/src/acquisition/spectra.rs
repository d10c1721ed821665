//! Spectra of folded blocks, shared by every code searched.

use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use rustfft::{Fft, FftPlanner};

use super::grid::Grid;
use super::{ACQUISITION_RATE_HZ, POINTS};

/// Baseband samples and the spectra of their blocks.
pub(super) struct Spectra {
    grid: Grid,
    baseband: Vec<Complex32>,
    forward: Arc<dyn Fft<f32>>,
    /// Spectra of all blocks for each coarse bin within one line of the code spectrum.
    coarse: Vec<Vec<Complex32>>,
}

impl Spectra {
    pub(super) fn new(grid: Grid, baseband: Vec<Complex32>, planner: &mut FftPlanner<f32>) -> Self {
        let mut spectra = Self {
            grid,
            baseband,
            forward: planner.plan_fft_forward(POINTS),
            coarse: Vec::new(),
        };
        spectra.coarse = (0..2 * grid.coherent as i64)
            .map(|bin| spectra.blocks_at(grid.doppler_hz(2 * bin)))
            .collect();
        spectra
    }

    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// Baseband samples of one code period after another.
    pub(super) fn periods(&self) -> impl Iterator<Item = &[Complex32]> {
        self.baseband.chunks_exact(POINTS)
    }

    /// Spectra, block after block, of the samples shifted down by the part of bin `quarter` that
    /// is no whole line; the caller shifts by the `lines` it returns.
    pub(super) fn shifted(&self, quarter: i64) -> (i64, std::borrow::Cow<'_, [Complex32]>) {
        let (lines, residue) = self.grid.lines_and_residue(quarter);
        let blocks = if residue % 2 == 0 {
            std::borrow::Cow::from(&self.coarse[residue as usize / 2])
        } else {
            std::borrow::Cow::from(self.blocks_at(self.grid.doppler_hz(residue)))
        };
        (lines, blocks)
    }

    /// Shifts every block down by `frequency_hz`, folds it to one code period and transforms it.
    fn blocks_at(&self, frequency_hz: f64) -> Vec<Complex32> {
        let block_points = POINTS * self.grid.coherent;
        let carrier = wipe_off(frequency_hz, block_points);
        let mut folded = vec![Complex32::default(); POINTS * self.grid.blocks];
        let blocks = self.baseband.chunks_exact(block_points);
        for (block, sum) in blocks.zip(folded.chunks_exact_mut(POINTS)) {
            let periods = block.chunks_exact(POINTS).zip(carrier.chunks_exact(POINTS));
            for (samples, carrier) in periods {
                for ((sum, sample), carrier) in sum.iter_mut().zip(samples).zip(carrier) {
                    *sum += sample * carrier;
                }
            }
        }
        self.forward.process(&mut folded);
        folded
    }
}

/// `points` values of exp(-2 pi i f t) at the acquisition rate.
pub(super) fn wipe_off(frequency_hz: f64, points: usize) -> Vec<Complex32> {
    let radians = -std::f64::consts::TAU * frequency_hz / ACQUISITION_RATE_HZ;
    let step = Complex64::from_polar(1.0, radians);
    let mut value = Complex64::new(1.0, 0.0);
    (0..points)
        .map(|_| {
            let now = Complex32::new(value.re as f32, value.im as f32);
            value *= step;
            now
        })
        .collect()
}
