//! What can be set of the particle filters and their decision, with defaults and reasons.

use crate::particle::Likelihood;
use crate::particle::swarm::{SwarmOrder, SwarmSettings};
use crate::{MonitorError, STATES, Sight, error::within};

/// What moves the predicted particles towards the measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Movement {
    /// Nothing: the bootstrap particle filter.
    Bootstrap,
    /// A particle swarm, Wang2016 (3) to (7).
    Swarm(SwarmSettings),
}

/// How the clock state is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockState {
    /// A coordinate of every particle, as in Wang2016.
    Sampled,
    /// Integrated out in closed form: each particle carries the mean of its clock, all of them one
    /// variance (Rao-Blackwell). Needs [`Likelihood::Gaussian`] and [`Movement::Bootstrap`].
    Marginalised,
}

/// Which cumulative log-likelihood ratio decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RatioForm {
    /// ln p_q(y without q) - ln p_main(y without q), as Wang2016 reads: every satellite's ratio
    /// explains other data, so that the largest is no comparison of hypotheses.
    Paper,
    /// ln p_q(y without q) - ln `fault_width_m` - ln p_main(y): the satellite left out is scored
    /// by a uniform fault density, and every hypothesis explains the same measurements.
    Sound,
}

/// What the bank does with the satellite it alarms on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Response {
    /// Nothing: the ratios go on growing, as in the figures of Wang2016.
    Observe,
    /// Sets it aside until it fits again.
    Exclude,
}

/// Parameters of particle-filter integrity monitoring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleParameters {
    /// Particles of each filter, 10 to 10 000. Default 50 (Wang2016).
    pub particles: usize,
    /// Standard deviation of the first particles about the reference point, m. Default 3: one
    /// standard deviation of a pseudorange.
    pub initial_sigma_m: f64,
    /// Process noise of each position coordinate, m per square root of a second. Default 0.25: a
    /// receiver at rest whose particles must not die out.
    pub position_noise_m: f64,
    /// Process noise of the clock, m per square root of a second. Default 0.25: a clock that
    /// walks by 0.1 m, with the same margin.
    pub clock_noise_m: f64,
    /// Deviation the filters believe over the one a sight states, 0.1 to 100. Default 1. What
    /// stays with a satellite for longer than the window is no news in every epoch, though the
    /// ratios count it so: noise with biases of just the stated deviation needs about 1.5.
    pub deviation_factor: f64,
    /// Believed shape of the measurement noise. Default Gaussian (Wang2016 (5)).
    pub likelihood: Likelihood,
    /// Share of the particles below which the effective number must fall for resampling, above 0
    /// to 1. Default 1, every epoch: the cloud's evidence then needs no weights.
    pub resample_below: f64,
    /// What moves the particles. Default none.
    pub movement: Movement,
    /// How the clock is held. Default sampled.
    pub clock: ClockState,
    /// Which ratio decides. Default sound: it names the right satellite.
    pub ratio: RatioForm,
    /// Width of the uniform fault density, m. Default 100: of 50 to 100, which lose least against
    /// steps of 15 to 30 m, the one with fewer false alarms.
    pub fault_width_m: f64,
    /// Longest window the ratios are summed over, epochs, 1 to 1000. Default 30 (Wang2016).
    pub window_epochs: usize,
    /// A decision above this is an alarm. Default 20 (Wang2016): odds of 5e8.
    pub threshold: f64,
    /// First epochs, which bring the clouds to rest and count for nothing. Default 20: the prior
    /// of 3 m is forgotten in about sqrt(sigma^2 h / q^2) = 4 epochs.
    pub warm_up_epochs: usize,
    /// What happens to an alarmed satellite. Default it is set aside.
    pub response: Response,
}

impl Default for ParticleParameters {
    fn default() -> Self {
        Self {
            particles: 50,
            initial_sigma_m: 3.0,
            position_noise_m: 0.25,
            clock_noise_m: 0.25,
            deviation_factor: 1.0,
            likelihood: Likelihood::Gaussian,
            resample_below: 1.0,
            movement: Movement::Bootstrap,
            clock: ClockState::Sampled,
            ratio: RatioForm::Sound,
            fault_width_m: 100.0,
            window_epochs: 30,
            threshold: 20.0,
            warm_up_epochs: 20,
            response: Response::Exclude,
        }
    }
}

impl ParticleParameters {
    /// The setting of Wang2016 (N = 50, tau = 20, U = 30) with its own ratio, and nothing excluded.
    #[must_use]
    pub fn wang2016(movement: Movement) -> Self {
        Self {
            movement,
            ratio: RatioForm::Paper,
            response: Response::Observe,
            ..Self::default()
        }
    }

    /// For a receiver at rest by [`ParticleMonitor`](crate::particle::ParticleMonitor): 200
    /// particles, normal noise of the stated deviation, and a clock that is integrated out, or
    /// sampled under a swarm.
    ///
    /// The clock noise has to cover the error of the median residual that the monitor steers its
    /// reference by, half a deviation of a pseudorange: 10 m where the clock is integrated out and
    /// a wide prior costs nothing, 1.5 m where particles have to find it. The noise of receivers
    /// in the open is slow rather than heavy-tailed: with satellite biases of 2 m, a mixture
    /// likelihood first takes a step of 15 m for a tail. Deviations from the accuracy that
    /// satellites broadcast leave room for biases by themselves; deviations that are just true
    /// need a [`deviation_factor`](Self::deviation_factor). A swarm is corrected for: moved and
    /// not corrected, the main filter follows a faulty satellite at once, and less speaks against
    /// it.
    #[must_use]
    pub fn receiver(movement: Movement) -> Self {
        let (movement, clock, clock_noise_m) = match movement {
            Movement::Bootstrap => (movement, ClockState::Marginalised, 10.0),
            Movement::Swarm(swarm) => {
                let corrected = SwarmSettings {
                    order: SwarmOrder::Corrected,
                    ..swarm
                };
                (Movement::Swarm(corrected), ClockState::Sampled, 1.5)
            }
        };
        Self {
            particles: 200,
            clock_noise_m,
            movement,
            clock,
            ..Self::default()
        }
    }

    /// These parameters, if all are possible and go together.
    ///
    /// # Errors
    /// [`MonitorError::Value`] naming the first that is not possible,
    /// [`MonitorError::Combination`] where two exclude one another.
    pub fn check(self) -> Result<CheckedParticleParameters, MonitorError> {
        let spread = ((1e-3, 1e5), "0.001 to 1e5");
        let numbers = [
            (
                "particles",
                self.particles as f64,
                ((10.0, 1e4), "10 to 10000"),
            ),
            (
                "window (epochs)",
                self.window_epochs as f64,
                ((1.0, 1e3), "1 to 1000"),
            ),
            (
                "warm-up (epochs)",
                self.warm_up_epochs as f64,
                ((0.0, 1e6), "0 to 1000000"),
            ),
            ("initial deviation (m)", self.initial_sigma_m, spread),
            ("position noise (m)", self.position_noise_m, spread),
            ("clock noise (m)", self.clock_noise_m, spread),
            (
                "deviation factor",
                self.deviation_factor,
                ((0.1, 100.0), "0.1 to 100"),
            ),
            (
                "resampling share",
                self.resample_below,
                ((1e-3, 1.0), "0.001 to 1"),
            ),
            (
                "fault width (m)",
                self.fault_width_m,
                ((1.0, 1e6), "1 to 1e6"),
            ),
            ("threshold", self.threshold, ((1e-3, 1e6), "0.001 to 1e6")),
        ];
        for (name, value, (limits, expected)) in numbers {
            within(name, value, limits, expected)?;
        }
        self.likelihood.check()?;
        if let Movement::Swarm(settings) = self.movement {
            settings.check()?;
        }
        self.check_marginalised()?;
        Ok(CheckedParticleParameters(self))
    }

    /// The clock integrates in closed form only under a Gaussian likelihood and unmoved particles.
    fn check_marginalised(&self) -> Result<(), MonitorError> {
        let refuse = |other, reason| {
            Err(MonitorError::Combination {
                setting: "a marginalised clock",
                other,
                reason,
            })
        };
        if self.clock == ClockState::Sampled {
            return Ok(());
        }
        if self.likelihood != Likelihood::Gaussian {
            return refuse(
                "this likelihood",
                "only a Gaussian one integrates in closed form",
            );
        }
        if self.movement != Movement::Bootstrap {
            return refuse("a swarm", "moved particles have no clock of their own");
        }
        Ok(())
    }
}

/// Parameters that passed [`ParticleParameters::check`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedParticleParameters(ParticleParameters);

impl CheckedParticleParameters {
    /// The parameters.
    #[must_use]
    pub const fn get(&self) -> &ParticleParameters {
        &self.0
    }

    /// `sight` with the deviation the filters believe.
    pub(super) fn believed(&self, sight: &Sight) -> Sight {
        Sight {
            sigma_m: sight.sigma_m * self.0.deviation_factor,
            ..*sight
        }
    }

    /// Standard deviations (m) of the process noise over `elapsed_s` seconds; a marginalised clock
    /// takes none, its variance grows instead.
    pub(super) fn process_sigma_m(&self, elapsed_s: f64) -> [f64; STATES] {
        let root = elapsed_s.sqrt();
        let position = self.0.position_noise_m * root;
        [
            position,
            position,
            position,
            self.sampled(self.0.clock_noise_m * root),
        ]
    }

    /// Standard deviations (m) of the first particles.
    pub(super) fn initial_sigma_m(&self) -> [f64; STATES] {
        let sigma = self.0.initial_sigma_m;
        [sigma, sigma, sigma, self.sampled(sigma)]
    }

    fn sampled(&self, sigma_m: f64) -> f64 {
        match self.0.clock {
            ClockState::Sampled => sigma_m,
            ClockState::Marginalised => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_setting_and_the_defaults_are_possible() {
        let swarm = Movement::Swarm(SwarmSettings::default());
        for movement in [Movement::Bootstrap, swarm] {
            assert!(ParticleParameters::wang2016(movement).check().is_ok());
        }
        assert!(ParticleParameters::default().check().is_ok());
    }

    #[test]
    fn what_is_impossible_is_named() {
        let message = |p: ParticleParameters| p.check().unwrap_err().to_string();
        let base = ParticleParameters::default();
        let particles = 0;
        assert!(message(ParticleParameters { particles, ..base }).starts_with("particles is 0"));
        let threshold = f64::NAN;
        assert!(message(ParticleParameters { threshold, ..base }).starts_with("threshold is NaN"));
        let clock = ClockState::Marginalised;
        let movement = Movement::Swarm(SwarmSettings::default());
        let both = message(ParticleParameters {
            clock,
            movement,
            ..base
        });
        assert!(
            both.starts_with("a marginalised clock cannot be combined with a swarm"),
            "{both}"
        );
    }
}
