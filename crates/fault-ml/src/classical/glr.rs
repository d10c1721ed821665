//! Windowed generalised likelihood ratio for a step in one pseudorange (`Willsky1976`).

use std::collections::VecDeque;

use nalgebra::Vector4;

use super::kalman::{KalmanFilter, KalmanParameters};
use super::least_squares::LeastSquaresFit;
use crate::{STATES, Sight};

/// A step that began at one epoch: what it has done to the filter, and what speaks for it.
#[derive(Debug, Clone, Copy)]
struct Hypothesis {
    /// Error of the state a step of 1 m has caused.
    response: Vector4<f64>,
    /// Sum of signature^2 / variance, 1/m^2.
    information: f64,
    /// Sum of signature x innovation / variance, 1/m.
    correlation: f64,
}

impl Hypothesis {
    const NONE: Self = Self {
        response: Vector4::new(0.0, 0.0, 0.0, 0.0),
        information: 0.0,
        correlation: 0.0,
    };

    /// The log-likelihood ratio at the most likely size of the step.
    fn ratio(&self) -> f64 {
        if self.information > 0.0 {
            0.5 * self.correlation * self.correlation / self.information
        } else {
            0.0
        }
    }
}

/// Step hypotheses on the innovations of one Kalman filter of all satellites.
///
/// A step of size b in satellite q from epoch j on changes the innovations by b times a signature
/// that the filter's own reaction shapes; the ratio is maximised over b in closed form and over
/// j within the window.
#[derive(Debug, Clone)]
pub struct InnovationGlr {
    filter: KalmanFilter,
    /// Oldest first; each holds a hypothesis for every satellite.
    onsets: VecDeque<Vec<Hypothesis>>,
    satellites: usize,
    window_epochs: usize,
}

impl InnovationGlr {
    /// For `satellites` satellites, always given in the same order.
    #[must_use]
    pub fn new(parameters: &KalmanParameters, satellites: usize, window_epochs: usize) -> Self {
        Self {
            filter: KalmanFilter::new(parameters),
            onsets: VecDeque::with_capacity(window_epochs + 1),
            satellites,
            window_epochs,
        }
    }

    /// State of the filter, m about the reference point.
    #[must_use]
    pub fn state_m(&self) -> [f64; STATES] {
        self.filter.state_m()
    }

    /// Takes one epoch; returns the ratio of every satellite, maximised over onsets.
    pub fn epoch(&mut self, sights: &[Sight]) -> Vec<f64> {
        if self.onsets.len() >= self.window_epochs {
            self.onsets.pop_front();
        }
        self.onsets
            .push_back(vec![Hypothesis::NONE; self.satellites]);
        self.filter.predict();
        for (row, sight) in sights.iter().enumerate() {
            let innovation = self.filter.update(sight);
            let design = Vector4::from(sight.design);
            for onset in &mut self.onsets {
                for (satellite, hypothesis) in onset.iter_mut().enumerate() {
                    let step = if satellite == row { 1.0 } else { 0.0 };
                    let signature = step - design.dot(&hypothesis.response);
                    let scaled = signature / innovation.variance_m2;
                    hypothesis.information += signature * scaled;
                    hypothesis.correlation += innovation.value_m * scaled;
                    hypothesis.response += innovation.gain * signature;
                }
            }
        }
        let ratio = |satellite: usize| {
            let onsets = self.onsets.iter().filter_map(|onset| onset.get(satellite));
            onsets.map(Hypothesis::ratio).fold(0.0, f64::max)
        };
        (0..self.satellites).map(ratio).collect()
    }
}

/// Step hypotheses on the least-squares residuals of each epoch: no memory but the window.
#[derive(Debug, Clone)]
pub struct ParityGlr {
    /// Oldest first: of every satellite information and correlation of one epoch.
    epochs: VecDeque<Vec<(f64, f64)>>,
    window_epochs: usize,
}

impl ParityGlr {
    /// Windows of up to `window_epochs` epochs.
    #[must_use]
    pub fn new(window_epochs: usize) -> Self {
        Self {
            epochs: VecDeque::with_capacity(window_epochs + 1),
            window_epochs,
        }
    }

    /// Takes the fit of one epoch to `sights`, always of the same satellites; returns the ratio of
    /// each, maximised over onsets.
    pub fn epoch(&mut self, sights: &[Sight], fit: &LeastSquaresFit) -> Vec<f64> {
        if self.epochs.len() >= self.window_epochs {
            self.epochs.pop_front();
        }
        let judged = fit.standardised.iter().zip(&fit.redundancy);
        let sums = sights
            .iter()
            .zip(judged)
            .map(|(sight, (standardised, redundancy))| {
                let root = redundancy.sqrt() / sight.sigma_m;
                (root * root, standardised * root)
            });
        self.epochs.push_back(sums.collect());
        (0..sights.len())
            .map(|satellite| self.ratio(satellite))
            .collect()
    }

    fn ratio(&self, satellite: usize) -> f64 {
        let mut hypothesis = Hypothesis::NONE;
        let newest_first = self.epochs.iter().rev();
        newest_first
            .filter_map(|epoch| epoch.get(satellite))
            .fold(0.0, |largest, (g, c)| {
                hypothesis.information += g;
                hypothesis.correlation += c;
                hypothesis.ratio().max(largest)
            })
    }
}
