//! What a cloud expects of the measurements: log likelihoods at its particles and their average.

use std::f64::consts::PI;

use super::cloud::{Cloud, log_weighted_sum};
use super::likelihood::Likelihood;
use super::quadratic::Quadratic;
use crate::{STATES, Sight};

/// Log likelihoods of one epoch at every particle of one cloud.
///
/// The density of the measurements is the weighted mean of the likelihood over the predicted
/// particles, p(y) = sum w_i prod_s p(y_s | x_i); always as a log-sum-exp.
#[derive(Debug, Clone)]
pub(super) struct Evidence {
    /// Satellite after satellite: `terms[s N + i]`. Log densities where the clock is sampled,
    /// residuals (m) about the mean clock where it is marginalised.
    terms: Vec<f64>,
    /// Log likelihood of all satellites in use, by particle.
    total: Vec<f64>,
    /// Work space: that of all but one.
    partial: Vec<f64>,
    /// Sums of the marginal likelihood, by particle.
    sums: Vec<ClockSums>,
}

/// What the measurements say of the clock at one particle: sums over satellites of g = 1/sigma^2.
#[derive(Debug, Clone, Copy, Default)]
struct ClockSums {
    /// Sum of g r, 1/m.
    linear: f64,
    /// Sum of g r^2.
    square: f64,
}

/// The parts of the marginal likelihood that all particles share.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ClockInformation {
    /// Sum of g, 1/m^2.
    information: f64,
    /// Sum of ln(sigma sqrt(2 pi)).
    log_scale: f64,
    /// Prior variance of the clock, m^2.
    variance_m2: f64,
}

impl ClockInformation {
    fn add(&mut self, sight: &Sight, sign: f64) {
        self.information += sign / (sight.sigma_m * sight.sigma_m);
        self.log_scale += sign * (sight.sigma_m * (2.0 * PI).sqrt()).ln();
    }

    /// 1 + P sum g: prior over posterior variance of the clock.
    fn gain(&self) -> f64 {
        1.0 + self.variance_m2 * self.information
    }

    /// ln of the integral over the clock of N(b; 0, P) prod N(r_s; b, sigma_s^2)
    /// = -(S2 - P S1^2 / (1 + P G)) / 2 - ln(1 + P G) / 2 - sum ln(sigma sqrt(2 pi)).
    fn log_likelihood(&self, sums: ClockSums) -> f64 {
        let explained = self.variance_m2 * sums.linear * sums.linear / self.gain();
        -0.5 * (sums.square - explained + self.gain().ln()) - self.log_scale
    }
}

impl Evidence {
    pub(super) fn new(particles: usize) -> Self {
        Self {
            terms: Vec::new(),
            total: vec![0.0; particles],
            partial: vec![0.0; particles],
            sums: vec![ClockSums::default(); particles],
        }
    }

    /// Log likelihood at every particle.
    pub(super) fn total(&self) -> &[f64] {
        &self.total
    }

    /// ln p(y) of the satellites in use.
    pub(super) fn log_mean(&self, cloud: &Cloud) -> f64 {
        log_weighted_sum(&cloud.weight, &self.total)
    }

    fn reserve(&mut self, satellites: usize) {
        // Grows when more satellites than ever are in view, and never else.
        let needed = satellites * self.total.len();
        if self.terms.len() < needed {
            self.terms.resize(needed, 0.0);
        }
    }

    /// Works out the likelihoods of `sights`, all but `left_out`, clock sampled.
    pub(super) fn fill(
        &mut self,
        state: &[Vec<f64>; STATES],
        sights: &[Sight],
        left_out: Option<usize>,
        likelihood: &Likelihood,
    ) {
        self.reserve(sights.len());
        self.total.fill(0.0);
        let rows = self.terms.chunks_exact_mut(self.total.len());
        for (s, (sight, terms)) in sights.iter().zip(rows).enumerate() {
            if Some(s) == left_out {
                continue;
            }
            likelihood.scaled(sight.sigma_m).fill(sight, state, terms);
            for (total, term) in self.total.iter_mut().zip(terms) {
                *total += *term;
            }
        }
    }

    /// As [`fill`](Self::fill) under normal noise, by one quadratic form of the state instead of
    /// satellite after satellite; leaves nothing to take single satellites out of.
    pub(super) fn fill_quadratic(&mut self, state: &[Vec<f64>; STATES], form: &Quadratic) {
        form.evaluate(state, &mut self.total);
    }

    /// ln p of all but satellite `s`, after [`fill`](Self::fill) with all of them.
    pub(super) fn log_mean_without(&mut self, cloud: &Cloud, s: usize) -> f64 {
        let count = self.total.len();
        let terms = &self.terms[s * count..][..count];
        let differences = self.total.iter().zip(terms);
        for (partial, (total, term)) in self.partial.iter_mut().zip(differences) {
            *partial = total - term;
        }
        log_weighted_sum(&cloud.weight, &self.partial)
    }

    /// As [`fill`](Self::fill) with the clock integrated out, of prior variance `variance_m2`
    /// about each particle's own mean.
    pub(super) fn fill_marginal(
        &mut self,
        cloud: &Cloud,
        sights: &[Sight],
        left_out: Option<usize>,
        variance_m2: f64,
    ) -> ClockInformation {
        self.reserve(sights.len());
        self.sums.fill(ClockSums::default());
        let mut clock = ClockInformation {
            variance_m2,
            ..ClockInformation::default()
        };
        let count = self.total.len();
        for (s, sight) in sights
            .iter()
            .enumerate()
            .filter(|(s, _)| Some(*s) != left_out)
        {
            clock.add(sight, 1.0);
            let information = 1.0 / (sight.sigma_m * sight.sigma_m);
            let terms = self.terms[s * count..][..count]
                .iter_mut()
                .zip(&mut self.sums);
            for (i, (term, sums)) in terms.enumerate() {
                let [x, y, z, b] = &cloud.state;
                *term = sight.residual_about(&[x[i], y[i], z[i], b[i]]);
                sums.linear += information * *term;
                sums.square += information * *term * *term;
            }
        }
        for (total, sums) in self.total.iter_mut().zip(&self.sums) {
            *total = clock.log_likelihood(*sums);
        }
        clock
    }

    /// As [`log_mean_without`](Self::log_mean_without) after a marginal fill.
    pub(super) fn log_marginal_without(
        &mut self,
        cloud: &Cloud,
        clock: &ClockInformation,
        s: usize,
        sight: &Sight,
    ) -> f64 {
        let mut without = *clock;
        without.add(sight, -1.0);
        let information = 1.0 / (sight.sigma_m * sight.sigma_m);
        let count = self.total.len();
        let terms = self.terms[s * count..][..count].iter().zip(&self.sums);
        for (partial, (term, sums)) in self.partial.iter_mut().zip(terms) {
            *partial = without.log_likelihood(ClockSums {
                linear: sums.linear - information * term,
                square: sums.square - information * term * term,
            });
        }
        log_weighted_sum(&cloud.weight, &self.partial)
    }

    /// Moves every particle's mean clock to its posterior; returns the posterior variance, m^2.
    pub(super) fn update_clock(&self, cloud: &mut Cloud, clock: &ClockInformation) -> f64 {
        let posterior_m2 = clock.variance_m2 / clock.gain();
        for (mean_m, sums) in cloud.state[3].iter_mut().zip(&self.sums) {
            *mean_m += posterior_m2 * sums.linear;
        }
        posterior_m2
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    fn sights() -> Vec<Sight> {
        let row = |id, a: f64, residual_m, sigma_m| Sight {
            id,
            design: [a, (1.0 - a * a).sqrt(), 0.0, 1.0],
            residual_m,
            sigma_m,
        };
        vec![
            row(1, 0.3, 4.0, 2.0),
            row(2, -0.7, -1.0, 3.0),
            row(3, 0.9, 2.5, 1.5),
        ]
    }

    /// One particle at (1, -0.5, 0), mean clock 0.8 m.
    fn cloud() -> Cloud {
        let mut cloud = Cloud::new(1);
        cloud.shift(&[1.0, -0.5, 0.0, 0.8]);
        cloud
    }

    /// Likelihood of all but `left_out` integrated over the clock by the midpoint rule.
    fn integral(left_out: Option<usize>, variance_m2: f64) -> f64 {
        let step_m = 0.005;
        let prior = |b: f64| Likelihood::Gaussian.log_density(b - 0.8, variance_m2.sqrt());
        let density = |b: f64| {
            let sights = sights();
            let used = sights
                .iter()
                .enumerate()
                .filter(|(s, _)| Some(*s) != left_out);
            used.map(|(_, sight)| {
                let residual_m = sight.residual_about(&[1.0, -0.5, 0.0, b]);
                Likelihood::Gaussian.log_density(residual_m, sight.sigma_m)
            })
            .sum::<f64>()
        };
        let grid = (-8000..8000).map(|n| (f64::from(n) + 0.5) * step_m);
        grid.map(|b| (prior(b) + density(b)).exp() * step_m)
            .sum::<f64>()
            .ln()
    }

    #[test]
    fn the_clock_is_integrated_out() {
        let (cloud, sights, variance_m2) = (cloud(), sights(), 6.0);
        let mut evidence = Evidence::new(1);
        let clock = evidence.fill_marginal(&cloud, &sights, None, variance_m2);
        // The midpoint rule is exact to far below rounding for normal densities.
        let expected = integral(None, variance_m2);
        assert_relative_eq!(evidence.log_mean(&cloud), expected, epsilon = 1e-10);
        let without = evidence.log_marginal_without(&cloud, &clock, 1, &sights[1]);
        let expected = integral(Some(1), variance_m2);
        assert_relative_eq!(without, expected, epsilon = 1e-10);
        evidence.fill_marginal(&cloud, &sights, Some(1), variance_m2);
        assert_relative_eq!(evidence.log_mean(&cloud), expected, epsilon = 1e-10);
    }

    #[test]
    fn the_posterior_clock_is_the_weighted_mean_of_prior_and_residuals() {
        let (mut cloud, sights) = (cloud(), sights());
        let mut evidence = Evidence::new(1);
        let clock = evidence.fill_marginal(&cloud, &sights, None, 6.0);
        let information: f64 = sights.iter().map(|s| s.sigma_m.powi(-2)).sum();
        let pull: f64 = sights
            .iter()
            .map(|s| s.residual_about(&[1.0, -0.5, 0.0, 0.0]) * s.sigma_m.powi(-2))
            .sum();
        let expected = (pull + 0.8 / 6.0) / (information + 1.0 / 6.0);
        let variance_m2 = evidence.update_clock(&mut cloud, &clock);
        assert_relative_eq!(cloud.state[3][0], expected, epsilon = 1e-12);
        assert_relative_eq!(
            variance_m2,
            1.0 / (information + 1.0 / 6.0),
            epsilon = 1e-12
        );
    }

    #[test]
    fn the_quadratic_form_is_the_sum_over_satellites() {
        let (cloud, sights) = (cloud(), sights());
        let mut evidence = Evidence::new(1);
        evidence.fill(&cloud.state, &sights, None, &Likelihood::Gaussian);
        let plain = evidence.log_mean(&cloud);
        evidence.fill_quadratic(&cloud.state, &Quadratic::log_likelihood(sights.iter()));
        // A dozen roundings of numbers of about ten.
        assert_relative_eq!(evidence.log_mean(&cloud), plain, epsilon = 1e-12);
    }

    #[test]
    fn leaving_one_out_afterwards_is_leaving_it_out_at_once() {
        let (cloud, sights) = (cloud(), sights());
        let likelihood = Likelihood::HEAVY_TAILED;
        let mut evidence = Evidence::new(1);
        for s in 0..sights.len() {
            evidence.fill(&cloud.state, &sights, None, &likelihood);
            let later = evidence.log_mean_without(&cloud, s);
            evidence.fill(&cloud.state, &sights, Some(s), &likelihood);
            assert_relative_eq!(later, evidence.log_mean(&cloud), epsilon = 1e-12);
        }
    }
}
