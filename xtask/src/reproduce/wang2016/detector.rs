//! Everything that judges a run, behind one door.

use anyhow::{Context, Result};
use fault_ml::classical::{
    InnovationGlr, KalmanBank, KalmanParameters, LeastSquaresFit, ParityGlr,
};
use fault_ml::particle::{ParticleParameters, ParticleRaim, RatioForm};
use fault_ml::{CumulativeRatio, Sight};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::setting::SATELLITES;

/// Window U of every statistic with a memory, epochs.
const WINDOW: usize = 30;
/// Width of the fault density of the sound ratio, m.
const FAULT_WIDTH_M: f64 = 100.0;

/// What to judge with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A bank of particle filters.
    Particle(ParticleParameters),
    /// The same ratios from Kalman filters.
    KalmanBank(KalmanParameters),
    /// Windowed GLR on the innovations of a Kalman filter.
    InnovationGlr(KalmanParameters),
    /// Windowed GLR on least-squares residuals.
    ParityGlr,
    /// Chi-square of each epoch's least squares.
    ChiSquare,
}

/// A decision and the satellite it points to.
pub type Decision = (f64, usize);

/// What a detector says of one epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// For a bank the paper's ratio, then the sound one; else one statistic.
    pub decisions: Vec<Decision>,
    /// State, m about the truth.
    pub estimate_m: [f64; 4],
    /// Mean effective particles of all filters; zero without particles.
    pub effective: f64,
    /// Standard deviation of the main cloud, m; zero without particles.
    pub spread_m: f64,
}

/// A detector at work.
#[derive(Debug, Clone)]
pub enum Detector {
    /// See [`Kind`].
    Particle(Box<ParticleRaim>),
    /// With the windows of both ratios by satellite.
    KalmanBank(KalmanBank, Vec<[CumulativeRatio; 2]>),
    /// See [`Kind`].
    InnovationGlr(InnovationGlr),
    /// See [`Kind`].
    ParityGlr(ParityGlr),
    /// See [`Kind`].
    ChiSquare,
}

impl Kind {
    /// A detector at the start of a run.
    ///
    /// # Errors
    /// Where the parameters are not possible.
    pub fn start(&self, seed: u64) -> Result<Detector> {
        Ok(match self {
            Self::Particle(parameters) => {
                let random = ChaCha8Rng::seed_from_u64(seed);
                Detector::Particle(Box::new(ParticleRaim::new(parameters.check()?, random)))
            }
            Self::KalmanBank(parameters) => {
                let bank = KalmanBank::new(&parameters.check()?, SATELLITES, FAULT_WIDTH_M);
                let window = || [WINDOW; 2].map(CumulativeRatio::new);
                Detector::KalmanBank(bank, (0..SATELLITES).map(|_| window()).collect())
            }
            Self::InnovationGlr(parameters) => {
                let parameters = parameters.check()?;
                Detector::InnovationGlr(InnovationGlr::new(&parameters, WINDOW))
            }
            Self::ParityGlr => Detector::ParityGlr(ParityGlr::new(WINDOW)),
            Self::ChiSquare => Detector::ChiSquare,
        })
    }
}

impl Detector {
    /// Takes the epoch `k`.
    ///
    /// # Errors
    /// Where the sights cannot be used.
    pub fn epoch(&mut self, k: usize, sights: &[Sight]) -> Result<Observation> {
        let without_particles = |decisions, estimate_m| Observation {
            decisions,
            estimate_m,
            effective: 0.0,
            spread_m: 0.0,
        };
        let fit = || LeastSquaresFit::new(sights).context("no least-squares fit");
        Ok(match self {
            Self::Particle(raim) => particle(raim, k, sights)?,
            Self::KalmanBank(bank, windows) => {
                let decisions = kalman(bank, windows, sights);
                without_particles(decisions, bank.state_m())
            }
            Self::InnovationGlr(glr) => {
                let decision = largest(glr.epoch(1.0, sights).into_iter());
                without_particles(vec![decision], glr.state_m())
            }
            Self::ParityGlr(glr) => {
                let fit = fit()?;
                let decision = largest(glr.epoch(sights, &fit).into_iter());
                without_particles(vec![decision], fit.state_m)
            }
            Self::ChiSquare => {
                let fit = fit()?;
                let worst = fit.worst().context("no redundancy")?;
                without_particles(vec![(fit.chi_square, worst)], fit.state_m)
            }
        })
    }
}

/// Both ratios, before any satellite is judged: nothing speaks for a fault.
fn particle(raim: &mut ParticleRaim, k: usize, sights: &[Sight]) -> Result<Observation> {
    let report = raim.epoch(k as f64, sights)?;
    let decision = |form| {
        let largest = raim.largest_ratio(form);
        largest.map_or((f64::NEG_INFINITY, 0), |(id, ratio)| (ratio, id as usize))
    };
    Ok(Observation {
        decisions: vec![decision(RatioForm::Paper), decision(RatioForm::Sound)],
        estimate_m: report.estimate_m,
        effective: report.effective_mean,
        spread_m: raim.spread_m(),
    })
}

fn kalman(
    bank: &mut KalmanBank,
    windows: &mut [[CumulativeRatio; 2]],
    sights: &[Sight],
) -> Vec<Decision> {
    for (increment, [paper, sound]) in bank.epoch(sights).iter().zip(windows.iter_mut()) {
        paper.push(increment.paper);
        sound.push(increment.sound);
    }
    let form = |form: usize| largest(windows.iter().map(|windows| windows[form].largest()));
    vec![form(0), form(1)]
}

fn largest(values: impl Iterator<Item = f64>) -> Decision {
    let start = (f64::NEG_INFINITY, 0);
    values.enumerate().fold(start, |best, (satellite, value)| {
        if value > best.0 {
            (value, satellite)
        } else {
            best
        }
    })
}
