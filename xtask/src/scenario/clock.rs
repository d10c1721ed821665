//! The receiver's clock: a bias that drifts, wanders and may jump.

use anyhow::{Result, ensure};
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;

/// Between two nodes of a clock, s: its frequency is constant there.
const NODE_S: f64 = 5e-3;
/// How far before the first sample a clock is known, s.
const LEAD_S: f64 = 1.0;

/// Clock of a scenario file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockSpec {
    /// Oscillator whose noise is taken.
    #[serde(default)]
    pub preset: Preset,
    /// Receiver clock minus GPS time at the first sample, s.
    #[serde(default)]
    pub bias_s: f64,
    /// Rate of the bias at the first sample, s/s.
    #[serde(default)]
    pub drift: f64,
    /// White frequency noise in place of the preset's, s.
    pub h0_s: Option<f64>,
    /// Random walk of frequency in place of the preset's, 1/s.
    pub h_minus_2_per_s: Option<f64>,
}

impl Default for ClockSpec {
    fn default() -> Self {
        Self {
            preset: Preset::Ideal,
            bias_s: 0.0,
            drift: 0.0,
            h0_s: None,
            h_minus_2_per_s: None,
        }
    }
}

/// Kinds of oscillator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// No noise.
    #[default]
    Ideal,
    /// Temperature-compensated crystal: h0 = 1e-21 s, h-2 = 2e-20 1/s (`Irsigler2002`). The h0
    /// of 2e-19 s that navigation filters assume covers flicker noise; as white frequency noise it
    /// would shake a carrier loop of 10 Hz by 30 degrees.
    Tcxo,
    /// Oven-controlled crystal: h0 = 2e-25 s, h-2 = 6e-25 1/s (`Brown2012`).
    Ocxo,
    /// Chip-scale atomic clock, undisciplined in the short term: h0 = 1.2e-19 s,
    /// h-2 = 4e-27 1/s (`Kitching2005`).
    Csac,
}

impl Preset {
    /// h0 (s) and h-2 (1/s).
    const fn coefficients(self) -> (f64, f64) {
        match self {
            Self::Ideal => (0.0, 0.0),
            Self::Tcxo => (1e-21, 2e-20),
            Self::Ocxo => (2e-25, 6e-25),
            Self::Csac => (1.2e-19, 4e-27),
        }
    }
}

/// Bias of the receiver's clock against GPS time, over elapsed time by that clock.
#[derive(Debug, Clone)]
pub struct ReceiverClock {
    /// Bias at every [`NODE_S`] from [`LEAD_S`] before the first sample on, s.
    nodes_s: Vec<f64>,
    /// Instants and sizes of jumps, s, by instant.
    jumps_s: Vec<(f64, f64)>,
}

impl ReceiverClock {
    /// The clock of `spec` over `duration_s`, its noise drawn with `seed`, with jumps of
    /// (instant, size) in s.
    ///
    /// Frequency is white with two-sided density h0 / 2 plus a random walk of
    /// 2 pi^2 h-2 s^2/s^3 (`Brown2012`), constant over 5 ms.
    ///
    /// # Errors
    /// Names a value that is impossible.
    pub fn new(
        spec: &ClockSpec,
        duration_s: f64,
        seed: u64,
        mut jumps_s: Vec<(f64, f64)>,
    ) -> Result<Self> {
        let preset = spec.preset.coefficients();
        let h0_s = spec.h0_s.unwrap_or(preset.0);
        let h_minus_2 = spec.h_minus_2_per_s.unwrap_or(preset.1);
        for (name, value, limit) in [
            ("bias_s", spec.bias_s.abs(), 1.0),
            ("drift", spec.drift.abs(), 1e-4),
            ("h0_s", h0_s, 1e-12),
            ("h_minus_2_per_s", h_minus_2, 1e-12),
        ] {
            ensure!(
                (0.0..=limit).contains(&value),
                "clock: {name} is {value}: expected at most {limit}"
            );
        }
        jumps_s.sort_by(|a, b| a.0.total_cmp(&b.0));
        let nodes = ((duration_s + 2.0 * LEAD_S) / NODE_S).ceil() as usize + 1;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let white = (h0_s / 2.0 / NODE_S).sqrt();
        let walk = (2.0 * std::f64::consts::PI.powi(2) * h_minus_2 * NODE_S).sqrt();
        let noisy = white > 0.0 || walk > 0.0;
        let mut normal = || -> f64 {
            if noisy {
                StandardNormal.sample(&mut random)
            } else {
                0.0
            }
        };
        let (mut bias_s, mut drift) = (0.0, spec.drift);
        let mut nodes_s = Vec::with_capacity(nodes);
        for _ in 0..nodes {
            nodes_s.push(bias_s);
            bias_s += (drift + white * normal()) * NODE_S;
            drift += walk * normal();
        }
        let mut clock = Self { nodes_s, jumps_s };
        let shift_s = spec.bias_s - clock.smooth_s(0.0).0;
        clock.nodes_s.iter_mut().for_each(|bias| *bias += shift_s);
        Ok(clock)
    }

    /// Bias (s) and its rate (s/s) at `elapsed_s`, with the jumps that have happened by
    /// `within_s`.
    #[must_use]
    pub fn at(&self, elapsed_s: f64, within_s: f64) -> (f64, f64) {
        let (bias_s, drift) = self.smooth_s(elapsed_s);
        let happened = self.jumps_s.iter().take_while(|(at, _)| *at <= within_s);
        (bias_s + happened.map(|(_, size)| size).sum::<f64>(), drift)
    }

    /// Bias in m and rate in m/s.
    #[must_use]
    pub fn metres_at(&self, elapsed_s: f64) -> (f64, f64) {
        let (bias_s, drift) = self.at(elapsed_s, elapsed_s);
        (SPEED_OF_LIGHT_MPS * bias_s, SPEED_OF_LIGHT_MPS * drift)
    }

    /// Without jumps.
    fn smooth_s(&self, elapsed_s: f64) -> (f64, f64) {
        let at = ((elapsed_s + LEAD_S) / NODE_S).max(0.0);
        let first = (at as usize).min(self.nodes_s.len().saturating_sub(2));
        match self.nodes_s.get(first..first + 2) {
            Some(&[a, b]) => (a + (b - a) * (at - first as f64), (b - a) / NODE_S),
            _ => (0.0, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(preset: Preset) -> ClockSpec {
        ClockSpec {
            preset,
            bias_s: 1e-3,
            drift: 1e-7,
            ..ClockSpec::default()
        }
    }

    #[test]
    fn an_ideal_clock_runs_straight_and_jumps() {
        let jumps = vec![(3.0, -1e-3), (2.0, 5e-4)];
        let clock = ReceiverClock::new(&spec(Preset::Ideal), 10.0, 1, jumps).unwrap();
        // Rounding of 2200 sums.
        let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
        assert!(close(clock.at(0.0, 0.0).0, 1e-3));
        assert!(close(clock.at(2.0, 1.9).0, 1e-3 + 2e-7));
        assert!(close(clock.at(2.0, 2.0).0, 1.5e-3 + 2e-7));
        assert!(close(clock.at(10.0, 10.0).0, 0.5e-3 + 1e-6));
        assert!(close(clock.at(-0.9, 0.0).0, 1e-3 - 0.9e-7));
    }

    #[test]
    fn noise_has_the_variance_of_its_coefficients() {
        // Over 1 s: var = h0 / 2 + 2 pi^2 h-2 / 3; 400 clocks know it to 7 % (1 sigma).
        let spread = |preset| {
            let ends = (0..400).map(|seed| {
                let clock = ReceiverClock::new(&spec(preset), 1.0, seed, vec![]).unwrap();
                let begin = clock.nodes_s[0];
                // The walk starts with the nodes.
                (clock.nodes_s[200] - begin - 1e-7).powi(2)
            });
            ends.sum::<f64>() / 400.0
        };
        let expected = 5e-22 + 2.0 * std::f64::consts::PI.powi(2) * 2e-20 / 3.0;
        let ratio = spread(Preset::Tcxo) / expected;
        assert!((0.75..1.25).contains(&ratio), "{ratio}");
    }

    #[test]
    fn the_seed_decides() {
        let clock = |seed| ReceiverClock::new(&spec(Preset::Tcxo), 5.0, seed, vec![]).unwrap();
        assert_eq!(clock(3).nodes_s, clock(3).nodes_s);
        assert_ne!(clock(3).nodes_s, clock(4).nodes_s);
        let absurd = ClockSpec {
            drift: 0.1,
            ..ClockSpec::default()
        };
        let error = ReceiverClock::new(&absurd, 1.0, 0, vec![]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "clock: drift is 0.1: expected at most 0.0001"
        );
    }
}
