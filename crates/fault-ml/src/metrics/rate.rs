//! Counted rates and shares with exact intervals.

use statrs::distribution::{Beta, ChiSquared, ContinuousCDF};

/// Probability outside an interval on either side: 95 % are within.
const OUTSIDE: f64 = 0.025;

/// Events over time, with the exact interval of 95 % for independent events.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateInterval {
    /// Events counted.
    pub events: usize,
    /// Hours they were counted in.
    pub hours: f64,
    /// Events an hour.
    pub per_hour: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end: above zero where none was seen.
    pub high: f64,
}

impl RateInterval {
    /// Of `events` in so many `hours`: half of the chi-square quantiles of twice as many degrees of freedom
    /// (Garwood1936).
    #[must_use]
    pub fn poisson(events: usize, hours: f64) -> Self {
        let quantile = |freedom: f64, p| {
            let chi = ChiSquared::new(freedom).ok();
            chi.map_or(0.0, |chi| 0.5 * chi.inverse_cdf(p))
        };
        let count = events as f64;
        Self {
            events,
            hours,
            per_hour: count / hours,
            low: quantile(2.0 * count, OUTSIDE) / hours,
            high: quantile(2.0 * count + 2.0, 1.0 - OUTSIDE) / hours,
        }
    }
}

/// Part of a number of trials, with the exact interval of 95 % for independent trials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// Trials that count.
    pub hits: usize,
    /// All trials.
    pub trials: usize,
    /// Hits over trials; zero of none.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Share {
    /// Of `hits` in `trials` (ClopperPearson1934).
    #[must_use]
    pub fn of(hits: usize, trials: usize) -> Self {
        let (k, n) = (hits as f64, trials as f64);
        let quantile = |a: f64, b: f64, p, otherwise| {
            let beta = Beta::new(a, b).ok();
            beta.map_or(otherwise, |beta| beta.inverse_cdf(p))
        };
        Self {
            hits,
            trials,
            value: if trials == 0 { 0.0 } else { k / n },
            low: quantile(k, n - k + 1.0, OUTSIDE, 0.0),
            high: quantile(k + 1.0, n - k, 1.0 - OUTSIDE, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_the_tables() {
        // Garwood: none seen, 0 to 3.689; ten, 4.795 to 18.39.
        let none = RateInterval::poisson(0, 1.0);
        assert_eq!((none.per_hour, none.low), (0.0, 0.0));
        assert!((none.high - 3.6889).abs() < 1e-3, "{none:?}");
        let ten = RateInterval::poisson(10, 2.0);
        assert!((2.0 * ten.low - 4.7954).abs() < 1e-3 && (2.0 * ten.high - 18.3904).abs() < 1e-3);
        // Clopper and Pearson: 8 of 10, 0.4439 to 0.9748.
        let share = Share::of(8, 10);
        assert!((share.low - 0.4439).abs() < 1e-3 && (share.high - 0.9748).abs() < 1e-3);
        assert_eq!((Share::of(0, 5).low, Share::of(5, 5).high), (0.0, 1.0));
        assert_eq!(Share::of(0, 0).value, 0.0);
    }
}
