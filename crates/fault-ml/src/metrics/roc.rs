//! Detection against false alarms over all thresholds.

use rand::{Rng, RngExt};

/// One threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RocPoint {
    /// Faulty above.
    pub threshold: f64,
    /// Part of the healthy above it.
    pub false_alarms: f64,
    /// Part of the faulty above it.
    pub detections: f64,
}

/// The curve, from no alarm at all to nothing but alarms.
#[derive(Debug, Clone, PartialEq)]
pub struct Roc {
    points: Vec<RocPoint>,
}

impl Roc {
    /// Of scores and whether each is of a faulty step; `None` where either kind is missing.
    #[must_use]
    pub fn new(scores: &[(f64, bool)]) -> Option<Self> {
        let faulty = scores.iter().filter(|(_, faulty)| *faulty).count();
        let healthy = scores.len() - faulty;
        if faulty == 0 || healthy == 0 {
            return None;
        }
        let mut sorted = scores.to_vec();
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut points = vec![RocPoint {
            threshold: f64::INFINITY,
            false_alarms: 0.0,
            detections: 0.0,
        }];
        let mut counts = [0_usize; 2];
        for equal in sorted.chunk_by(|a, b| a.0 == b.0) {
            for (_, is_faulty) in equal {
                counts[usize::from(*is_faulty)] += 1;
            }
            points.push(RocPoint {
                // Just below the score: what has it is above.
                threshold: equal.first().map_or(0.0, |(score, _)| score.next_down()),
                false_alarms: counts[0] as f64 / healthy as f64,
                detections: counts[1] as f64 / faulty as f64,
            });
        }
        Some(Self { points })
    }

    /// Points, by falling threshold.
    #[must_use]
    pub fn points(&self) -> &[RocPoint] {
        &self.points
    }

    /// Area under the curve: the probability that a faulty step scores above a healthy one.
    #[must_use]
    pub fn area(&self) -> f64 {
        let pairs = self.points.iter().zip(self.points.iter().skip(1));
        let trapezium = |(a, b): (&RocPoint, &RocPoint)| {
            (b.false_alarms - a.false_alarms) * 0.5 * (a.detections + b.detections)
        };
        pairs.map(trapezium).sum()
    }

    /// Detections at so many false alarms: on the straight line between the thresholds beside it, where many have the
    /// same score.
    #[must_use]
    pub fn detections_at(&self, false_alarms: f64) -> f64 {
        let allowed = self
            .points
            .partition_point(|p| p.false_alarms <= false_alarms);
        let Some(below) = allowed.checked_sub(1).and_then(|k| self.points.get(k)) else {
            return 0.0;
        };
        self.points.get(allowed).map_or(below.detections, |above| {
            let part =
                (false_alarms - below.false_alarms) / (above.false_alarms - below.false_alarms);
            below.detections + part * (above.detections - below.detections)
        })
    }

    /// 2.5 and 97.5 % of each of `values` of the curve over `rounds` draws of whole groups with replacement: steps of
    /// one scenario hang together, so that they are drawn together. `None` where a kind is missing.
    pub fn bands<const N: usize>(
        groups: &[Vec<(f64, bool)>],
        rounds: usize,
        random: &mut impl Rng,
        values: impl Fn(&Self) -> [f64; N],
    ) -> Option<[(f64, f64); N]> {
        let mut drawn_values = [const { Vec::new() }; N];
        for _ in 0..rounds {
            let drawn: Vec<(f64, bool)> = (0..groups.len())
                .filter_map(|_| groups.get(random.random_range(0..groups.len())))
                .flatten()
                .copied()
                .collect();
            let Some(roc) = Self::new(&drawn) else {
                continue;
            };
            for (all, value) in drawn_values.iter_mut().zip(values(&roc)) {
                all.push(value);
            }
        }
        if drawn_values.iter().any(Vec::is_empty) {
            return None;
        }
        Some(drawn_values.map(|mut all| {
            all.sort_by(f64::total_cmp);
            let at = |share: f64| all[(share * (all.len() - 1) as f64).round() as usize];
            (at(0.025), at(0.975))
        }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    proptest! {
        #[test]
        fn the_area_is_the_share_of_pairs_in_order(
            // Few values, so that there are ties.
            healthy in prop::collection::vec(0u8..9, 1..30),
            faulty in prop::collection::vec(0u8..12, 1..30),
        ) {
            let mut scores: Vec<(f64, bool)> = Vec::new();
            scores.extend(healthy.iter().map(|s| (f64::from(*s), false)));
            scores.extend(faulty.iter().map(|s| (f64::from(*s), true)));
            let area = Roc::new(&scores).unwrap().area();
            let pair = |f: &u8, h: &u8| match f.cmp(h) {
                std::cmp::Ordering::Greater => 1.0,
                std::cmp::Ordering::Equal => 0.5,
                std::cmp::Ordering::Less => 0.0,
            };
            let wins: f64 = faulty.iter().flat_map(|f| healthy.iter().map(move |h| pair(f, h))).sum();
            let expected = wins / (healthy.len() * faulty.len()) as f64;
            // A few dozen roundings.
            prop_assert!((area - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn detections_are_read_off_and_bands_hold_the_area() {
        let score = |k: u32| (f64::from(k), !k.is_multiple_of(3));
        let scores: Vec<_> = (0..90).map(score).collect();
        let roc = Roc::new(&scores).unwrap();
        assert_eq!(roc.detections_at(0.0), 2.0 / 60.0);
        assert_eq!(roc.detections_at(1.0), 1.0);
        let tied = Roc::new(&[(1.0, true), (1.0, false), (0.0, true), (0.0, false)]).unwrap();
        assert_eq!(tied.detections_at(0.25), 0.25);
        let last = roc.points().last().unwrap();
        assert_eq!((last.false_alarms, last.threshold < 0.0), (1.0, true));
        let group = |g: usize| scores.iter().skip(g).step_by(10).copied().collect();
        let groups: Vec<Vec<_>> = (0..10).map(group).collect();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let values = |roc: &Roc| [roc.area(), roc.detections_at(0.5)];
        let bands = Roc::bands(&groups, 200, &mut random, values).unwrap();
        for ((low, high), value) in bands.into_iter().zip(values(&roc)) {
            assert!(low < value && value < high && high - low < 0.5);
        }
        assert!(Roc::bands(&[], 200, &mut random, values).is_none());
        assert!(Roc::new(&[(1.0, true)]).is_none());
    }
}
