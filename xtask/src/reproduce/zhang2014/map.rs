//! Figures 2 and 3, Table 1: what a settled loop errs by, and what its shape says of it.

use std::f64::consts::PI;

use fault_ml::shape::{SHAPE_TAPS_CHIPS, fitted_peak, largest_tap};

use super::closed_loop::{Reflection, settled};
use super::correlation::Correlation;

/// Delays, chips: 0 to 1.5.
const DELAYS: usize = 31;
const DELAY_STEP_CHIPS: f64 = 0.05;
/// Phases, degrees: 0 to 345.
const PHASES: usize = 24;
const PHASE_STEP_DEG: f64 = 15.0;

/// One delay and phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Delay of the reflection, chips.
    pub delay_chips: f64,
    /// Its phase, degrees.
    pub phase_deg: f64,
    /// Error of the settled loop, chips late.
    pub error_chips: f64,
    /// Observable of the paper there, chips.
    pub observed_chips: f64,
    /// The same by a parabola, chips.
    pub fitted_chips: f64,
}

/// All delays and phases of a reflection of `amplitude`.
#[must_use]
pub fn map(correlation: &Correlation, amplitude: f64) -> Vec<Point> {
    let delays = (0..DELAYS).map(|k| k as f64 * DELAY_STEP_CHIPS);
    let phases = || (0..PHASES).map(|k| k as f64 * PHASE_STEP_DEG);
    let points = delays.flat_map(|delay| phases().map(move |phase| (delay, phase)));
    points
        .map(|(delay, phase)| point(correlation, amplitude, delay, phase))
        .collect()
}

fn point(correlation: &Correlation, amplitude: f64, delay_chips: f64, phase_deg: f64) -> Point {
    let reflection = Reflection {
        amplitude,
        delay_chips,
        phase_rad: phase_deg * PI / 180.0,
    };
    let (error_chips, sums) = settled(correlation, 1.0, &[reflection]);
    Point {
        delay_chips,
        phase_deg,
        error_chips,
        observed_chips: largest_tap(&SHAPE_TAPS_CHIPS, &sums.shape).unwrap_or(0.0),
        fitted_chips: fitted_peak(&SHAPE_TAPS_CHIPS, &sums.shape).unwrap_or(0.0),
    }
}

/// Correlation coefficient of pairs, equation (5); `None` where either does not vary.
#[must_use]
pub fn correlation_coefficient(pairs: &[(f64, f64)]) -> Option<f64> {
    let n = pairs.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let product =
        |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| f(p.0 - x, p.1 - y)).sum::<f64>();
    let (xx, yy) = (product(&|a, _| a * a), product(&|_, b| b * b));
    (xx > 0.0 && yy > 0.0).then(|| product(&|a, b| a * b) / (xx * yy).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coefficient_is_that_of_the_line() {
        let line = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        assert!((correlation_coefficient(&line).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(correlation_coefficient(&[(0.0, 1.0), (1.0, 1.0)]), None);
    }
}
