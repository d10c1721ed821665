//! Kalman filters in place of the particle filters: the ratios of Wang2016 in closed form.

use super::kalman::{KalmanFilter, KalmanParameters};
use crate::{STATES, Sight};

/// Increments of one epoch, by satellite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KalmanIncrements {
    /// ln p_q(y without q) - ln p_main(y without q).
    pub paper: f64,
    /// ln p_q(y without q) - ln (fault width) - ln p_main(y).
    pub sound: f64,
}

/// A main filter and one without each of a fixed set of satellites.
#[derive(Debug, Clone)]
pub struct KalmanBank {
    main: KalmanFilter,
    subfilters: Vec<KalmanFilter>,
    log_fault_width: f64,
    normalised_square: f64,
}

impl KalmanBank {
    /// For `satellites` satellites, always given in the same order.
    #[must_use]
    pub fn new(parameters: &KalmanParameters, satellites: usize, fault_width_m: f64) -> Self {
        let filter = KalmanFilter::new(parameters);
        Self {
            main: filter,
            subfilters: vec![filter; satellites],
            log_fault_width: fault_width_m.ln(),
            normalised_square: 0.0,
        }
    }

    /// State of the main filter, m about the reference point.
    #[must_use]
    pub fn state_m(&self) -> [f64; STATES] {
        self.main.state_m()
    }

    /// Normalised innovation squared of the last epoch: chi-square of as many degrees of freedom
    /// as satellites.
    #[must_use]
    pub const fn normalised_square(&self) -> f64 {
        self.normalised_square
    }

    /// Takes one epoch.
    pub fn epoch(&mut self, sights: &[Sight]) -> Vec<KalmanIncrements> {
        let predicted = self.main;
        let (log_all, normalised_square) = self.main.epoch(sights.iter());
        self.normalised_square = normalised_square;
        let log_fault_width = self.log_fault_width;
        let filters = self.subfilters.iter_mut().enumerate();
        filters
            .map(|(q, filter)| {
                let others = || sights.iter().enumerate().filter(move |(s, _)| *s != q);
                let (own, _) = filter.epoch(others().map(|(_, sight)| sight));
                let main = predicted.expectation(others().map(|(_, sight)| sight));
                KalmanIncrements {
                    paper: own - main,
                    sound: own - log_fault_width - log_all,
                }
            })
            .collect()
    }
}
