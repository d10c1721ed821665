//! Numbers as text: fixed decimals, and nothing where there is no value.

use std::fmt;

/// A number with a fixed number of decimals; displays as nothing where it is not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fixed(pub(crate) f64, pub(crate) usize);

impl fmt::Display for Fixed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_finite() {
            write!(f, "{:.*}", self.1, self.0)
        } else {
            Ok(())
        }
    }
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

    #[test]
    fn scientific_numbers_have_fortran_width() {
        assert_eq!(scientific(-1.5e-9, 19, 12), "-1.500000000000E-09");
        assert_eq!(scientific(0.0, 19, 12), " 0.000000000000E+00");
        assert_eq!(scientific(5153.7, 19, 12), " 5.153700000000E+03");
        assert_eq!(scientific(1.1176e-8, 12, 4), "  1.1176E-08");
    }
}
