//! How far the measurements of all channels scatter beyond what is stated of them.
//!
//! Range rates of different satellites do not hold over quite the same time: each follows the bits of its own
//! satellite. White noise of the clock's frequency is therefore not quite common to all, and of an oscillator with much
//! of it, or of one that is shaken, healthy channels deviate from each other by several stated deviations. What most
//! channels do is no channel's fault.

use gnss_nav::filter::GivenOthers;

/// Time over which it is found, s.
const MEMORY_S: f64 = 2.0;
/// Fewer satellites than this tell nothing of most.
const FEWEST: usize = 5;
/// Mean square of normal numbers of deviation one without the largest quarter.
const MEAN_SQUARE: f64 = 0.3685;

/// Found variance over stated variance, of pseudoranges and of range rates; never below one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scatter {
    code: Ratio,
    rate: Ratio,
}

impl Scatter {
    /// Nothing was seen yet.
    pub(super) const fn new() -> Self {
        Self {
            code: Ratio::NEW,
            rate: Ratio::NEW,
        }
    }

    /// Takes the deviations of an epoch, `interval_s` after the last one, each given all others of them.
    pub(super) fn follow<'a>(
        &mut self,
        given: impl Iterator<Item = &'a GivenOthers> + Clone,
        interval_s: f64,
    ) {
        let code = given.clone().map(|g| g.code.normalised_squared());
        self.code.follow(code.collect(), interval_s);
        let rate = given.filter_map(|g| Some(g.rate?.normalised_squared()));
        self.rate.follow(rate.collect(), interval_s);
    }

    /// `given` with the variances that were found.
    pub(super) fn widened(&self, given: &GivenOthers) -> GivenOthers {
        let mut wide = *given;
        wide.code.variance *= self.code.value();
        if let Some(rate) = &mut wide.rate {
            rate.variance *= self.rate.value();
        }
        wide
    }
}

/// A running mean of mean squares without the largest quarter, whose channels may be faulty.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ratio {
    mean: f64,
    seen_s: f64,
}

impl Ratio {
    const NEW: Self = Self {
        mean: 1.0,
        seen_s: 0.0,
    };

    const fn value(&self) -> f64 {
        self.mean.max(1.0)
    }

    fn follow(&mut self, mut squares: Vec<f64>, interval_s: f64) {
        if squares.len() < FEWEST {
            return;
        }
        squares.sort_unstable_by(f64::total_cmp);
        squares.truncate(squares.len() - squares.len().div_ceil(4));
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        self.seen_s = (self.seen_s + interval_s).min(MEMORY_S);
        self.mean += interval_s / self.seen_s * (mean / MEAN_SQUARE - self.mean);
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::SatelliteId;
    use gnss_nav::filter::Deviation;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    fn epoch(random: &mut ChaCha8Rng, satellites: u8, rate_sigmas: f64) -> Vec<GivenOthers> {
        let mut deviation = |sigmas: f64| Deviation {
            value: 3.0 * sigmas * random.sample::<f64, _>(StandardNormal),
            variance: 9.0,
        };
        let mut given = |prn| GivenOthers {
            satellite: SatelliteId::gps(prn),
            code: deviation(0.5),
            rate: Some(deviation(rate_sigmas)),
        };
        (1..=satellites).map(&mut given).collect()
    }

    #[test]
    fn what_all_do_is_found_and_what_one_does_is_not() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut scatter = Scatter::new();
        for _ in 0..500 {
            let mut given = epoch(&mut random, 9, 3.0);
            given[0].code.value = 100.0;
            scatter.follow(given.iter(), 0.02);
        }
        let given = epoch(&mut random, 9, 3.0);
        let wide = scatter.widened(&given[4]);
        assert_eq!(
            wide.code, given[4].code,
            "codes that are better than stated"
        );
        let ratio = wide.rate.unwrap().variance / given[4].rate.unwrap().variance;
        // Of nine, six are left, a tenth less than three quarters; over a hundred epochs it scatters by 7 %.
        assert!((6.0..11.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn few_satellites_tell_nothing() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut scatter = Scatter::new();
        scatter.follow(epoch(&mut random, 4, 9.0).iter(), 0.02);
        assert_eq!(scatter, Scatter::new());
    }
}
