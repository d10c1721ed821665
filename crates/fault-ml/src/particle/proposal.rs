//! The swarm as an importance proposal: where it leads, drawn about, and weighted for that.
//!
//! With the prior a normal law of the last cloud's moments this is a Gaussian particle filter
//! (`Kotecha2003`) whose proposal the swarm centres.

use nalgebra::{Matrix4, Vector4};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::cloud::Cloud;
use super::likelihood::Likelihood;
use super::quadratic::Quadratic;
use crate::{STATES, Sight};

/// Factor on the covariance drawn from: slightly wider than the posterior, so that no weight
/// grows without bound in the tails; costs 1 - (2 x 1.2 - 1)^2 / 1.2^4 = 5 % of the particles.
const INFLATION: f64 = 1.2;

/// The predicted state as a normal distribution: that of the last cloud, diffused.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prior {
    mean_m: Vector4<f64>,
    information: Matrix4<f64>,
}

impl Prior {
    /// From the cloud before prediction and the process noise (m) of this epoch; `None` where the
    /// covariance cannot be inverted.
    pub(super) fn of(cloud: &Cloud, process_sigma_m: &[f64; STATES]) -> Option<Self> {
        let (mean_m, mut covariance) = cloud.moments();
        for (d, sigma) in process_sigma_m.iter().enumerate() {
            covariance[(d, d)] += sigma * sigma;
        }
        let information = covariance.cholesky()?.inverse();
        Some(Self {
            mean_m,
            information,
        })
    }

    /// ln N(x; mean, covariance) without its constant.
    pub(super) fn quadratic(&self) -> Quadratic {
        let linear = self.information * self.mean_m;
        Quadratic {
            matrix: self.information,
            linear,
            constant: -0.5 * self.mean_m.dot(&linear),
        }
    }

    /// Information (1/m^2) of prior and measurements at `mode`.
    fn posterior_information<'a>(
        &self,
        mode: &[f64; STATES],
        sights: impl Iterator<Item = &'a Sight>,
        likelihood: &Likelihood,
    ) -> Matrix4<f64> {
        sights.fold(self.information, |sum, sight| {
            let design = Vector4::from(sight.design);
            let scaled = likelihood.scaled(sight.sigma_m);
            sum + design * design.transpose() * scaled.information(sight.residual_about(mode))
        })
    }
}

/// Replaces the particles by draws about `mode`, and writes ln(1 / density drawn from), but for a
/// constant, into `correction`. Returns whether it could: else nothing has changed.
pub(super) fn draw_about<'a>(
    cloud: &mut Cloud,
    mode: &[f64; STATES],
    prior: &Prior,
    (sights, likelihood): (impl Iterator<Item = &'a Sight>, &Likelihood),
    random: &mut impl Rng,
    correction: &mut [f64],
) -> bool {
    let information = prior.posterior_information(mode, sights, likelihood);
    let covariance = information.cholesky().map(|c| c.inverse() * INFLATION);
    let Some(root) = covariance.and_then(Matrix4::cholesky) else {
        return false;
    };
    let lower = root.l();
    for (i, correction) in correction.iter_mut().enumerate() {
        let normal = Vector4::from_fn(|_, _| StandardNormal.sample(random));
        let offset = lower * normal;
        for d in 0..STATES {
            cloud.state[d][i] = mode[d] + offset[d];
        }
        *correction = 0.5 * normal.norm_squared();
    }
    let equal = 1.0 / cloud.len() as f64;
    cloud.weight.fill(equal);
    true
}
