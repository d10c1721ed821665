//! GPS time as calendar date, and UTC from it.

use gnss_nav::GpsTime;

/// A calendar date and time of day, in the time scale it was made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Calendar {
    pub(crate) year: i64,
    pub(crate) month: u32,
    pub(crate) day: u32,
    pub(crate) hour: u32,
    pub(crate) minute: u32,
    pub(crate) second: u32,
    pub(crate) fraction_s: f64,
}

impl Calendar {
    /// Date of `time`; its fraction has to be representable in `decimals`, see [`on_grid`].
    pub(crate) fn of(time: GpsTime) -> Self {
        let days = i64::from(time.week()) * 7 + i64::from(time.second() / 86_400);
        let (year, month, day) = civil_from_days(days + GPS_EPOCH_DAYS);
        let second_of_day = (time.second() % 86_400).unsigned_abs();
        Self {
            year,
            month,
            day,
            hour: second_of_day / 3600,
            minute: second_of_day / 60 % 60,
            second: second_of_day % 60,
            fraction_s: time.fraction_s(),
        }
    }

    /// Seconds of the minute with their fraction.
    pub(crate) fn seconds(&self) -> f64 {
        f64::from(self.second) + self.fraction_s
    }
}

/// `time` rounded to `decimals` of a second, so that printing it never shows 60 seconds.
pub(crate) fn on_grid(time: GpsTime, decimals: i32) -> GpsTime {
    let scale = 10f64.powi(decimals);
    let steps = (time.fraction_s() * scale).round();
    GpsTime::from_parts(time.week(), i64::from(time.second()), steps / scale)
}

/// Leap seconds, GPS minus UTC, at `time`: the broadcast ones where known, otherwise those
/// announced up to 2017 (IERS Bulletin C 52).
pub(crate) fn leap_seconds(time: GpsTime, broadcast: Option<i32>) -> i32 {
    broadcast.unwrap_or_else(|| {
        let days = i64::from(time.week()) * 7 + i64::from(time.second() / 86_400) + GPS_EPOCH_DAYS;
        let passed = LEAP_DAYS.iter().filter(|leap| days >= **leap).count();
        i32::try_from(passed).unwrap_or(0)
    })
}

/// 1980-01-06 in days since 1970-01-01.
const GPS_EPOCH_DAYS: i64 = 3657;

/// First days with one more leap second, days since 1970-01-01: 1981-07-01, 1982-07-01,
/// 1983-07-01, 1985-07-01, 1988-01-01, 1990-01-01, 1991-01-01, 1992-07-01, 1993-07-01,
/// 1994-07-01, 1996-01-01, 1997-07-01, 1999-01-01, 2006-01-01, 2009-01-01, 2012-07-01,
/// 2015-07-01, 2017-01-01.
const LEAP_DAYS: [i64; 18] = [
    4199, 4564, 4929, 5660, 6574, 7305, 7670, 8217, 8582, 8947, 9496, 10_043, 10_592, 13_149,
    14_245, 15_522, 16_617, 17_167,
];

/// Year, month and day of a count of days since 1970-01-01 in the Gregorian calendar.
///
/// Years are taken to begin in March, so that the leap day is the last one, and 400-year cycles
/// of 146097 days to begin on 0000-03-01 (719468 days before 1970).
fn civil_from_days(days: i64) -> (i64, u32, u32) {
    let shifted = days + 719_468;
    let cycle = shifted.div_euclid(146_097);
    let day_of_cycle = shifted.rem_euclid(146_097);
    let year_of_cycle =
        (day_of_cycle - day_of_cycle / 1460 + day_of_cycle / 36_524 - day_of_cycle / 146_096) / 365;
    let day_of_year =
        day_of_cycle - (365 * year_of_cycle + year_of_cycle / 4 - year_of_cycle / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = year_of_cycle + cycle * 400 + i64::from(month <= 2);
    (year, month as u32, day as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn date(time: GpsTime) -> (i64, u32, u32, u32, u32, u32) {
        let c = Calendar::of(time);
        (c.year, c.month, c.day, c.hour, c.minute, c.second)
    }

    #[test]
    fn known_dates() {
        assert_eq!(date(GpsTime::new(0, 0.0)), (1980, 1, 6, 0, 0, 0));
        // The flight recording: 2012-01-26.
        assert_eq!(
            date(GpsTime::new(1672, 391_558.1)),
            (2012, 1, 26, 12, 45, 58)
        );
        // 2000 was a leap year: GPS week 1051, Tuesday.
        assert_eq!(
            date(GpsTime::new(1051, 2.0 * 86_400.0)),
            (2000, 2, 29, 0, 0, 0)
        );
        assert_eq!(date(GpsTime::new(2190, 540_000.0)), (2022, 1, 1, 6, 0, 0));
    }

    #[test]
    fn rounding_carries_into_the_week() {
        let late = GpsTime::from_parts(2190, 604_799, 0.999_999_999_6);
        let rounded = on_grid(late, 7);
        assert_eq!((rounded.week(), rounded.second()), (2191, 0));
    }

    #[test]
    fn leap_seconds_by_date() {
        assert_eq!(leap_seconds(GpsTime::new(0, 0.0), None), 0);
        assert_eq!(leap_seconds(GpsTime::new(1672, 391_558.1), None), 15);
        // 2016-12-31 and 2017-01-01 (week 1930 began on the latter).
        assert_eq!(leap_seconds(GpsTime::new(1929, 604_799.0), None), 17);
        assert_eq!(leap_seconds(GpsTime::new(1930, 0.0), None), 18);
        assert_eq!(leap_seconds(GpsTime::new(1930, 0.0), Some(19)), 19);
    }
}
