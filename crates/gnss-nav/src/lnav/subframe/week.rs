//! Week numbers and times of week that the message cuts short.

use crate::GpsTime;
use crate::time::SECONDS_PER_WEEK;

/// Week around which the ten-bit week number of subframe 1 is unrolled where the caller knows no
/// better: 1638 (2011-05-29) to 2661 (2031-01-11) come out right.
pub const DEFAULT_PIVOT_WEEK: i32 = 2150;

/// The week nearest to `pivot_week` whose low `bits` (at most 16) bits are those of `week`; of two
/// equally near the earlier one.
#[must_use]
pub fn unroll_week(week: u16, bits: u32, pivot_week: i32) -> i32 {
    let span = 1_i64 << bits.min(16);
    let ahead = (i64::from(week) - i64::from(pivot_week) + span / 2).rem_euclid(span) - span / 2;
    let week = i64::from(pivot_week) + ahead;
    i32::try_from(week).unwrap_or(pivot_week)
}

/// The instant nearest to `near` at `second` of a week: how reference times are told that are
/// broadcast without their week (IS-GPS-200, 20.3.3.4.3).
#[must_use]
pub fn nearest_time(second: u32, near: GpsTime) -> GpsTime {
    let half_week = SECONDS_PER_WEEK / 2;
    let ahead = i64::from(second) - i64::from(near.second());
    let ahead = (ahead + half_week).rem_euclid(SECONDS_PER_WEEK) - half_week;
    GpsTime::from_parts(near.week(), i64::from(near.second()) + ahead, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn default_pivot_covers_what_it_says() {
        for week in [1638, 1672, 2048, 2190, 2661] {
            let low = (week % 1024) as u16;
            assert_eq!(unroll_week(low, 10, DEFAULT_PIVOT_WEEK), week);
        }
        assert_eq!(
            unroll_week((1637 % 1024) as u16, 10, DEFAULT_PIVOT_WEEK),
            2661
        );
    }

    #[test]
    fn reference_times_fall_into_the_next_or_last_week() {
        let saturday = GpsTime::new(2190, 604_000.0);
        assert_eq!(nearest_time(7200, saturday), GpsTime::new(2191, 7200.0));
        let sunday = GpsTime::new(2190, 600.0);
        assert_eq!(nearest_time(597_600, sunday), GpsTime::new(2189, 597_600.0));
    }

    proptest! {
        #[test]
        fn unrolled_weeks_keep_their_bits(week in 0_u16..1024, pivot in any::<i32>()) {
            let full = unroll_week(week, 10, pivot);
            prop_assert!((i64::from(full) - i64::from(pivot)).abs() <= 512);
            let inside = (i32::MIN + 512..=i32::MAX - 512).contains(&pivot);
            prop_assert!(!inside || full.rem_euclid(1024) == i32::from(week));
        }
    }
}
