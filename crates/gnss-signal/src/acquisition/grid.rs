//! What a search covers: blocks of samples and Doppler bins, from a checked request.

use super::{MAX_COHERENT_PERIODS, MAX_PERIODS, code_period_s};
use crate::{FrontEnd, SearchRequest, SignalError};

/// Widest Doppler range, either side of its centre, Hz: a shift of a fifth of the band.
const MAX_HALF_WIDTH_HZ: f64 = 200e3;
/// Independent cells in one of the fine grid, whose neighbours (a quarter chip, a quarter bin) are
/// correlated: a little more than simulated noise shows, to keep the promise from the safe side.
const INDEPENDENT_PART: f64 = 0.7;
/// Part of the last block that samples may lack.
const MISSING_PART: f64 = 0.05;

/// Blocks and Doppler bins of one search.
///
/// Doppler bins are counted in quarters of the inverse coherent time: coarse bins are the even
/// ones, so two to the inverse coherent time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    /// Code periods in a block.
    pub(super) coherent: usize,
    /// Blocks summed by power.
    pub(super) blocks: usize,
    /// Coarse bins either side of the centre.
    pub(super) half_bins: i64,
    centre_hz: f64,
}

impl Grid {
    /// The part of `request` that `samples` samples suffice for.
    pub(super) fn new(
        front_end: FrontEnd,
        request: &SearchRequest,
        samples: usize,
    ) -> Result<Self, SignalError> {
        check(request)?;
        let block_s = f64::from(request.coherent_periods) * code_period_s();
        let held = samples as f64 / (front_end.sample_rate_hz * block_s) + MISSING_PART;
        let blocks = (held.floor() as u64).min(u64::from(request.noncoherent_sums));
        if blocks == 0 {
            return Err(SignalError::Parameter {
                name: "samples for a search",
                value: samples.to_string(),
                expected: "at least one coherent integration",
            });
        }
        Ok(Self {
            coherent: request.coherent_periods as usize,
            blocks: blocks as usize,
            half_bins: (request.doppler_half_width_hz * 2.0 * block_s).ceil() as i64,
            centre_hz: request.doppler_centre_hz,
        })
    }

    /// Duration of one block, s.
    pub(super) fn block_s(&self) -> f64 {
        self.coherent as f64 * code_period_s()
    }

    /// Doppler of bin `quarter`, Hz.
    pub(super) fn doppler_hz(&self, quarter: i64) -> f64 {
        self.centre_hz + quarter as f64 / (4.0 * self.block_s())
    }

    /// Bin `quarter` as a whole number of lines of the code spectrum, and the quarters left over.
    pub(super) fn lines_and_residue(&self, quarter: i64) -> (i64, i64) {
        let per_line = 4 * self.coherent as i64;
        (quarter.div_euclid(per_line), quarter.rem_euclid(per_line))
    }

    /// Independent cells of the fine grid for one code.
    pub(super) fn cells_per_code(&self) -> f64 {
        let cells = (4 * self.half_bins + 1) as f64 * super::FINE_POINTS as f64;
        INDEPENDENT_PART * cells
    }

    /// Code periods covered.
    pub(super) fn periods(&self) -> usize {
        self.coherent * self.blocks
    }
}

fn check(request: &SearchRequest) -> Result<(), SignalError> {
    let refuse = |name, value, expected| {
        Err(SignalError::Parameter {
            name,
            value,
            expected,
        })
    };
    let periods = u64::from(request.coherent_periods) * u64::from(request.noncoherent_sums);
    let probability = request.false_alarm_probability;
    let (centre_hz, half_hz) = (request.doppler_centre_hz, request.doppler_half_width_hz);
    if !(1..=MAX_COHERENT_PERIODS).contains(&request.coherent_periods) {
        let value = request.coherent_periods.to_string();
        return refuse("coherent integration (code periods)", value, "1 to 20");
    }
    if !(1..=MAX_PERIODS).contains(&periods) {
        return refuse(
            "search length (code periods)",
            periods.to_string(),
            "1 to 500",
        );
    }
    if !(probability > 0.0 && probability < 1.0) {
        let value = probability.to_string();
        return refuse("false-alarm probability", value, "above 0 and below 1");
    }
    if !(0.0..=MAX_HALF_WIDTH_HZ).contains(&half_hz) {
        return refuse(
            "half Doppler range (Hz)",
            half_hz.to_string(),
            "0 to 200000",
        );
    }
    if !centre_hz.abs().le(&MAX_HALF_WIDTH_HZ) {
        let expected = "-200000 to 200000";
        return refuse("Doppler centre (Hz)", centre_hz.to_string(), expected);
    }
    Ok(())
}
