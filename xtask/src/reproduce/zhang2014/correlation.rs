//! The correlation of a code with its replica, without and with a front-end filter.

use std::f64::consts::{PI, TAU};

use gnss_nav::constants::CA_CODE_RATE_HZ;

/// Points of the table in a chip; straight in between, good to 2e-5.
const POINTS_PER_CHIP: usize = 512;
/// Reach of the table, chips; beyond it side lobes of a filter are left out.
const REACH_CHIPS: usize = 3;
/// Steps of the integral over the band.
const STEPS: usize = 2_000;

/// Autocorrelation of a long random code of rectangular chips.
#[derive(Debug, Clone, PartialEq)]
pub enum Correlation {
    /// Of an unlimited band: a triangle.
    Triangle,
    /// Behind an ideal low-pass filter, from zero on.
    Filtered(Vec<f64>),
}

impl Correlation {
    /// Behind an ideal filter that passes `bandwidth_hz` each side of the carrier; 1 at its peak.
    #[must_use]
    pub fn filtered(bandwidth_hz: f64) -> Self {
        let band = bandwidth_hz / CA_CODE_RATE_HZ;
        let step = band / STEPS as f64;
        let integral = |lag: f64| -> f64 {
            let middle = |k: usize| (k as f64 + 0.5) * step;
            let steps = (0..STEPS).map(middle);
            steps
                .map(|f| ((PI * f).sin() / (PI * f)).powi(2) * (TAU * f * lag).cos())
                .sum()
        };
        let peak = integral(0.0);
        let points = 0..=REACH_CHIPS * POINTS_PER_CHIP;
        Self::Filtered(
            points
                .map(|k| integral(k as f64 / POINTS_PER_CHIP as f64) / peak)
                .collect(),
        )
    }

    /// The correlation `lag_chips` from the peak.
    #[must_use]
    pub fn at(&self, lag_chips: f64) -> f64 {
        let lag = lag_chips.abs();
        match self {
            Self::Triangle => (1.0 - lag).max(0.0),
            Self::Filtered(points) => {
                let place = lag * POINTS_PER_CHIP as f64;
                let below = place as usize;
                match points.get(below..below + 2) {
                    Some([a, b]) => a + (b - a) * (place - below as f64),
                    _ => 0.0,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_rounds_the_peak() {
        // Values of an independent quadrature.
        for (bandwidth_hz, lag, expected) in [
            (2.5e6, 0.1, 0.953_136),
            (2.5e6, 0.5, 0.525_499),
            (1.25e6, 0.25, 0.863_286),
            (1.25e6, 1.0, 0.054_639),
        ] {
            let found = Correlation::filtered(bandwidth_hz).at(-lag);
            assert!(
                (found - expected).abs() < 1e-4,
                "{bandwidth_hz} {lag}: {found}"
            );
        }
        assert_eq!(Correlation::Triangle.at(-0.3), 0.7);
        assert_eq!(Correlation::filtered(1e6).at(7.0), 0.0);
    }
}
