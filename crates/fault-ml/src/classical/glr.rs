//! Windowed generalised likelihood ratio for a step in one pseudorange (`Willsky1976`).

use std::collections::{BTreeMap, VecDeque};

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

    /// Most likely size of the step, m, and its variance, m^2.
    fn size(&self) -> (f64, f64) {
        (self.correlation / self.information, 1.0 / self.information)
    }

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
    /// Oldest first; each holds a hypothesis for every satellite seen since, by id.
    onsets: VecDeque<BTreeMap<u32, Hypothesis>>,
    window_epochs: usize,
}

impl InnovationGlr {
    /// Nothing seen yet; steps are sought that began up to `window_epochs` epochs ago.
    #[must_use]
    pub fn new(parameters: &KalmanParameters, window_epochs: usize) -> Self {
        Self {
            filter: KalmanFilter::new(parameters),
            onsets: VecDeque::with_capacity(window_epochs + 1),
            window_epochs,
        }
    }

    /// State of the filter, m about the reference point.
    #[must_use]
    pub fn state_m(&self) -> [f64; STATES] {
        self.filter.state_m()
    }

    /// Takes the sights of an epoch `elapsed_s` after the one before; returns the ratio of every
    /// satellite, maximised over onsets.
    pub fn epoch(&mut self, elapsed_s: f64, sights: &[Sight]) -> Vec<f64> {
        if self.onsets.len() >= self.window_epochs {
            self.onsets.pop_front();
        }
        self.onsets.push_back(BTreeMap::new());
        for onset in &mut self.onsets {
            for sight in sights {
                onset.entry(sight.id).or_insert(Hypothesis::NONE);
            }
        }
        self.filter.predict(elapsed_s);
        for sight in sights {
            let innovation = self.filter.update(sight);
            let design = Vector4::from(sight.design);
            for (id, hypothesis) in self.onsets.iter_mut().flatten() {
                let step = if *id == sight.id { 1.0 } else { 0.0 };
                let signature = step - design.dot(&hypothesis.response);
                let scaled = signature / innovation.variance_m2;
                hypothesis.information += signature * scaled;
                hypothesis.correlation += innovation.value_m * scaled;
                hypothesis.response += innovation.gain * signature;
            }
        }
        let ratio = |id: u32| self.most_likely(id).map_or(0.0, |h| h.ratio());
        sights.iter().map(|sight| ratio(sight.id)).collect()
    }

    /// The most likely step of the satellite `id`.
    fn most_likely(&self, id: u32) -> Option<&Hypothesis> {
        let onsets = self.onsets.iter().filter_map(|onset| onset.get(&id));
        onsets.max_by(|a, b| a.ratio().total_cmp(&b.ratio()))
    }

    /// Takes out what the most likely step of the satellite `id` has done to the state, and begins
    /// a new window.
    pub fn compensate(&mut self, id: u32) {
        let found = self.most_likely(id).copied();
        if let Some(step) = found.filter(|h| h.information > 0.0) {
            let (size_m, variance_m2) = step.size();
            self.filter.shift(&(-size_m * step.response));
            self.filter
                .loosen(&(step.response * step.response.transpose() * variance_m2));
        }
        self.onsets.clear();
    }

    /// Log density (1/m) of a sight the filter has not taken.
    #[must_use]
    pub fn log_expectation(&self, sight: &Sight) -> f64 {
        self.filter.log_expectation(sight)
    }

    /// Moves the reference point: what was at x is at x + `offset_m` now.
    pub fn shift(&mut self, offset_m: &[f64; STATES]) {
        self.filter.shift(&Vector4::from(*offset_m));
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
