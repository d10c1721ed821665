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
        Self::normalised(i64::from(week), second + carry as i64, fraction_s - carry)
    }

    fn normalised(week: i64, second: i64, fraction_s: f64) -> Self {
        Self {
            week: (week + second.div_euclid(SECONDS_PER_WEEK)) as i32,
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
            i64::from(self.second) + whole as i64,
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
