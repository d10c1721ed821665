//! GPS time as week, second and fraction.
//!
//! One `f64` of seconds would step by 3.5 cm of range at the end of a week, so the whole seconds
//! and the fraction are kept apart.

use std::ops::{Add, Sub};

/// Seconds in a week.
pub const SECONDS_PER_WEEK: i64 = 604_800;

/// An instant of GPS time.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct GpsTime {
    week: i32,
    second: i32,
    fraction_s: f64,
}

impl GpsTime {
    /// `seconds` (may be negative or exceed a week) after the start of `week` (unrolled count
    /// since 1980-01-06).
    #[must_use]
    pub fn new(week: i32, seconds: f64) -> Self {
        let whole = seconds.floor();
        Self::normalised(i64::from(week), whole as i64, seconds - whole)
    }

    /// `second` whole seconds and `fraction_s` after the start of `week`.
    #[must_use]
    pub fn from_parts(week: i32, second: i64, fraction_s: f64) -> Self {
        let carry = fraction_s.floor();
        let second = second.saturating_add(carry as i64);
        Self::normalised(i64::from(week), second, fraction_s - carry)
    }

    fn normalised(week: i64, second: i64, fraction_s: f64) -> Self {
        // A tiny negative fraction rounds up to a whole second when the carry is taken off.
        let (second, fraction_s) = if fraction_s >= 1.0 {
            (second.saturating_add(1), 0.0)
        } else {
            (second, fraction_s)
        };
        let week = week.saturating_add(second.div_euclid(SECONDS_PER_WEEK));
        Self {
            week: week.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32,
            second: second.rem_euclid(SECONDS_PER_WEEK) as i32,
            fraction_s,
        }
    }

    /// Week since 1980-01-06, unrolled.
    #[must_use]
    pub const fn week(self) -> i32 {
        self.week
    }

    /// Whole seconds of the week.
    #[must_use]
    pub const fn second(self) -> i32 {
        self.second
    }

    /// Fraction of a second, s, in [0, 1).
    #[must_use]
    pub const fn fraction_s(self) -> f64 {
        self.fraction_s
    }

    /// Time of week, s (rounded to the step of an `f64`, 0.1 ns).
    #[must_use]
    pub fn tow_s(self) -> f64 {
        f64::from(self.second) + self.fraction_s
    }
}

impl Add<f64> for GpsTime {
    type Output = Self;

    /// This instant, `seconds` later.
    fn add(self, seconds: f64) -> Self {
        let whole = seconds.floor();
        Self::from_parts(
            self.week,
            i64::from(self.second).saturating_add(whole as i64),
            self.fraction_s + (seconds - whole),
        )
    }
}

impl Sub<f64> for GpsTime {
    type Output = Self;

    /// This instant, `seconds` earlier.
    fn sub(self, seconds: f64) -> Self {
        self + (-seconds)
    }
}

impl Sub for GpsTime {
    type Output = f64;

    /// Seconds from `earlier` to this instant.
    fn sub(self, earlier: Self) -> f64 {
        let weeks = i64::from(self.week) - i64::from(earlier.week);
        let seconds = i64::from(self.second) - i64::from(earlier.second);
        (weeks * SECONDS_PER_WEEK + seconds) as f64 + (self.fraction_s - earlier.fraction_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn week_ends_are_crossed_both_ways() {
        let last = GpsTime::new(2189, 604_799.75);
        let next = last + 0.5;
        assert_eq!(
            (next.week(), next.second(), next.fraction_s()),
            (2190, 0, 0.25)
        );
        assert_eq!(next - 0.5, last);
        assert_eq!(next - last, 0.5);
        assert_eq!(GpsTime::new(2190, -0.25), last);
    }

    #[test]
    fn fraction_stays_below_one() {
        let time = GpsTime::from_parts(1, 0, -1e-20);
        assert_eq!((time.week(), time.second(), time.fraction_s()), (1, 0, 0.0));
    }

    #[test]
    fn absurd_values_do_not_panic() {
        for seconds in [f64::MAX, f64::MIN, f64::INFINITY, f64::NAN] {
            let time = GpsTime::new(i32::MAX, seconds) + seconds;
            assert!((0..604_800).contains(&time.second()));
        }
        let _ = GpsTime::from_parts(i32::MIN, i64::MIN, -5.0) - 1e300;
    }

    proptest! {
        #[test]
        fn differences_undo_sums(week in 0..4000, tow in 0.0..604_800.0f64, step in -1e6..1e6f64) {
            let start = GpsTime::new(week, tow);
            let end = start + step;
            // The fractions round to 1e-16 s, the step to half its own last place (6e-11 s).
            prop_assert!(((end - start) - step).abs() < 2e-10);
            prop_assert!((0.0..1.0).contains(&end.fraction_s()));
        }
    }
}
