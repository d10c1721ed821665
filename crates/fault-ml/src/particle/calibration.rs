//! The threshold that gives a stated rate of false alarms under a stated noise.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::parameters::{CheckedParticleParameters, ParticleParameters, Response};
use super::raim::{Decision, ParticleRaim};
use crate::error::within;
use crate::{CorrelatedNoise, MonitorError, STATES, Sight};

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

    /// The threshold that this share of clean stretches exceeds, at most, with the design rows
    /// `designs`, pseudoranges that the monitor takes for `sigma_m`, and noise as `noise`.
    ///
    /// A chi-square or a normal tail cannot be asked: the largest of many overlapping sums of
    /// correlated ratios has no law of its own. Simulation asks the very code that will decide.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where something is not possible, or with fewer than five satellites.
    pub fn threshold(
        &self,
        parameters: &CheckedParticleParameters,
        designs: &[[f64; STATES]],
        sigma_m: f64,
        noise: &CorrelatedNoise,
        random: &mut ChaCha8Rng,
    ) -> Result<f64, MonitorError> {
        self.check()?;
        noise.check()?;
        within("satellites", designs.len() as f64, (5.0, 1e3), "5 or more")?;
        let observing = ParticleParameters {
            response: Response::Observe,
            ..*parameters.get()
        };
        let observing = observing.check()?;
        let mut largest = Vec::with_capacity(self.runs);
        for _ in 0..self.runs {
            let own = ChaCha8Rng::from_seed(random.random());
            largest.push(self.clean_largest(observing, designs, sigma_m, noise, own)?);
        }
        largest.sort_by(f64::total_cmp);
        let exceeding = (self.false_alarm_share * self.runs as f64) as usize;
        Ok(largest[self.runs - 1 - exceeding])
    }

    /// Largest decision of one clean stretch.
    fn clean_largest(
        &self,
        parameters: CheckedParticleParameters,
        designs: &[[f64; STATES]],
        sigma_m: f64,
        noise: &CorrelatedNoise,
        mut random: ChaCha8Rng,
    ) -> Result<f64, MonitorError> {
        let mut generator = noise.generator(designs.len(), &mut random);
        let mut values_m = vec![0.0; designs.len()];
        let raim_random = ChaCha8Rng::from_seed(random.random());
        let mut raim = ParticleRaim::new(parameters, raim_random);
        let mut largest = f64::NEG_INFINITY;
        for k in 0..parameters.get().warm_up_epochs + self.epochs {
            generator.advance(1.0, &mut values_m, &mut random);
            let rows = (0..).zip(designs.iter().zip(&values_m));
            let sights: Vec<_> = rows
                .map(|(id, (design, residual_m))| Sight {
                    id,
                    design: *design,
                    residual_m: *residual_m,
                    sigma_m,
                })
                .collect();
            if let Decision::Judged { score, .. } = raim.epoch(k as f64, &sights)?.decision {
                largest = largest.max(score);
            }
        }
        Ok(largest)
    }
}
