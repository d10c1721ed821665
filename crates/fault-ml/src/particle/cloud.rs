//! A set of weighted particles, one array per state, and what can be said of it.

use nalgebra::{Matrix4, Vector4};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use crate::STATES;

/// Particles and their weights. Weights are at least zero and sum to one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cloud {
    /// Coordinates, m: `state[d][i]` is coordinate `d` of particle `i`.
    pub(super) state: [Vec<f64>; STATES],
    /// Normalised weights.
    pub(super) weight: Vec<f64>,
    /// Where resampling writes.
    spare: [Vec<f64>; STATES],
}

impl Cloud {
    /// `particles` particles at the reference point, equally likely.
    pub(super) fn new(particles: usize) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0.0; particles]);
        Self {
            state: zeros(),
            weight: vec![1.0 / particles as f64; particles],
            spare: zeros(),
        }
    }

    /// Number of particles.
    pub(super) fn len(&self) -> usize {
        self.weight.len()
    }

    /// Takes over particles and weights of a cloud of the same size.
    pub(super) fn copy_from(&mut self, other: &Self) {
        for (own, theirs) in self.state.iter_mut().zip(&other.state) {
            own.copy_from_slice(theirs);
        }
        self.weight.copy_from_slice(&other.weight);
    }

    /// Moves every particle by `offset_m`.
    pub(super) fn shift(&mut self, offset_m: &[f64; STATES]) {
        for (coordinates, offset) in self.state.iter_mut().zip(offset_m) {
            for coordinate in coordinates {
                *coordinate += offset;
            }
        }
    }

    /// Adds normal noise of the given standard deviations (m), none where that is zero.
    pub(super) fn diffuse(&mut self, sigma_m: &[f64; STATES], random: &mut impl Rng) {
        for (coordinates, sigma) in self.state.iter_mut().zip(sigma_m) {
            if *sigma > 0.0 {
                for coordinate in coordinates {
                    let normal: f64 = StandardNormal.sample(random);
                    *coordinate += sigma * normal;
                }
            }
        }
    }

    /// Effective number of particles, Wang2016 (8): 1 / sum of squared weights.
    pub(super) fn effective(&self) -> f64 {
        1.0 / self.weight.iter().map(|w| w * w).sum::<f64>()
    }

    /// Weighted mean, m.
    pub(super) fn mean(&self) -> [f64; STATES] {
        std::array::from_fn(|d| {
            let weighted = self.state[d].iter().zip(&self.weight);
            weighted.map(|(x, w)| w * x).sum()
        })
    }

    /// Weighted mean (m) and covariance (m^2).
    pub(super) fn moments(&self) -> (Vector4<f64>, Matrix4<f64>) {
        let mean = self.mean();
        let mut covariance = Matrix4::zeros();
        for row in 0..STATES {
            for column in 0..=row {
                let pairs = self.state[row].iter().zip(&self.state[column]);
                let products = pairs.zip(&self.weight);
                let sum: f64 = products
                    .map(|((a, b), w)| w * (a - mean[row]) * (b - mean[column]))
                    .sum();
                covariance[(row, column)] = sum;
                covariance[(column, row)] = sum;
            }
        }
        (Vector4::from(mean), covariance)
    }

    /// Draws as many particles by their weights, which become equal; systematic: one random
    /// number, so that a particle of weight w occurs N w times, rounded down or up.
    pub(super) fn resample(&mut self, random: &mut impl Rng) {
        let count = self.len();
        let step = 1.0 / count as f64;
        let mut level = random.random::<f64>() * step;
        let (mut from, mut cumulative) = (0, self.weight[0]);
        for to in 0..count {
            // The bound on `from` keeps a sum that falls short of one by rounding inside.
            while cumulative < level && from + 1 < count {
                from += 1;
                cumulative += self.weight[from];
            }
            for d in 0..STATES {
                self.spare[d][to] = self.state[d][from];
            }
            level += step;
        }
        std::mem::swap(&mut self.state, &mut self.spare);
        self.weight.fill(step);
    }

    /// Multiplies the weights by exp(`log_factor`) and normalises them; returns the logarithm of
    /// their sum before that, ln sum w exp(log factor).
    ///
    /// The largest factor is taken out first, so that one weight is always above zero.
    pub(super) fn reweigh(&mut self, log_factor: &[f64]) -> f64 {
        let largest = largest_likely(&self.weight, log_factor);
        let mut sum = 0.0;
        for (weight, log) in self.weight.iter_mut().zip(log_factor) {
            *weight *= (log - largest).exp();
            sum += *weight;
        }
        let scale = 1.0 / sum;
        for weight in &mut self.weight {
            *weight *= scale;
        }
        sum.ln() + largest
    }
}

/// Largest logarithm among those that have a weight.
pub(super) fn largest_likely(weight: &[f64], log: &[f64]) -> f64 {
    let pairs = weight.iter().zip(log);
    pairs.fold(f64::NEG_INFINITY, |largest, (w, l)| {
        if *w > 0.0 && *l > largest {
            *l
        } else {
            largest
        }
    })
}

/// ln sum of `weight` exp(`log`), without overflow or underflow.
pub(super) fn log_weighted_sum(weight: &[f64], log: &[f64]) -> f64 {
    let largest = largest_likely(weight, log);
    let pairs = weight.iter().zip(log);
    let sum: f64 = pairs.map(|(w, l)| w * (l - largest).exp()).sum();
    sum.ln() + largest
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn cloud(first: &[f64], weight: &[f64]) -> Cloud {
        let mut cloud = Cloud::new(first.len());
        cloud.state[0].copy_from_slice(first);
        cloud.weight.copy_from_slice(weight);
        cloud
    }

    #[test]
    fn moments_are_those_of_the_weights() {
        let cloud = cloud(&[0.0, 4.0], &[0.25, 0.75]);
        assert_eq!(cloud.mean(), [3.0, 0.0, 0.0, 0.0]);
        // Variance of two points: p (1 - p) distance^2 = 0.25 * 0.75 * 16.
        assert_eq!(cloud.moments().1[(0, 0)], 3.0);
        assert_eq!(cloud.effective(), 1.6);
    }

    #[test]
    fn hopeless_weights_still_sum_to_one() {
        let mut cloud = cloud(&[1.0, 2.0], &[0.5, 0.5]);
        let sum = cloud.reweigh(&[-1e6, -1e6 - 1.0]);
        assert!((sum + 1e6 - (0.5 + 0.5 * (-1.0f64).exp()).ln()).abs() < 1e-9);
        let expected = 1.0 / (1.0 + (-1.0f64).exp());
        assert!((cloud.weight[0] - expected).abs() < 1e-15);
        assert!((log_weighted_sum(&[0.5, 0.5], &[-1e6, -1e6]) + 1e6).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn systematic_resampling_copies_each_particle_about_as_often_as_it_weighs(
            raw in prop::collection::vec(0.0..1.0f64, 2..60), seed in 0u64..1000
        ) {
            let sum: f64 = raw.iter().sum::<f64>() + 1e-9;
            let weight: Vec<f64> = raw.iter().map(|w| (w + 1e-9 / raw.len() as f64) / sum).collect();
            let index: Vec<f64> = (0..raw.len()).map(|i| i as f64).collect();
            let mut cloud = cloud(&index, &weight);
            cloud.resample(&mut ChaCha8Rng::seed_from_u64(seed));
            for (i, w) in weight.iter().enumerate() {
                let copies = cloud.state[0].iter().filter(|x| **x == i as f64).count() as f64;
                let due = w * raw.len() as f64;
                // Floor or ceiling; rounding of the cumulative sum can shift one copy at a tie.
                prop_assert!(copies >= (due - 1e-9).floor() && copies <= (due + 1e-9).ceil());
            }
        }
    }
}
