//! What a search comes down to statistically, for those who draw its result instead of searching.

use super::grid::Grid;
use super::{AcquisitionEngine, FINE_POINTS, request_thresholds};
use crate::{FrontEnd, SearchRequest, Signal, SignalError};

/// Cells, sums and threshold of a [`SearchRequest`].
///
/// Under white noise the statistic of a cell is the mean of [`Self::noncoherent_sums`] powers of
/// complex Gaussian noise of unit mean power.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchStatistics {
    /// Code periods added coherently.
    pub coherent_periods: u32,
    /// Powers added, as many as the samples allow.
    pub noncoherent_sums: u32,
    /// Independent cells searched for each code.
    pub cells_per_code: f64,
    /// Threshold of the statistic.
    pub threshold: f64,
    /// From one Doppler of the grid to the next, Hz; the middle of the range is one of them.
    pub doppler_step_hz: f64,
    /// From one code phase of the grid to the next, chips; zero is one of them.
    pub code_step_chips: f64,
}

impl AcquisitionEngine {
    /// What `request` comes down to where `samples` samples of `front_end` are held.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] as [`AcquisitionEngine::search`].
    pub fn statistics(
        front_end: FrontEnd,
        request: &SearchRequest,
        samples: usize,
    ) -> Result<SearchStatistics, SignalError> {
        let grid = Grid::new(front_end, request, samples)?;
        let chips = f64::from(Signal::GpsL1Ca.spec().code_length_chips);
        Ok(SearchStatistics {
            coherent_periods: grid.coherent as u32,
            noncoherent_sums: grid.blocks as u32,
            cells_per_code: grid.cells_per_code(),
            threshold: request_thresholds(grid, request)?.sum,
            doppler_step_hz: 0.25 / grid.block_s(),
            code_step_chips: chips / FINE_POINTS as f64,
        })
    }
}
