//! The threshold that gives a stated rate of false alarms under a stated noise.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::parameters::{CheckedParticleParameters, ParticleParameters, Response};
use super::raim::{Decision, ParticleRaim};
use crate::error::within;
use crate::{CorrelatedNoise, MonitorError, Sight};

/// Clean stretches simulated to find a threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Stretches, 20 to 100 000.
    pub runs: usize,
    /// Epochs of each that count, one a second; the warm-up comes before them.
    pub epochs: usize,
    /// Share of stretches that may have an alarm, 0.001 to 0.5. The largest `runs` x this many
    /// decide, so that runs should be at least 10 / this.
    pub false_alarm_share: f64,
}

impl Calibration {
    fn check(&self) -> Result<(), MonitorError> {
        within(
            "calibration runs",
            self.runs as f64,
            (20.0, 1e5),
            "20 to 100000",
        )?;
        within(
            "calibration epochs",
            self.epochs as f64,
            (1.0, 1e7),
            "1 to 1e7",
        )?;
        within(
            "false-alarm share",
            self.false_alarm_share,
            (1e-3, 0.5),
            "0.001 to 0.5",
        )
    }

    /// The threshold of a bank of particle filters that this share of clean stretches exceeds, at most;
    /// `sights` and `noise` as for [`Self::threshold_of`].
    ///
    /// # Errors
    /// [`MonitorError::Value`] where something is not possible, or with fewer than five satellites.
    pub fn threshold(
        &self,
        parameters: &CheckedParticleParameters,
        sights: &[Sight],
        noise: &CorrelatedNoise,
        random: &mut ChaCha8Rng,
    ) -> Result<f64, MonitorError> {
        let observing = ParticleParameters {
            response: Response::Observe,
            ..*parameters.get()
        };
        let observing = observing.check()?;
        let start = |random| ParticleRaim::new(observing, random);
        let score = |raim: &mut ParticleRaim, k: usize, sights: &[Sight]| {
            let epoch = raim.epoch(k as f64, sights)?;
            Ok(match epoch.decision {
                Decision::Judged { score, .. } => score,
                Decision::WarmingUp | Decision::Unavailable => f64::NEG_INFINITY,
            })
        };
        let warm_up = parameters.get().warm_up_epochs;
        self.threshold_of((sights, noise, warm_up), random, start, score)
    }

    /// The threshold that the scores of any detector exceed in this share of clean stretches, at most.
    ///
    /// The satellites are those of `sights`, whose residuals do not matter. `noise` is that of a
    /// satellite whose stated deviation is 1 m, and every satellite's is its own stated deviation times as
    /// large; scores of the first `warm_up` epochs do not count. `start` makes a detector that has
    /// seen nothing of a source of chance, `score` gives it an epoch.
    ///
    /// A chi-square or a normal tail cannot be asked: the largest of many overlapping sums of
    /// correlated ratios has no law of its own. Simulation asks the very code that will decide.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where something is not possible, or with fewer than five satellites;
    /// those of `score`.
    pub fn threshold_of<D>(
        &self,
        (sights, noise, warm_up): (&[Sight], &CorrelatedNoise, usize),
        random: &mut ChaCha8Rng,
        start: impl Fn(ChaCha8Rng) -> D,
        mut score: impl FnMut(&mut D, usize, &[Sight]) -> Result<f64, MonitorError>,
    ) -> Result<f64, MonitorError> {
        self.check()?;
        noise.check()?;
        within("satellites", sights.len() as f64, (5.0, 1e3), "5 or more")?;
        let mut largest = Vec::with_capacity(self.runs);
        for _ in 0..self.runs {
            let mut own = ChaCha8Rng::from_seed(random.random());
            let mut generator = noise.generator(sights.len(), &mut own);
            let mut values = vec![0.0; sights.len()];
            let mut detector = start(ChaCha8Rng::from_seed(own.random()));
            let mut noisy = sights.to_vec();
            let mut highest = f64::NEG_INFINITY;
            for k in 0..warm_up + self.epochs {
                generator.advance(1.0, &mut values, &mut own);
                for (sight, value) in noisy.iter_mut().zip(&values) {
                    sight.residual_m = sight.sigma_m * value;
                }
                let score = score(&mut detector, k, &noisy)?;
                if k >= warm_up {
                    highest = highest.max(score);
                }
            }
            largest.push(highest);
        }
        largest.sort_by(f64::total_cmp);
        let exceeding = (self.false_alarm_share * self.runs as f64) as usize;
        Ok(largest[self.runs - 1 - exceeding])
    }
}
