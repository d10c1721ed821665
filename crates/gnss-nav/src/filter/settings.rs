//! Settings of the filters.

use crate::dynamics::ProcessNoise;
use crate::{MeasurementModel, NavError};

/// Whether single measurements are refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gate {
    /// Every measurement is used.
    Off,
    /// A measurement whose innovation exceeds this many of its standard deviations is skipped for
    /// the epoch (Li2019).
    Sigmas(f64),
}

/// What a filter assumes of receiver, clock, atmosphere and measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSettings {
    /// Motion and clock between epochs.
    pub process_noise: ProcessNoise,
    /// Delays, elevation mask and variance beyond tracking noise.
    pub model: MeasurementModel,
    /// When to skip a measurement; by default 4 standard deviations, which a healthy Gaussian
    /// measurement exceeds once in 16 000 times.
    pub gate: Gate,
}

impl Default for FilterSettings {
    fn default() -> Self {
        Self {
            process_noise: ProcessNoise::default(),
            model: MeasurementModel::default(),
            gate: Gate::Sigmas(4.0),
        }
    }
}

impl FilterSettings {
    /// # Errors
    /// [`NavError::Value`] for a density below zero or a gate that is not above zero.
    pub(super) fn check(&self) -> Result<(), NavError> {
        self.process_noise.check()?;
        match self.gate {
            Gate::Sigmas(sigmas) if !(sigmas > 0.0 && sigmas.is_finite()) => Err(NavError::Value {
                name: "gate, standard deviations",
                value: sigmas.to_string(),
                expected: "more than 0, and finite",
            }),
            Gate::Off | Gate::Sigmas(_) => Ok(()),
        }
    }
}
