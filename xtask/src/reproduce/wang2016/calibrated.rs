//! Correlated noise: fitted, a threshold for it, and whether that keeps its word.

use anyhow::Result;
use fault_ml::particle::Calibration;
use fault_ml::{CorrelatedNoise, Sight};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::detector::Kind;
use super::performance::Performance;
use super::setting::{Geometry, SATELLITES, TrueNoise, Truth};
use super::simulate::Campaign;
use super::study::{SEEDS, bootstrap};

/// Share of 480 s stretches that may have a false alarm.
pub const STATED: f64 = 0.05;
/// Length of the record the noise is fitted to, s.
const RECORD_S: usize = 3600;
const CALIBRATION: Calibration = Calibration {
    runs: 400,
    epochs: 480,
    false_alarm_share: STATED,
};

/// A threshold found from a record of noise, tried on other noise of the kind.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// What is true.
    pub truth: CorrelatedNoise,
    /// What the fit finds in an hour of nine satellites.
    pub fitted: CorrelatedNoise,
    /// The sound ratio at the calibrated threshold.
    pub calibrated: Performance,
    /// The sound ratio at the threshold of the paper.
    pub uncalibrated: Performance,
}

impl Calibrated {
    /// Fits, calibrates and tries.
    ///
    /// # Errors
    /// Where a part cannot be run.
    pub fn run(geometry: &Geometry) -> Result<Self> {
        let deviation_m = 1.8;
        let truth = CorrelatedNoise {
            bias_sigma_m: 0.0,
            bias_tail_share: 0.0,
            markov_sigma_m: 0.7f64.sqrt() * deviation_m,
            markov_time_s: 60.0,
            white_sigma_m: 0.3f64.sqrt() * deviation_m,
            tail_share: 0.1,
        };
        let mut random = ChaCha8Rng::seed_from_u64(2016);
        let fitted = fit(&truth, &mut random)?;
        // No margin: the filters assume the deviation of the fit.
        let sigma_m = fitted.sigma_m();
        let parameters = fault_ml::particle::ParticleParameters {
            ratio: fault_ml::particle::RatioForm::Sound,
            ..bootstrap()
        };
        let sights: Vec<Sight> = (0..)
            .zip(&geometry[0])
            .map(|(id, design)| Sight {
                id,
                design: *design,
                residual_m: 0.0,
                sigma_m,
            })
            .collect();
        let checked = parameters.check()?;
        let noise = fitted.scaled(1.0 / sigma_m);
        let threshold = CALIBRATION.threshold(&checked, &sights, &noise, &mut random)?;
        let campaign = Campaign {
            truth: Truth {
                noise: TrueNoise::Correlated,
                sigma_m: deviation_m,
            },
            sigma_m,
            kind: Kind::Particle(parameters),
        };
        let runs = campaign.runs(geometry, SEEDS)?;
        Ok(Self {
            truth,
            fitted,
            calibrated: Performance::new(&runs, 1, threshold),
            uncalibrated: Performance::new(&runs, 1, 20.0),
        })
    }
}

fn fit(truth: &CorrelatedNoise, random: &mut ChaCha8Rng) -> Result<CorrelatedNoise> {
    let mut generator = truth.generator(SATELLITES, random);
    let mut rows = vec![Vec::new(); SATELLITES];
    let mut values_m = [0.0; SATELLITES];
    for _ in 0..RECORD_S {
        generator.advance(1.0, &mut values_m, random);
        for (row, value_m) in rows.iter_mut().zip(values_m) {
            row.push(value_m);
        }
    }
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    Ok(CorrelatedNoise::fit(&rows, 1.0)?)
}
