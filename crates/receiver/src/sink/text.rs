//! Numbers as text: fixed decimals, and nothing where there is no value.

use std::fmt;

/// A number with a fixed number of decimals; displays as nothing where it is not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fixed(
    /// The number.
    pub f64,
    /// Digits after the point.
    pub usize,
);

impl fmt::Display for Fixed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, decimals) = *self;
        if !value.is_finite() {
            return Ok(());
        }
        let mut text = [0; MOST_DIGITS];
        match digits(value, decimals, &mut text) {
            Some(text) => f.pad(text),
            None => f.pad(&format!("{value:.decimals$}")),
        }
    }
}

/// Characters of a number below 2^53 with sign and point.
const MOST_DIGITS: usize = 24;
const POWERS_OF_TEN: [f64; 13] = [
    1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12,
];

/// What `{value:.decimals$}` gives, written from the end of `text` on; none where double precision
/// cannot tell which way the last digit is rounded.
fn digits(value: f64, decimals: usize, text: &mut [u8; MOST_DIGITS]) -> Option<&str> {
    let scaled = value.abs() * POWERS_OF_TEN.get(decimals)?;
    let whole = scaled.floor();
    let rest = scaled - whole;
    // The product is rounded to 2^-53 of itself, which leaves the rest of smaller numbers this far
    // from where rounding turns.
    if scaled >= 1e15 || (rest - 0.5).abs() <= scaled * f64::EPSILON {
        return None;
    }
    let mut left = whole as u64 + u64::from(rest > 0.5);
    let mut at = MOST_DIGITS;
    let mut put = |character: u8| {
        at -= 1;
        text[at] = character;
    };
    for place in 0.. {
        if place > decimals && left == 0 {
            break;
        }
        if place == decimals && decimals > 0 {
            put(b'.');
        }
        put(b'0' + (left % 10) as u8);
        left /= 10;
    }
    if value.is_sign_negative() {
        put(b'-');
    }
    std::str::from_utf8(&text[at..]).ok()
}

/// `value` with `decimals`, or nothing.
pub(crate) fn optional(value: Option<f64>, decimals: usize) -> Fixed {
    Fixed(value.unwrap_or(f64::NAN), decimals)
}

/// `value` rounded to `decimals`, for files in which a longer tail of digits would be noise.
pub(crate) fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    let scaled = (value * scale).round();
    // Zero without its sign: "-0.0" says nothing to a reader.
    if scaled == 0.0 { 0.0 } else { scaled / scale }
}

/// A number as RINEX writes it: `width` characters, `decimals` digits after the point, `E`
/// exponent of two digits (19 and 12: D19.12).
pub(crate) fn scientific(value: f64, width: usize, decimals: usize) -> String {
    let value = if value.is_finite() { value } else { 0.0 };
    let text = format!("{value:.decimals$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let sign = if exponent < 0 { '-' } else { '+' };
    let number = format!("{mantissa}E{sign}{:02}", exponent.abs());
    format!("{number:>width$}")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_without_a_value_are_empty() {
        assert_eq!(Fixed(1.25, 1).to_string(), "1.2");
        assert_eq!(Fixed(f64::NAN, 1).to_string(), "");
        assert_eq!(Fixed(f64::INFINITY, 1).to_string(), "");
        assert_eq!(optional(None, 3).to_string(), "");
        assert_eq!(rounded(-0.0001, 2).to_string(), "0");
        assert!((rounded(12.345_678, 3) - 12.346).abs() < f64::EPSILON * 12.0);
    }

    proptest! {
        #[test]
        fn fixed_decimals_are_those_of_the_standard_library(
            mantissa in -1_000_000_000_i64..1_000_000_000,
            exponent in -14_i32..8,
            decimals in 0_usize..13,
        ) {
            // Short decimals, which often end in the 5 at which rounding turns.
            let value = mantissa as f64 * 10f64.powi(exponent);
            prop_assert_eq!(Fixed(value, decimals).to_string(), format!("{value:.decimals$}"));
        }

        #[test]
        fn any_number_is_that_of_the_standard_library(value: f64, decimals in 0_usize..15) {
            prop_assert_eq!(Fixed(value, decimals).to_string(), format!("{value:.decimals$}"));
        }
    }

    #[test]
    fn halves_zeros_and_widths_are_those_of_the_standard_library() {
        for value in [
            0.0, -0.0, 0.5, 1.5, 2.5, -0.125, 0.375, 1e15, 9.999_999, -0.04, 4.35,
        ] {
            for decimals in 0..4 {
                let expected = format!("{value:.decimals$}");
                assert_eq!(Fixed(value, decimals).to_string(), expected);
                let expected = format!("{value:14.decimals$}");
                assert_eq!(format!("{:>14}", Fixed(value, decimals)), expected);
            }
        }
    }

    #[test]
    fn scientific_numbers_have_fortran_width() {
        assert_eq!(scientific(-1.5e-9, 19, 12), "-1.500000000000E-09");
        assert_eq!(scientific(0.0, 19, 12), " 0.000000000000E+00");
        assert_eq!(scientific(5153.7, 19, 12), " 5.153700000000E+03");
        assert_eq!(scientific(1.1176e-8, 12, 4), "  1.1176E-08");
    }
}
