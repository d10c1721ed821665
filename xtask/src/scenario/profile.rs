//! A number that changes in time, straight from point to point.

use anyhow::{Result, ensure};

/// Values at increasing instants; straight between them, constant before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    points: Vec<(f64, f64)>,
}

impl Profile {
    /// A profile through (instant in s, value) pairs; two at one instant make a jump.
    ///
    /// # Errors
    /// Where there is no point, a number is not finite, or instants go back.
    pub fn new(points: Vec<(f64, f64)>) -> Result<Self> {
        ensure!(!points.is_empty(), "a profile needs at least one point");
        let finite = |(t, x): &(f64, f64)| t.is_finite() && x.is_finite();
        ensure!(
            points.iter().all(finite) && points.is_sorted_by(|a, b| a.0 <= b.0),
            "profile is {points:?}: expected finite values at instants that do not go back"
        );
        Ok(Self { points })
    }

    /// The same value at all times.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self {
            points: vec![(0.0, value)],
        }
    }

    /// The value at `time_s`; at a jump that after it.
    #[must_use]
    pub fn at(&self, time_s: f64) -> f64 {
        let after = self.points.partition_point(|(t, _)| *t <= time_s);
        let before = self.points[..after].last().copied();
        match (before, self.points.get(after).copied()) {
            (Some((t0, x0)), Some((t1, x1))) => x0 + (x1 - x0) * (time_s - t0) / (t1 - t0),
            (Some((_, x)), None) | (None, Some((_, x))) => x,
            (None, None) => 0.0,
        }
    }

    /// Its instants in order, s.
    pub fn instants_s(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.0)
    }

    /// First and last instant, s.
    #[must_use]
    pub fn span_s(&self) -> (f64, f64) {
        let at = |point: Option<&(f64, f64)>| point.map_or(0.0, |p| p.0);
        (at(self.points.first()), at(self.points.last()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_run_straight_and_stay_outside() {
        let profile =
            Profile::new(vec![(1.0, 10.0), (3.0, 20.0), (3.0, 0.0), (4.0, -2.0)]).unwrap();
        let expected = [
            (0.0, 10.0),
            (1.0, 10.0),
            (2.0, 15.0),
            (3.0, 0.0),
            (3.5, -1.0),
            (9.0, -2.0),
        ];
        for (time_s, value) in expected {
            assert_eq!(profile.at(time_s), value, "at {time_s}");
        }
        assert_eq!(profile.span_s(), (1.0, 4.0));
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(Profile::new(vec![]).is_err());
        assert!(Profile::new(vec![(2.0, 0.0), (1.0, 0.0)]).is_err());
        assert!(Profile::new(vec![(0.0, f64::NAN)]).is_err());
    }
}
