//! One particle filter over the satellites of an epoch, or all of them but one.

use rand::Rng;

use super::cloud::Cloud;
use super::evidence::Evidence;
use super::likelihood::Likelihood;
use super::parameters::{CheckedParticleParameters, ClockState, Movement};
use super::proposal::{Prior, draw_about};
use super::quadratic::Quadratic;
use super::swarm::{Swarm, SwarmOrder, SwarmSettings, draw_uniform};
use crate::{STATES, Sight};

/// The sights a filter takes of one epoch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Epoch<'a> {
    /// Of all satellites in use.
    pub(super) sights: &'a [Sight],
    /// Index of the one this filter never sees.
    pub(super) left_out: Option<usize>,
    /// Since the epoch before, s.
    pub(super) elapsed_s: f64,
}

impl<'a> Epoch<'a> {
    fn used(&self) -> impl Iterator<Item = &'a Sight> + use<'a> + Clone {
        let left_out = self.left_out;
        let sights = self.sights.iter().enumerate();
        sights.filter_map(move |(s, sight)| (Some(s) != left_out).then_some(sight))
    }
}

/// What a filter says of one epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outcome {
    /// ln p(measurements) by the predicted particles.
    pub(super) log_evidence: f64,
    /// Effective number of particles before resampling.
    pub(super) effective: f64,
    /// Weighted mean of the particles, m about the reference point.
    pub(super) estimate_m: [f64; STATES],
}

/// A cloud with all the room one epoch needs: no allocation while the satellites stay.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    cloud: Cloud,
    /// Of the marginalised clock about each particle's mean, m^2.
    clock_variance_m2: f64,
    evidence: Evidence,
    swarm: Swarm,
    /// Of corrected proposals: ln prior, and the whole logarithm of the weight, by particle.
    log_prior: Vec<f64>,
    correction: Vec<f64>,
}

impl Filter {
    /// A filter whose particles surround the reference point.
    pub(super) fn new(parameters: &CheckedParticleParameters, random: &mut impl Rng) -> Self {
        let particles = parameters.get().particles;
        let mut cloud = Cloud::new(particles);
        cloud.diffuse(&parameters.initial_sigma_m(), random);
        let swarm = match parameters.get().movement {
            Movement::Bootstrap => Swarm::new(0),
            Movement::Swarm(_) => Swarm::new(particles),
        };
        Self {
            cloud,
            clock_variance_m2: parameters.get().initial_sigma_m.powi(2),
            evidence: Evidence::new(particles),
            swarm,
            log_prior: vec![0.0; particles],
            correction: vec![0.0; particles],
        }
    }

    /// Takes over what another filter believes.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.cloud.copy_from(&other.cloud);
        self.clock_variance_m2 = other.clock_variance_m2;
    }

    /// Moves the reference point: particles shift by `offset_m`.
    pub(super) fn shift(&mut self, offset_m: &[f64; STATES]) {
        self.cloud.shift(offset_m);
    }

    /// The particles.
    pub(super) const fn cloud(&self) -> &Cloud {
        &self.cloud
    }

    /// ln p(y) of a sight this filter did not use, by its particles; with a marginalised clock at
    /// the clock's posterior mean and a deviation widened by its variance.
    pub(super) fn log_expectation(
        &mut self,
        sight: &Sight,
        parameters: &CheckedParticleParameters,
    ) -> f64 {
        let mut widened = *sight;
        if parameters.get().clock == ClockState::Marginalised {
            widened.sigma_m = sight.sigma_m.hypot(self.clock_variance_m2.sqrt());
        }
        let likelihood = &parameters.get().likelihood;
        self.evidence
            .fill(&self.cloud.state, &[widened], None, likelihood);
        self.evidence.log_mean(&self.cloud)
    }

    /// Takes one epoch: predicts, weighs, moves, estimates and resamples.
    ///
    /// `log_without` receives, where given, ln p of all satellites but each one in turn.
    pub(super) fn step(
        &mut self,
        epoch: Epoch,
        parameters: &CheckedParticleParameters,
        log_without: Option<&mut Vec<f64>>,
        random: &mut impl Rng,
    ) -> Outcome {
        let process_sigma_m = parameters.process_sigma_m(epoch.elapsed_s);
        let settings = parameters.get();
        let prior = match settings.movement {
            Movement::Swarm(swarm) if swarm.order == SwarmOrder::Corrected => {
                Prior::of(&self.cloud, &process_sigma_m)
            }
            _ => None,
        };
        self.cloud.diffuse(&process_sigma_m, random);
        match settings.clock {
            ClockState::Sampled => self.weigh(epoch, &settings.likelihood, log_without),
            ClockState::Marginalised => {
                let clock_noise_m2 = settings.clock_noise_m.powi(2) * epoch.elapsed_s;
                self.weigh_marginal(epoch, clock_noise_m2, log_without);
            }
        }
        let log_evidence = match (settings.movement, prior) {
            (Movement::Swarm(swarm), None) => self.fly(epoch, &settings.likelihood, &swarm, random),
            (Movement::Swarm(swarm), Some(prior)) => {
                self.propose(epoch, &settings.likelihood, &swarm, &prior, random)
            }
            (Movement::Bootstrap, _) => self.cloud.reweigh(self.evidence.total()),
        };
        self.conclude(log_evidence, settings.resample_below, random)
    }

    /// Likelihoods at the predicted particles.
    fn weigh(&mut self, epoch: Epoch, likelihood: &Likelihood, log_without: Option<&mut Vec<f64>>) {
        let Some(log_without) = log_without else {
            self.weigh_together(epoch, likelihood);
            return;
        };
        let (state, evidence) = (&self.cloud.state, &mut self.evidence);
        evidence.fill(state, epoch.sights, epoch.left_out, likelihood);
        log_without.clear();
        let satellites = 0..epoch.sights.len();
        log_without.extend(satellites.map(|s| evidence.log_mean_without(&self.cloud, s)));
    }

    /// Likelihoods at the particles where no single satellite is asked for.
    fn weigh_together(&mut self, epoch: Epoch, likelihood: &Likelihood) {
        let (state, evidence) = (&self.cloud.state, &mut self.evidence);
        if *likelihood == Likelihood::Gaussian {
            evidence.fill_quadratic(state, &Quadratic::log_likelihood(epoch.used()));
        } else {
            evidence.fill(state, epoch.sights, epoch.left_out, likelihood);
        }
    }

    /// The same with the clock integrated out, whose posterior then replaces its prior.
    fn weigh_marginal(
        &mut self,
        epoch: Epoch,
        clock_noise_m2: f64,
        log_without: Option<&mut Vec<f64>>,
    ) {
        let evidence = &mut self.evidence;
        let variance_m2 = self.clock_variance_m2 + clock_noise_m2;
        let clock = evidence.fill_marginal(&self.cloud, epoch.sights, epoch.left_out, variance_m2);
        if let Some(log_without) = log_without {
            log_without.clear();
            log_without.extend(
                epoch
                    .sights
                    .iter()
                    .enumerate()
                    .map(|(s, sight)| evidence.log_marginal_without(&self.cloud, &clock, s, sight)),
            );
        }
        self.clock_variance_m2 = evidence.update_clock(&mut self.cloud, &clock);
    }

    /// The swarm of Wang2016, in either order of weighting and moving; returns ln p(y) by the
    /// particles before the move.
    fn fly(
        &mut self,
        epoch: Epoch,
        likelihood: &Likelihood,
        settings: &SwarmSettings,
        random: &mut impl Rng,
    ) -> f64 {
        if settings.order == SwarmOrder::WeighThenMove {
            let log_evidence = self.cloud.reweigh(self.evidence.total());
            self.swarm_to(epoch, likelihood, settings, None, random);
            return log_evidence;
        }
        let log_evidence = self.evidence.log_mean(&self.cloud);
        self.swarm_to(epoch, likelihood, settings, None, random);
        self.weigh_together(epoch, likelihood);
        self.cloud.reweigh(self.evidence.total());
        log_evidence
    }

    /// The swarm as a proposal, with weights corrected for it; returns ln p(y) by the particles
    /// before the move.
    fn propose(
        &mut self,
        epoch: Epoch,
        likelihood: &Likelihood,
        settings: &SwarmSettings,
        prior: &Prior,
        random: &mut impl Rng,
    ) -> f64 {
        let log_evidence = self.evidence.log_mean(&self.cloud);
        let mode = self.swarm_to(epoch, likelihood, settings, Some(prior), random);
        let target = (epoch.used(), likelihood);
        let correction = &mut self.correction;
        if draw_about(&mut self.cloud, &mode, prior, target, random, correction) {
            self.weigh_together(epoch, likelihood);
            prior
                .quadratic()
                .evaluate(&self.cloud.state, &mut self.log_prior);
            let target = self.evidence.total().iter().zip(&self.log_prior);
            for (sum, (log, log_prior)) in self.correction.iter_mut().zip(target) {
                *sum += log + log_prior;
            }
            self.cloud.reweigh(&self.correction);
        }
        log_evidence
    }

    /// Lets the swarm climb the likelihood, times the prior where given; returns where it leads.
    fn swarm_to(
        &mut self,
        epoch: Epoch,
        likelihood: &Likelihood,
        settings: &SwarmSettings,
        prior: Option<&Prior>,
        random: &mut impl Rng,
    ) -> [f64; STATES] {
        let swarm = &mut self.swarm;
        let (state, evidence) = (&mut self.cloud.state, &mut self.evidence);
        let prior = prior.map(Prior::quadratic);
        let draw = |uniform: &mut [f64]| draw_uniform(random, uniform);
        if *likelihood == Likelihood::Gaussian {
            let mut form = Quadratic::fitness(epoch.used());
            if let Some(prior) = prior {
                form.add(&prior);
            }
            let fitness = |state: &[Vec<f64>; STATES], f: &mut [f64]| form.evaluate(state, f);
            swarm.run(state, settings, fitness, draw);
        } else {
            let fitness = |state: &[Vec<f64>; STATES], values: &mut [f64]| {
                evidence.fill(state, epoch.sights, epoch.left_out, likelihood);
                match &prior {
                    Some(prior) => prior.evaluate(state, values),
                    None => values.fill(0.0),
                }
                for (value, log) in values.iter_mut().zip(evidence.total()) {
                    *value += log;
                }
            };
            swarm.run(state, settings, fitness, draw);
        }
        *swarm.leader()
    }

    fn conclude(
        &mut self,
        log_evidence: f64,
        resample_below: f64,
        random: &mut impl Rng,
    ) -> Outcome {
        let effective = self.cloud.effective();
        let estimate_m = self.cloud.mean();
        if effective < resample_below * self.cloud.len() as f64 {
            self.cloud.resample(random);
        }
        Outcome {
            log_evidence,
            effective,
            estimate_m,
        }
    }
}
