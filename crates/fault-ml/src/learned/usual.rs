//! What a channel is used to.

/// Weight of the newest step in the running mean: 500 steps, ten seconds.
const SHARE: f64 = 0.002;

/// The mean of the first steps, later a running mean. The first step alone is no measure: at 30 dB-Hz its C/N0 may be
/// three decibels off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Usual {
    value: f64,
    steps: f64,
}

impl Usual {
    /// Before the first step.
    pub(super) const NEW: Self = Self {
        value: 0.0,
        steps: 0.0,
    };

    /// Takes in the value of the next step, `passing` of which befell all channels that were there before this one:
    /// it was another before, as theirs were, and gets used to it as they do.
    pub(super) fn follow(&mut self, value: f64, passing: f64) {
        self.steps += 1.0;
        let share = SHARE.max(1.0 / self.steps);
        self.value += share * (value - self.value) - (share - SHARE) * passing;
    }

    /// What it is used to; zero before the first step.
    pub(super) const fn value(&self) -> f64 {
        self.value
    }

    /// Steps taken in.
    pub(super) const fn steps(&self) -> f64 {
        self.steps
    }

    /// Whether it has taken in nothing.
    pub(super) fn is_new(&self) -> bool {
        self.steps == 0.0
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    #[test]
    fn it_is_the_mean_of_the_first_steps_and_follows_slowly_later() {
        let mut usual = Usual::NEW;
        assert!(usual.is_new());
        for (value, mean) in [(-3.0, -3.0), (1.0, -1.0), (2.0, 0.0), (4.0, 1.0)] {
            usual.follow(value, 0.0);
            assert_abs_diff_eq!(usual.value(), mean, epsilon = 1e-12);
        }
        for _ in 4..10_000 {
            usual.follow(1.0, 0.0);
        }
        for _ in 0..500 {
            usual.follow(2.0, 0.0);
        }
        // 500 steps of a weight of 1/500: all but 1/e of the change.
        assert_abs_diff_eq!(usual.value(), 2.0 - (-1_f64).exp(), epsilon = 1e-3);
    }

    #[test]
    fn one_that_begins_late_gets_used_to_what_passes_as_the_others_do() {
        let (mut early, mut late) = (Usual::NEW, Usual::NEW);
        for _ in 0..2000 {
            early.follow(4.0, 0.0);
        }
        for step in 0..600 {
            // All are weaker by one; the late one begins 100 steps afterwards.
            early.follow(3.0, 0.0);
            if step >= 100 {
                late.follow(7.0, 3.0 - early.value());
                assert_abs_diff_eq!(late.value() - 4.0, early.value(), epsilon = 2.1e-3);
            }
        }
    }
}
