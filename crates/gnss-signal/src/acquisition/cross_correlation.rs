//! Tells a satellite from what a stronger one leaves in the correlation with its code.

use num_complex::{Complex32, Complex64};
use rustfft::FftPlanner;

use super::grid::Grid;
use super::search::{Cell, code_slip};
use super::{ACQUISITION_RATE_HZ, POINTS};

/// A detection has to exceed what stronger satellites explain by this factor (6 dB: the
/// prediction is exact for constant data bits, but the detection is a maximum over cells with
/// noise, and the stronger satellite's own parameters are grid values).
const MARGIN: f64 = 4.0;

/// A detected cell of one code.
#[derive(Debug, Clone)]
pub(super) struct Detection {
    /// Position of its code in the request.
    pub(super) index: usize,
    pub(super) cell: Cell,
}

/// Keeps, of each code's cells above the threshold (best first), the best that the stronger
/// detections do not explain.
pub(super) fn without_cross_correlation(
    mut cells: Vec<Detection>,
    codes: &[&[Complex32]],
    grid: Grid,
    planner: &mut FftPlanner<f32>,
) -> Vec<Detection> {
    cells.sort_by(|a, b| b.cell.statistic.total_cmp(&a.cell.statistic));
    let mut replicas: Vec<Option<Vec<Complex32>>> = vec![None; codes.len()];
    let mut kept: Vec<Detection> = Vec::new();
    for found in cells {
        if kept.iter().any(|other| other.index == found.index) {
            continue;
        }
        for index in kept.iter().map(|k| k.index).chain([found.index]) {
            replicas[index].get_or_insert_with(|| replica(codes[index], planner));
        }
        let explained: f64 = kept
            .iter()
            .filter_map(|strong| {
                let strong_code = replicas[strong.index].as_deref()?;
                let weak_code = replicas[found.index].as_deref()?;
                let part = leakage(strong_code, strong.cell, weak_code, found.cell, grid);
                Some(part * (strong.cell.statistic - 1.0))
            })
            .sum();
        if found.cell.statistic - 1.0 > MARGIN * explained {
            kept.push(found);
        }
    }
    kept.sort_by_key(|found| found.index);
    kept
}

/// Time-domain code of a conjugated spectrum, of unit energy.
fn replica(code: &[Complex32], planner: &mut FftPlanner<f32>) -> Vec<Complex32> {
    let mut samples: Vec<Complex32> = code.iter().map(Complex32::conj).collect();
    planner.plan_fft_inverse(POINTS).process(&mut samples);
    let energy: f32 = samples.iter().map(Complex32::norm_sqr).sum();
    let scale = 1.0 / energy.sqrt();
    samples.iter().map(|sample| sample * scale).collect()
}

/// Part of the stronger signal's power that appears in the weaker one's cell, averaged over the
/// search.
fn leakage(
    strong_code: &[Complex32],
    strong: Cell,
    weak_code: &[Complex32],
    weak: Cell,
    grid: Grid,
) -> f64 {
    let strong_hz = grid.doppler_hz(strong.quarter);
    let weak_hz = grid.doppler_hz(weak.quarter);
    let difference_hz = strong_hz - weak_hz;
    let duration_s = grid.block_s() * grid.blocks as f64;
    let times = [1.0 / 6.0, 0.5, 5.0 / 6.0];
    let mean: f64 = times
        .iter()
        .map(|part| {
            let time_s = part * duration_s;
            let strong_delay = strong.delay_samples - code_slip(strong_hz) * time_s;
            let weak_delay = weak.delay_samples - code_slip(weak_hz) * time_s;
            let shift = (strong_delay - weak_delay).round() as i64;
            one_period(strong_code, weak_code, shift, difference_hz)
        })
        .sum::<f64>()
        / times.len() as f64;
    mean * coherent_gain(difference_hz, grid)
}

/// Squared correlation over one period of two codes `shift` samples and `difference_hz` apart.
fn one_period(strong: &[Complex32], weak: &[Complex32], shift: i64, difference_hz: f64) -> f64 {
    let shift = shift.rem_euclid(POINTS as i64) as usize;
    let turn = std::f64::consts::TAU * difference_hz / ACQUISITION_RATE_HZ;
    let step = Complex64::from_polar(1.0, turn);
    let mut carrier = Complex64::new(1.0, 0.0);
    let mut sum = Complex64::default();
    let shifted = weak[shift..].iter().chain(&weak[..shift]);
    for (strong, weak) in strong.iter().zip(shifted) {
        sum += carrier * f64::from(strong.re * weak.re);
        carrier *= step;
    }
    sum.norm_sqr()
}

/// Power that survives the coherent sum of a block's periods, of that in one.
fn coherent_gain(difference_hz: f64, grid: Grid) -> f64 {
    let periods = grid.coherent as f64;
    let half_turn = std::f64::consts::PI * difference_hz * grid.block_s() / periods;
    if half_turn.sin().abs() < 1e-9 {
        1.0
    } else {
        ((half_turn * periods).sin() / (periods * half_turn.sin())).powi(2)
    }
}
