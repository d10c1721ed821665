//! The level at the quantiser in time.

use crate::scenario::antenna::Gain;

/// Step of the level control, s.
const STEP_S: f64 = 1e-3;
/// Steps remembered: four seconds, twice what a channel can go back.
const HELD: usize = 4096;

/// Variance of a component that the quantiser is set for.
#[derive(Debug, Clone)]
pub(super) struct Level {
    gain: Gain,
    /// By step, modulo [`HELD`].
    variances: Vec<f64>,
    /// Steps made.
    steps: usize,
}

impl Level {
    /// Set for components of `variance`.
    pub(super) fn new(gain: Gain, variance: f64) -> Self {
        Self {
            gain,
            variances: vec![variance; HELD],
            steps: 0,
        }
    }

    /// The next step of the level control up to `elapsed_s`: its begin and end, s.
    pub(super) fn due(&self, elapsed_s: f64) -> Option<(f64, f64)> {
        let begin_s = self.steps as f64 * STEP_S;
        let due = matches!(self.gain, Gain::Automatic { .. }) && begin_s < elapsed_s;
        due.then_some((begin_s, begin_s + STEP_S))
    }

    /// Takes the variance of the components over the step due.
    pub(super) fn follow(&mut self, variance: f64) {
        let Gain::Automatic { time_s } = self.gain else {
            return;
        };
        let before = self.variances[self.steps % HELD];
        let share = 1.0 - (-STEP_S / time_s).exp();
        self.steps += 1;
        self.variances[self.steps % HELD] = before + share * (variance - before);
    }

    /// The variance it is set for at `elapsed_s`.
    pub(super) fn at(&self, elapsed_s: f64) -> f64 {
        let step = ((elapsed_s / STEP_S) as usize).min(self.steps);
        self.variances[step % HELD]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_automatic_level_follows_and_a_fixed_one_stays() {
        let mut fixed = Level::new(Gain::Fixed, 2.0);
        assert_eq!(fixed.due(1.0), None);
        fixed.follow(9.0);
        assert_eq!(fixed.at(0.5), 2.0);
        let mut automatic = Level::new(Gain::Automatic { time_s: 0.05 }, 2.0);
        while automatic.due(0.1).is_some() {
            automatic.follow(4.0);
        }
        assert_eq!(automatic.at(0.0), 2.0);
        // Two time constants.
        let expected = 4.0 - 2.0 * (-2.0f64).exp();
        assert!((automatic.at(0.1) - expected).abs() < 1e-9);
    }
}
