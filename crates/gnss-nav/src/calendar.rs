//! GPS time as date and time of day.

use crate::time::SECONDS_PER_WEEK;
use crate::{GpsTime, NavError};

const SECONDS_PER_DAY: i64 = 86_400;

/// 1980-01-06, the first day of GPS time, counted from 1970-01-01.
const FIRST_DAY: i64 = 3_657;

/// Date and time of day in GPS time (no leap seconds), proleptic Gregorian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calendar {
    /// Year.
    pub year: i32,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day of the month, from 1.
    pub day: u8,
    /// Hour, 0 to 23.
    pub hour: u8,
    /// Minute, 0 to 59.
    pub minute: u8,
    /// Second, 0 to 59.
    pub second: u8,
    /// Fraction of the second, s.
    pub fraction_s: f64,
}

impl TryFrom<Calendar> for GpsTime {
    type Error = NavError;

    /// Fails on a day or time that does not exist.
    fn try_from(date: Calendar) -> Result<Self, NavError> {
        let days = days_from_date(&date);
        let time_of_day = (i64::from(date.hour) * 60 + i64::from(date.minute)) * 60;
        let second = (days - FIRST_DAY) * SECONDS_PER_DAY + time_of_day + i64::from(date.second);
        let time = Self::from_parts(0, second, date.fraction_s);
        if Calendar::from(time) == date {
            Ok(time)
        } else {
            Err(NavError::Value {
                name: "date",
                value: format!("{date:?}"),
                expected: "a day of the calendar and a time of day",
            })
        }
    }
}

impl From<GpsTime> for Calendar {
    fn from(time: GpsTime) -> Self {
        let seconds = i64::from(time.week()) * SECONDS_PER_WEEK + i64::from(time.second());
        let (year, month, day) = date_from_days(seconds.div_euclid(SECONDS_PER_DAY) + FIRST_DAY);
        let of_day = seconds.rem_euclid(SECONDS_PER_DAY);
        Self {
            year,
            month,
            day,
            hour: (of_day / 3_600) as u8,
            minute: (of_day / 60 % 60) as u8,
            second: (of_day % 60) as u8,
            fraction_s: time.fraction_s(),
        }
    }
}

/// Days since 1970-01-01. Years are counted from March, so that the leap day comes last.
fn days_from_date(date: &Calendar) -> i64 {
    let month = i64::from(date.month);
    let year = i64::from(date.year) - i64::from(month <= 2);
    let day_of_year =
        (153 * (month + if month > 2 { -3 } else { 9 }) + 2) / 5 + i64::from(date.day);
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leap_days + day_of_year - 719_469
}

/// Inverse of [`days_from_date`].
fn date_from_days(days: i64) -> (i32, u8, u8) {
    // Days since 0000-03-01, in cycles of 400 years.
    let days = days + 719_468;
    let (cycle, of_cycle) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year_of_cycle =
        (of_cycle - of_cycle / 1_460 + of_cycle / 36_524 - of_cycle / 146_096) / 365;
    let leap_days = year_of_cycle / 4 - year_of_cycle / 100;
    let of_year = of_cycle - 365 * year_of_cycle - leap_days;
    let march_month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 {
        march_month + 3
    } else {
        march_month - 9
    };
    let year = cycle * 400 + year_of_cycle + i64::from(month <= 2);
    (year as i32, month as u8, day as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn date(year: i32, month: u8, day: u8, hour: u8) -> Calendar {
        Calendar {
            year,
            month,
            day,
            hour,
            minute: 0,
            second: 0,
            fraction_s: 0.0,
        }
    }

    #[test]
    fn known_dates() {
        let weeks = [
            (date(1980, 1, 6, 0), 0, 0.0),
            (date(2023, 1, 8, 10), 2244, 36_000.0),
            (date(2012, 1, 26, 0), 1672, 345_600.0),
            (date(2020, 2, 29, 12), 2094, 561_600.0),
        ];
        for (date, week, tow_s) in weeks {
            assert_eq!(GpsTime::try_from(date), Ok(GpsTime::new(week, tow_s)));
        }
    }

    #[test]
    fn days_that_do_not_exist_are_errors() {
        let wrong = [
            (2021, 2, 29, 0),
            (2020, 13, 1, 0),
            (2020, 0, 1, 0),
            (2020, 1, 0, 0),
            (2020, 1, 1, 24),
        ];
        for (year, month, day, hour) in wrong {
            assert!(GpsTime::try_from(date(year, month, day, hour)).is_err());
        }
    }

    proptest! {
        #[test]
        fn round_trip(week in -5_000..20_000, second in 0..604_800i64) {
            let time = GpsTime::from_parts(week, second, 0.25);
            prop_assert_eq!(GpsTime::try_from(Calendar::from(time)), Ok(time));
        }
    }
}
