//! The detectors, for any number of satellites.

use anyhow::{Context, Result};
use fault_ml::Sight;
use fault_ml::classical::{GlrParameters, InnovationGlr, LeastSquaresFit, ParityGlr};
use fault_ml::particle::{ParticleParameters, ParticleRaim, RatioForm, Response};
use rand_chacha::ChaCha8Rng;

/// Window of the likelihood ratios, epochs.
const WINDOW: usize = 30;

/// What to judge with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A bank of particle filters, by the sound ratio.
    Particle(ParticleParameters),
    /// Chi-square of each epoch's least squares.
    ChiSquare,
    /// Windowed likelihood ratio on least-squares residuals.
    ParityGlr,
    /// Windowed likelihood ratio on the innovations of a Kalman filter.
    InnovationGlr,
}

impl Kind {
    /// Whether it draws numbers.
    #[must_use]
    pub const fn has_chance(&self) -> bool {
        matches!(self, Self::Particle(_))
    }
}

/// A detector at work.
#[derive(Debug)]
pub enum Detector {
    /// See [`Kind`].
    Particle(Box<ParticleRaim>),
    /// See [`Kind`].
    ChiSquare,
    /// See [`Kind`].
    ParityGlr(ParityGlr),
    /// See [`Kind`].
    InnovationGlr(InnovationGlr),
}

impl Detector {
    /// A detector that has seen nothing.
    ///
    /// # Errors
    /// Where its parameters are not possible.
    pub fn start(kind: Kind, random: ChaCha8Rng) -> Result<Self> {
        Ok(match kind {
            Kind::Particle(parameters) => {
                let observing = ParticleParameters {
                    response: Response::Observe,
                    ..parameters
                };
                Self::Particle(Box::new(ParticleRaim::new(observing.check()?, random)))
            }
            Kind::ChiSquare => Self::ChiSquare,
            Kind::ParityGlr => Self::ParityGlr(ParityGlr::new(WINDOW)),
            Kind::InnovationGlr => Self::InnovationGlr(InnovationGlr::new(
                &GlrParameters::default().filter.check()?,
                WINDOW,
            )),
        })
    }

    /// Takes the epoch `k`: the score, and the place of the satellite it points to.
    ///
    /// # Errors
    /// Where the sights cannot be used.
    pub fn epoch(&mut self, k: usize, sights: &[Sight]) -> Result<(f64, usize)> {
        let fit = || LeastSquaresFit::new(sights).context("no least-squares fit");
        let place = |id: u32| sights.iter().position(|s| s.id == id).unwrap_or_default();
        Ok(match self {
            Self::Particle(raim) => {
                raim.epoch(k as f64, sights)?;
                let largest = raim.largest_ratio(RatioForm::Sound);
                largest.map_or((f64::NEG_INFINITY, 0), |(id, ratio)| (ratio, place(id)))
            }
            Self::ChiSquare => {
                let fit = fit()?;
                (fit.chi_square, fit.worst().context("no redundancy")?)
            }
            Self::ParityGlr(glr) => largest(&glr.epoch(sights, &fit()?)),
            Self::InnovationGlr(glr) => largest(&glr.epoch(1.0, sights)),
        })
    }
}

fn largest(values: &[f64]) -> (f64, usize) {
    let start = (f64::NEG_INFINITY, 0);
    values.iter().enumerate().fold(
        start,
        |best, (at, value)| {
            if *value > best.0 { (*value, at) } else { best }
        },
    )
}
