//! Particle swarm: particles drawn to the best place they have seen, Wang2016 (3) and (4).

use rand::Rng;

use crate::{MonitorError, STATES, error::within};

/// When the swarm moves, and what becomes of the weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SwarmOrder {
    /// Weights at the predicted particles, then the move, then normalisation: Wang2016 as printed.
    /// A particle keeps the weight of the place it left.
    WeighThenMove,
    /// The move, then weights at the moved particles, without correction for having moved.
    MoveThenWeigh,
    /// The swarm only finds the most likely state. Particles are then drawn from a normal
    /// distribution about it, and weighted by likelihood x prior / density drawn from: the move
    /// is an importance proposal, and the posterior stays what it was.
    Corrected,
}

/// Settings of the swarm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwarmSettings {
    /// Moves in each epoch, 1 to 1000. Default 10 (Wang2016).
    pub iterations: usize,
    /// Inertia w, 0 to 1. Default 0.6; Wang2016 states none.
    pub inertia: f64,
    /// Attraction c1 = c2 to a particle's own best place and to the best of all, 0 to 4.
    /// Default 1.2; Wang2016 states none. With w = 0.6 the delays of its first table come out
    /// within 2 s and the effective numbers of its second within 2.
    pub attraction: f64,
    /// Order of weighting and moving. Default as printed.
    pub order: SwarmOrder,
}

impl Default for SwarmSettings {
    fn default() -> Self {
        Self {
            iterations: 10,
            inertia: 0.6,
            attraction: 1.2,
            order: SwarmOrder::WeighThenMove,
        }
    }
}

impl SwarmSettings {
    pub(super) fn check(&self) -> Result<(), MonitorError> {
        let iterations = self.iterations as f64;
        within("swarm iterations", iterations, (1.0, 1e3), "1 to 1000")?;
        within("inertia", self.inertia, (0.0, 1.0), "0 to 1")?;
        within("attraction", self.attraction, (0.0, 4.0), "0 to 4")
    }
}

/// The swarm over one cloud; its arrays are kept between epochs.
#[derive(Debug, Clone)]
pub(super) struct Swarm {
    velocity: [Vec<f64>; STATES],
    best: [Vec<f64>; STATES],
    best_fitness: Vec<f64>,
    fitness: Vec<f64>,
    /// For coordinate d, r1 of all particles and then r2: `uniform[2 d N ..]`.
    uniform: Vec<f64>,
    /// Best place of all, and its fitness.
    leader: [f64; STATES],
    leader_fitness: f64,
}

impl Swarm {
    pub(super) fn new(particles: usize) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0.0; particles]);
        Self {
            velocity: zeros(),
            best: zeros(),
            best_fitness: vec![0.0; particles],
            fitness: vec![0.0; particles],
            uniform: vec![0.0; 2 * STATES * particles],
            leader: [0.0; STATES],
            leader_fitness: f64::NEG_INFINITY,
        }
    }

    /// The best place found, m.
    pub(super) const fn leader(&self) -> &[f64; STATES] {
        &self.leader
    }

    /// Its fitness.
    #[cfg(test)]
    pub(super) const fn leader_fitness(&self) -> f64 {
        self.leader_fitness
    }

    /// Moves the particles `state` from rest. `fitness` writes the fitness of every particle, to
    /// be made large; `draw` fills an array with uniform numbers in (0, 1).
    ///
    /// All particles move before the best of all is renewed, so that their order is of no weight.
    pub(super) fn run(
        &mut self,
        state: &mut [Vec<f64>; STATES],
        settings: &SwarmSettings,
        mut fitness: impl FnMut(&[Vec<f64>; STATES], &mut [f64]),
        mut draw: impl FnMut(&mut [f64]),
    ) {
        fitness(state, &mut self.best_fitness);
        for (d, coordinates) in state.iter().enumerate() {
            self.best[d].copy_from_slice(coordinates);
            self.velocity[d].fill(0.0);
        }
        self.leader_fitness = f64::NEG_INFINITY;
        self.follow_leader();
        for _ in 0..settings.iterations {
            draw(&mut self.uniform);
            self.accelerate(state, settings);
            fitness(state, &mut self.fitness);
            self.remember(state);
            self.follow_leader();
        }
    }

    /// Wang2016 (3) and (4), one coordinate at a time.
    fn accelerate(&mut self, state: &mut [Vec<f64>; STATES], settings: &SwarmSettings) {
        let (inertia, attraction) = (settings.inertia, settings.attraction);
        let count = self.fitness.len();
        for (d, coordinates) in state.iter_mut().enumerate() {
            let (r1, r2) = self.uniform[2 * d * count..][..2 * count].split_at(count);
            let random = r1.iter().zip(r2);
            let own = self.velocity[d].iter_mut().zip(&self.best[d]);
            for ((x, (v, best)), (r1, r2)) in coordinates.iter_mut().zip(own).zip(random) {
                let pull = r1 * (best - *x) + r2 * (self.leader[d] - *x);
                *v = inertia * *v + attraction * pull;
                *x += *v;
            }
        }
    }

    /// Renews every particle's own best place; selections instead of branches.
    fn remember(&mut self, state: &[Vec<f64>; STATES]) {
        for (best, coordinates) in self.best.iter_mut().zip(state) {
            let fitness = self.fitness.iter().zip(&self.best_fitness);
            for ((best, x), (new, old)) in best.iter_mut().zip(coordinates).zip(fitness) {
                *best = if new > old { *x } else { *best };
            }
        }
        for (old, new) in self.best_fitness.iter_mut().zip(&self.fitness) {
            *old = if *new > *old { *new } else { *old };
        }
    }

    fn follow_leader(&mut self) {
        let start = (None, self.leader_fitness);
        let fitness = self.best_fitness.iter().enumerate();
        let (leader, best) = fitness.fold(start, |(leader, best), (i, fitness)| {
            if *fitness > best {
                (Some(i), *fitness)
            } else {
                (leader, best)
            }
        });
        if let Some(i) = leader {
            self.leader = std::array::from_fn(|d| self.best[d][i]);
            self.leader_fitness = best;
        }
    }
}

/// Fills `uniform` with numbers in (0, 1), ends excluded, 32 bits each: two of one draw.
pub(super) fn draw_uniform(random: &mut impl Rng, uniform: &mut [f64]) {
    const STEP: f64 = 1.0 / 4_294_967_296.0;
    for pair in uniform.chunks_mut(2) {
        let bits = random.next_u64();
        for (number, half) in pair.iter_mut().zip([bits as u32, (bits >> 32) as u32]) {
            *number = (f64::from(half) + 0.5) * STEP;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_swarm_climbs_and_never_forgets_its_best() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut state: [Vec<f64>; STATES] = std::array::from_fn(|_| vec![0.0; 30]);
        for coordinates in &mut state {
            draw_uniform(&mut random, coordinates);
        }
        let hill = |state: &[Vec<f64>; STATES], fitness: &mut [f64]| {
            for (i, f) in fitness.iter_mut().enumerate() {
                *f = -state.iter().map(|x| (x[i] - 0.9).powi(2)).sum::<f64>();
            }
        };
        let mut swarm = Swarm::new(30);
        let mut reached = Vec::new();
        for iterations in [1, 10, 60] {
            let settings = SwarmSettings {
                iterations,
                ..SwarmSettings::default()
            };
            let mut start = state.clone();
            swarm.run(&mut start, &settings, hill, |u| {
                draw_uniform(&mut ChaCha8Rng::seed_from_u64(9), u)
            });
            reached.push(swarm.leader_fitness());
        }
        assert!(
            reached[0] <= reached[1] && reached[1] <= reached[2],
            "{reached:?}"
        );
        // 0.5 m away at first on average; the last must be far closer than that in each axis.
        assert!(reached[2] > -0.05, "{reached:?}");
    }

    #[test]
    fn uniform_numbers_lie_inside_and_have_the_right_mean() {
        let mut numbers = vec![0.0; 40_001];
        draw_uniform(&mut ChaCha8Rng::seed_from_u64(2), &mut numbers);
        assert!(numbers.iter().all(|u| *u > 0.0 && *u < 1.0));
        let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
        // Standard deviation of the mean 1/sqrt(12 n) = 0.00144; four of them.
        assert!((mean - 0.5).abs() < 0.0058, "{mean}");
    }
}
