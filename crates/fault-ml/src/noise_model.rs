//! Noise of real pseudoranges: a bias, a slow Gauss-Markov part, and white noise with tails.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use crate::MonitorError;
use crate::error::within;

/// Width of the tail over the core of the white part; its share is fitted, its width is not: a
/// fourth moment fixes one of the two.
pub(crate) const TAIL_SCALE: f64 = 3.0;
/// Largest share of the tail: beyond it the kurtosis of the mixture falls again.
pub(crate) const LARGEST_SHARE: f64 = 0.1;

/// Parts of the noise of a pseudorange, independent of one another and between satellites.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelatedNoise {
    /// Standard deviation of what stays over the whole stretch, m.
    pub bias_sigma_m: f64,
    /// Share of satellites whose bias comes from the tail, 0 to 0.1, three times as wide as the
    /// others: most satellites are better than the deviation of all says, a few far worse.
    pub bias_tail_share: f64,
    /// Standard deviation of the Gauss-Markov part, m.
    pub markov_sigma_m: f64,
    /// Its correlation time, s.
    pub markov_time_s: f64,
    /// Standard deviation of the white part, m.
    pub white_sigma_m: f64,
    /// Share of white values from the tail, 0 to 0.1, three times as wide as the others.
    pub tail_share: f64,
}

impl CorrelatedNoise {
    /// Standard deviation of all parts together, m: what a monitor has to assume of a pseudorange.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        self.bias_sigma_m
            .hypot(self.markov_sigma_m)
            .hypot(self.white_sigma_m)
    }

    /// The same `factor` times as large.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            bias_sigma_m: factor * self.bias_sigma_m,
            markov_sigma_m: factor * self.markov_sigma_m,
            white_sigma_m: factor * self.white_sigma_m,
            ..*self
        }
    }

    /// This noise, if possible.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a part is not.
    pub fn check(self) -> Result<Self, MonitorError> {
        let deviations = [self.bias_sigma_m, self.markov_sigma_m, self.white_sigma_m];
        for deviation in deviations {
            within("standard deviation (m)", deviation, (0.0, 1e6), "0 to 1e6")?;
        }
        within(
            "correlation time (s)",
            self.markov_time_s,
            (1e-3, 1e7),
            "0.001 to 1e7",
        )?;
        for share in [self.tail_share, self.bias_tail_share] {
            within("tail share", share, (0.0, LARGEST_SHARE), "0 to 0.1")?;
        }
        Ok(self)
    }

    /// Noise of `satellites` satellites, drawn from `random`, which also gives their biases.
    pub fn generator(&self, satellites: usize, random: &mut impl Rng) -> NoiseGenerator {
        let mut draw = |_| {
            let [bias, markov]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(random));
            let width_m = tailed_width(self.bias_sigma_m, self.bias_tail_share, random);
            (width_m * bias, self.markov_sigma_m * markov)
        };
        NoiseGenerator {
            noise: *self,
            parts_m: (0..satellites).map(&mut draw).collect(),
        }
    }
}

/// Deviation of one draw from a mixture of the deviation `sigma_m` with this share of tail.
fn tailed_width(sigma_m: f64, tail_share: f64, random: &mut impl Rng) -> f64 {
    let square = TAIL_SCALE * TAIL_SCALE;
    let core_m = sigma_m / (1.0 - tail_share + tail_share * square).sqrt();
    let is_wide = random.random::<f64>() < tail_share;
    core_m * if is_wide { TAIL_SCALE } else { 1.0 }
}

/// Noise of some satellites, epoch after epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseGenerator {
    noise: CorrelatedNoise,
    /// Bias and Gauss-Markov value of every satellite, m.
    parts_m: Vec<(f64, f64)>,
}

impl NoiseGenerator {
    /// Moves on by `elapsed_s` and writes the noise (m) of every satellite into `values_m`.
    pub fn advance(&mut self, elapsed_s: f64, values_m: &mut [f64], random: &mut impl Rng) {
        let noise = self.noise;
        let decay = (-elapsed_s / noise.markov_time_s).exp();
        let drive_m = noise.markov_sigma_m * (1.0 - decay * decay).sqrt();
        for ((bias_m, markov_m), value_m) in self.parts_m.iter_mut().zip(values_m) {
            let [slow, white]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(random));
            let width_m = tailed_width(noise.white_sigma_m, noise.tail_share, random);
            *markov_m = decay * *markov_m + drive_m * slow;
            *value_m = *bias_m + *markov_m + width_m * white;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_add_up() {
        let noise = CorrelatedNoise {
            bias_sigma_m: 2.0,
            bias_tail_share: 0.0,
            markov_sigma_m: 0.5,
            markov_time_s: 20.0,
            white_sigma_m: 0.3,
            tail_share: 0.03,
        };
        assert!((noise.sigma_m() - (4.0f64 + 0.25 + 0.09).sqrt()).abs() < 1e-12);
        assert!((noise.scaled(3.0).sigma_m() - 3.0 * noise.sigma_m()).abs() < 1e-12);
        let markov_time_s = 0.0;
        assert!(
            CorrelatedNoise {
                markov_time_s,
                ..noise
            }
            .check()
            .is_err()
        );
    }
}
