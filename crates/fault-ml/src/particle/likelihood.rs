//! Density of a pseudorange residual under the noise a filter believes in.

use std::f64::consts::{PI, SQRT_2};

use crate::error::within;
use crate::{MonitorError, STATES, Sight};

/// Shape of the measurement noise; every shape has the standard deviation of the sight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Likelihood {
    /// Normal: the fitness of Wang2016 (5), normalised.
    Gaussian,
    /// Two zero-mean normals, the wider one rare.
    Mixture {
        /// Probability of the wider one, 0.001 to 0.5.
        tail_share: f64,
        /// Its standard deviation over that of the narrower one, 1.5 to 20.
        tail_scale: f64,
    },
    /// Two-sided exponential.
    Laplace,
}

impl Likelihood {
    /// The mixture of the simulations of Wang2016 here: every tenth residual three times as wide.
    pub const HEAVY_TAILED: Self = Self::Mixture {
        tail_share: 0.1,
        tail_scale: 3.0,
    };

    /// Refuses a mixture whose parts cannot be told apart.
    pub(super) fn check(&self) -> Result<(), MonitorError> {
        if let Self::Mixture {
            tail_share,
            tail_scale,
        } = *self
        {
            within("tail share", tail_share, (0.001, 0.5), "0.001 to 0.5")?;
            within("tail scale", tail_scale, (1.5, 20.0), "1.5 to 20")?;
        }
        Ok(())
    }

    /// The density with the standard deviation `sigma_m` (m) in place.
    pub(super) fn scaled(&self, sigma_m: f64) -> ScaledLikelihood {
        match *self {
            Self::Gaussian => ScaledLikelihood::Gaussian {
                information: 1.0 / (sigma_m * sigma_m),
                log_peak: -(sigma_m * (2.0 * PI).sqrt()).ln(),
            },
            Self::Mixture {
                tail_share,
                tail_scale,
            } => {
                let square = tail_scale * tail_scale;
                let core_m = sigma_m / (1.0 - tail_share + tail_share * square).sqrt();
                let peak = |share: f64, width_m: f64| share / (width_m * (2.0 * PI).sqrt());
                ScaledLikelihood::Mixture(ScaledMixture {
                    half_core: 0.5 / (core_m * core_m),
                    half_tail: 0.5 / (core_m * core_m * square),
                    core_peak: peak(1.0 - tail_share, core_m),
                    tail_peak: peak(tail_share, core_m * tail_scale),
                })
            }
            Self::Laplace => ScaledLikelihood::Laplace {
                rate: SQRT_2 / sigma_m,
                log_peak: -(sigma_m * SQRT_2).ln(),
            },
        }
    }

    /// Logarithm of the density (1/m) of `residual_m` at the standard deviation `sigma_m`.
    ///
    /// Finite for every finite residual whose square is: tails are summed in logarithms.
    #[must_use]
    pub fn log_density(&self, residual_m: f64, sigma_m: f64) -> f64 {
        self.scaled(sigma_m).log_density(residual_m)
    }
}

/// A [`Likelihood`] with its constants worked out for one standard deviation.
#[derive(Debug, Clone, Copy)]
pub(super) enum ScaledLikelihood {
    Gaussian { information: f64, log_peak: f64 },
    Mixture(ScaledMixture),
    Laplace { rate: f64, log_peak: f64 },
}

/// Both parts of a mixture: halved inverse variances (1/m^2) and densities at zero (1/m).
#[derive(Debug, Clone, Copy)]
pub(super) struct ScaledMixture {
    half_core: f64,
    half_tail: f64,
    core_peak: f64,
    tail_peak: f64,
}

impl ScaledMixture {
    /// Density of the core at a squared residual, with the tail's exponential taken out as a
    /// factor: never overflows.
    #[inline]
    fn core(&self, square_m2: f64) -> f64 {
        self.core_peak * ((self.half_tail - self.half_core) * square_m2).exp()
    }

    #[inline]
    fn log_density(&self, square_m2: f64) -> f64 {
        (self.core(square_m2) + self.tail_peak).ln() - self.half_tail * square_m2
    }

    fn information(&self, square_m2: f64) -> f64 {
        let core = self.core(square_m2);
        let slope = core * self.half_core + self.tail_peak * self.half_tail;
        2.0 * slope / (core + self.tail_peak)
    }
}

impl ScaledLikelihood {
    #[inline]
    pub(super) fn log_density(&self, residual_m: f64) -> f64 {
        match *self {
            Self::Gaussian {
                information,
                log_peak,
            } => log_peak - 0.5 * information * residual_m * residual_m,
            Self::Mixture(mixture) => mixture.log_density(residual_m * residual_m),
            Self::Laplace { rate, log_peak } => log_peak - rate * residual_m.abs(),
        }
    }

    /// Weight (1/m^2) of a residual in the normal equations of the most likely state:
    /// -(d ln p / d r) / r, never below zero. A normal density has 1/sigma^2 everywhere.
    pub(super) fn information(&self, residual_m: f64) -> f64 {
        match *self {
            Self::Gaussian { information, .. } => information,
            Self::Mixture(mixture) => mixture.information(residual_m * residual_m),
            // Bounded where the density has its kink.
            Self::Laplace { rate, .. } => rate / residual_m.abs().max(1.0 / rate),
        }
    }

    /// Writes the log density of `sight` at every particle of `state` into `terms`.
    pub(super) fn fill(&self, sight: &Sight, state: &[Vec<f64>; STATES], terms: &mut [f64]) {
        let [hx, hy, hz, hb] = sight.design;
        let [x, y, z, b] = state;
        let coordinates = x.iter().zip(y).zip(z).zip(b);
        for (term, (((x, y), z), b)) in terms.iter_mut().zip(coordinates) {
            *term = sight.residual_m - (hx * x + hy * y + hz * z + hb * b);
        }
        if let Self::Gaussian {
            information,
            log_peak,
        } = *self
        {
            for term in terms {
                *term = log_peak - 0.5 * information * *term * *term;
            }
            return;
        }
        for term in terms {
            *term = self.log_density(*term);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ALL: [Likelihood; 3] = [
        Likelihood::Gaussian,
        Likelihood::HEAVY_TAILED,
        Likelihood::Laplace,
    ];

    #[test]
    fn every_shape_is_a_density_of_the_stated_deviation() {
        for likelihood in ALL {
            let sigma_m = 1.7;
            let step_m = 1e-3;
            let (mut mass, mut square) = (0.0, 0.0);
            for index in -40_000..=40_000 {
                let r = f64::from(index) * step_m;
                let p = likelihood.log_density(r, sigma_m).exp() * step_m;
                mass += p;
                square += p * r * r;
            }
            // The sum of a smooth density over steps of sigma/1700 is exact to the kink of the
            // Laplace density: (step/sigma)^2 / 12 < 1e-7 of the peak.
            assert!((mass - 1.0).abs() < 1e-6, "{likelihood:?}: {mass}");
            let variance = sigma_m * sigma_m;
            assert!((square - variance).abs() < 1e-5, "{likelihood:?}: {square}");
        }
    }

    #[test]
    fn far_tails_stay_finite() {
        for likelihood in ALL {
            let far = likelihood.log_density(1e9, 1e-3);
            assert!(far.is_finite() && far < -1e8, "{likelihood:?}: {far}");
        }
    }

    #[test]
    fn the_information_is_the_slope_of_the_density() {
        for likelihood in ALL {
            for r in [2.5, -4.0, 9.0] {
                let step_m = 1e-5;
                let up = likelihood.log_density(r + step_m, 2.0);
                let slope = (up - likelihood.log_density(r - step_m, 2.0)) / (2.0 * step_m);
                let weight = likelihood.scaled(2.0).information(r);
                // Central differences err by the third derivative times step^2, below 1e-9.
                assert!((weight + slope / r).abs() < 1e-8, "{likelihood:?} at {r}");
            }
        }
    }

    #[test]
    fn a_mixture_of_one_is_refused() {
        let same = Likelihood::Mixture {
            tail_share: 0.1,
            tail_scale: 1.0,
        };
        assert!(same.check().is_err());
        assert!(Likelihood::HEAVY_TAILED.check().is_ok());
    }

    proptest! {
        #[test]
        fn densities_are_even_and_fall_outwards(r in 0.0..1e3f64, sigma_m in 0.1..100.0f64) {
            for likelihood in ALL {
                let here = likelihood.log_density(r, sigma_m);
                prop_assert_eq!(here, likelihood.log_density(-r, sigma_m));
                prop_assert!(likelihood.log_density(r + 0.1, sigma_m) < here);
            }
        }
    }
}
