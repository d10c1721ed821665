//! Table 1: how well the observable follows the error, by amplitude, without and with noise.

use fault_ml::shape::{SHAPE_TAPS_CHIPS, largest_tap};

use super::closed_loop::{ClosedLoop, Reflection, Setting};
use super::correlation::Correlation;
use super::deviation::{COMPLEX_DBHZ, bands};
use super::map::{Point, correlation_coefficient, map};

/// Draws of noise at each point.
const DRAWS: usize = 100;

/// Amplitudes of the reflection.
pub const AMPLITUDES: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Correlation coefficients of an amplitude; `None` where nothing varies.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Amplitude of the reflection.
    pub amplitude: f64,
    /// Without noise, by the front ends of [`bands`].
    pub noiseless: [Option<f64>; 3],
    /// Of the fitted parabola, without noise or filter.
    pub fitted: Option<f64>,
    /// Of the mean of T over noise of 1 ms at the paper's SNR, without a filter.
    pub mean_of_noisy: Option<f64>,
    /// Of single values of T with that noise.
    pub noisy: Option<f64>,
}

/// All amplitudes.
#[must_use]
pub fn table() -> Vec<Row> {
    AMPLITUDES.into_iter().map(row).collect()
}

fn row(amplitude: f64) -> Row {
    let coefficient = |points: &[Point], value: fn(&Point) -> f64| {
        let pairs: Vec<_> = points.iter().map(|p| (p.error_chips, value(p))).collect();
        correlation_coefficient(&pairs)
    };
    let maps = bands().map(|(_, correlation)| map(&correlation, amplitude));
    let (mut single, mut mean) = (Vec::new(), Vec::new());
    for (k, point) in maps[0].iter().enumerate() {
        let observed = noisy(amplitude, point, k as u64);
        mean.push((
            point.error_chips,
            observed.iter().sum::<f64>() / DRAWS as f64,
        ));
        single.extend(observed.into_iter().map(|t| (point.error_chips, t)));
    }
    Row {
        amplitude,
        noiseless: std::array::from_fn(|k| coefficient(&maps[k], |p| p.observed_chips)),
        fitted: coefficient(&maps[0], |p| p.fitted_chips),
        mean_of_noisy: correlation_coefficient(&mean),
        noisy: correlation_coefficient(&single),
    }
}

/// T of a replica held where the loop settles.
fn noisy(amplitude: f64, point: &Point, seed: u64) -> Vec<f64> {
    let setting = Setting {
        loop_hz: 0.0,
        correlation: Correlation::Triangle,
        ..Setting::paper(COMPLEX_DBHZ)
    };
    let reflection = Reflection {
        amplitude,
        delay_chips: point.delay_chips,
        phase_rad: point.phase_deg.to_radians(),
    };
    let mut held = ClosedLoop::new(setting, seed).at(point.error_chips);
    let draws = (0..DRAWS).map(|_| held.step(&[reflection]).shape);
    draws
        .map(|shape| largest_tap(&SHAPE_TAPS_CHIPS, &shape).unwrap_or(0.0))
        .collect()
}
