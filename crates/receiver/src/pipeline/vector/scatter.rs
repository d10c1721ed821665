//! How far the measurements of all channels scatter beyond what is stated of them.
//!
//! Range rates of different satellites do not hold over quite the same time: each follows the bits of its own
//! satellite. White noise of the clock's frequency is therefore not quite common to all, and of an oscillator with much
//! of it, or of one that is shaken, healthy channels deviate from each other by several stated deviations. A filter that
//! takes such rates for as good as their carriers is led astray by those of a few satellites. What most channels do is no
//! channel's fault: it is added to the variance of every range rate. Of pseudoranges the monitors alone are told, in
//! proportion.

use gnss_nav::filter::{Deviation, GivenOthers};

/// Time over which it is found, s.
const MEMORY_S: f64 = 2.0;
/// Fewer satellites than this tell nothing of most.
const FEWEST: usize = 5;
/// Less excess than this part of the stated variance may be chance, of 100 epochs of a few satellites, and does no harm.
const CHANCE: f64 = 0.5;
/// Mean square of normal numbers of deviation one without the largest quarter.
const MEAN_SQUARE: f64 = 0.3685;

/// What was found so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scatter {
    /// Found over stated variance.
    code: Running,
    rate: Excess,
}

impl Scatter {
    /// Nothing was seen yet.
    pub(super) const fn new() -> Self {
        Self {
            code: Running::from(1.0),
            rate: Excess {
                found: Running::from(0.0),
                counted: 0.0,
            },
        }
    }

    /// Takes the deviations of an epoch, `interval_s` after the last one, each given all others of them; variances of
    /// range rates hold [`Self::rate_variance_m2_s2`] already.
    pub(super) fn follow<'a>(
        &mut self,
        given: impl Iterator<Item = &'a GivenOthers> + Clone,
        interval_s: f64,
    ) {
        if let Some(most) = without_largest(given.clone().map(|g| g.code)) {
            self.code.take(found_over_stated(&most), interval_s);
        }
        if let Some(most) = without_largest(given.filter_map(|g| g.rate)) {
            self.rate.follow(&most, interval_s);
        }
    }

    /// Variance of every range rate over the stated one, (m/s)^2.
    pub(super) const fn rate_variance_m2_s2(&self) -> f64 {
        self.rate.counted
    }

    /// `given` with the variance of pseudoranges that was found.
    pub(super) fn widened(&self, given: &GivenOthers) -> GivenOthers {
        let mut wide = *given;
        wide.code.variance *= self.code.mean.max(1.0);
        wide
    }
}

/// Deviations without the largest quarter, whose channels may be faulty; none where they are too few.
fn without_largest(deviations: impl Iterator<Item = Deviation>) -> Option<Vec<Deviation>> {
    let mut all: Vec<Deviation> = deviations.collect();
    if all.len() < FEWEST {
        return None;
    }
    all.sort_unstable_by(|a, b| a.normalised_squared().total_cmp(&b.normalised_squared()));
    all.truncate(all.len() - all.len().div_ceil(4));
    Some(all)
}

/// Mean of `values` over deviations.
fn mean(deviations: &[Deviation], values: impl Fn(&Deviation) -> f64) -> f64 {
    deviations.iter().map(values).sum::<f64>() / deviations.len() as f64
}

/// Found variance over stated variance of most.
fn found_over_stated(most: &[Deviation]) -> f64 {
    mean(most, Deviation::normalised_squared) / MEAN_SQUARE
}

/// A mean over [`MEMORY_S`], or what there was.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Running {
    mean: f64,
    seen_s: f64,
}

impl Running {
    /// `mean` until there is something.
    const fn from(mean: f64) -> Self {
        Self { mean, seen_s: 0.0 }
    }

    fn take(&mut self, value: f64, interval_s: f64) {
        self.seen_s = (self.seen_s + interval_s).min(MEMORY_S);
        self.mean += interval_s / self.seen_s * (value - self.mean);
    }
}

/// The variance that most have in excess of what is stated of each.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Excess {
    /// Below zero where they are better than stated.
    found: Running,
    /// What of it is more than chance, and contained in the variances that come.
    counted: f64,
}

impl Excess {
    /// Takes the excess with which found and stated variance of an epoch would be the same (Newton's step); what is
    /// found of the best counts most.
    fn follow(&mut self, most: &[Deviation], interval_s: f64) {
        let typical = 1.0 / mean(most, |d| 1.0 / d.variance);
        let now = self.counted + typical * (found_over_stated(most) - 1.0);
        self.found.take(now, interval_s);
        let by_chance = CHANCE * (typical - self.counted).max(0.0);
        self.counted = (self.found.mean - by_chance).max(0.0);
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

    /// Deviations of satellites of which pseudoranges are stated to 3 m and half as wide, range rates stated to 0.1 m/s
    /// and `extra_mps` more, and `scatter` is told of them.
    fn epoch(
        random: &mut ChaCha8Rng,
        scatter: &Scatter,
        satellites: u8,
        extra_mps: f64,
    ) -> Vec<GivenOthers> {
        let mut normal = |sigma: f64| sigma * random.sample::<f64, _>(StandardNormal);
        let mut given = |prn| GivenOthers {
            satellite: SatelliteId::gps(prn),
            code: Deviation {
                value: normal(1.5),
                variance: 9.0,
            },
            rate: Some(Deviation {
                value: normal(0.1) + normal(extra_mps),
                variance: 0.01 + scatter.rate_variance_m2_s2(),
            }),
        };
        (1..=satellites).map(&mut given).collect()
    }

    #[test]
    fn what_all_do_is_found_and_what_one_does_is_not() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut scatter = Scatter::new();
        for _ in 0..500 {
            let mut given = epoch(&mut random, &scatter, 9, 0.4);
            given[0].code.value = 100.0;
            if let Some(rate) = &mut given[0].rate {
                rate.value = 20.0;
            }
            scatter.follow(given.iter(), 0.02);
        }
        let given = epoch(&mut random, &scatter, 9, 0.4);
        let wide = scatter.widened(&given[4]);
        assert_eq!(wide, given[4], "codes that are better than stated");
        // Of nine, six are left, a tenth less than three quarters; over a hundred epochs it scatters by 7 %.
        let extra_mps = scatter.rate_variance_m2_s2().sqrt();
        assert!((0.33..0.44).contains(&extra_mps), "{extra_mps}");
    }

    #[test]
    fn rates_as_good_as_stated_have_next_to_no_excess() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut scatter = Scatter::new();
        for _ in 0..500 {
            let given = epoch(&mut random, &scatter, 9, 0.0);
            scatter.follow(given.iter(), 0.02);
        }
        assert_eq!(scatter.rate_variance_m2_s2(), 0.0, "{scatter:?}");
    }

    #[test]
    fn few_satellites_tell_nothing() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut scatter = Scatter::new();
        let given = epoch(&mut random, &scatter, 4, 2.0);
        scatter.follow(given.iter(), 0.02);
        assert_eq!(scatter, Scatter::new());
    }
}
