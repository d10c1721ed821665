//! Scaled numbers in a subframe: where their bits lie and what one step is worth.

use std::f64::consts::PI;

use super::word::{DataWords, Run};
use crate::NavError;

/// How the raw bits are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Coding {
    Unsigned,
    TwosComplement,
    /// Two's complement of a whole turn: any angle has a place.
    Turn,
}

/// A scaled number in a subframe.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    name: &'static str,
    high: Option<Run>,
    low: Run,
    coding: Coding,
    step: f64,
}

/// 2 to the power `exponent`, which must be that of a normal number.
pub(super) const fn power_of_two(exponent: i64) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

impl Field {
    /// An unsigned number in steps of 2^`exponent`.
    pub(super) const fn unsigned(name: &'static str, low: Run, exponent: i64) -> Self {
        Self {
            name,
            high: None,
            low,
            coding: Coding::Unsigned,
            step: power_of_two(exponent),
        }
    }

    /// A two's complement number in steps of 2^`exponent`.
    pub(super) const fn signed(name: &'static str, low: Run, exponent: i64) -> Self {
        Self {
            coding: Coding::TwosComplement,
            ..Self::unsigned(name, low, exponent)
        }
    }

    /// A 24- or 32-bit angle in steps of 2^`exponent` semicircles: one turn fills it.
    pub(super) const fn turn(name: &'static str, low: Run, exponent: i64) -> Self {
        Self {
            coding: Coding::Turn,
            ..Self::signed(name, low, exponent).semicircles()
        }
    }

    /// The same with its leading bits in another run.
    pub(super) const fn with_high(self, high: Run) -> Self {
        Self {
            high: Some(high),
            ..self
        }
    }

    /// The same, broadcast in semicircles and read in radians.
    ///
    /// The pi of IS-GPS-200 (3.1415926535898) differs by 2e-15: less than 0.1 um in the orbit.
    pub(super) const fn semicircles(self) -> Self {
        Self {
            step: self.step * PI,
            ..self
        }
    }

    const fn length(&self) -> u32 {
        match self.high {
            Some((_, length)) => length + self.low.1,
            None => self.low.1,
        }
    }

    /// The number in `words`.
    pub(super) fn read(&self, words: &DataWords) -> f64 {
        let high = self.high.map_or(0, |run| u64::from(words.bits(run)));
        let raw = (high << self.low.1 | u64::from(words.bits(self.low))) as i64;
        let negative = self.coding != Coding::Unsigned && raw >> (self.length() - 1) & 1 == 1;
        let raw = if negative {
            raw - (1 << self.length())
        } else {
            raw
        };
        raw as f64 * self.step
    }

    /// Writes `value`, rounded to the nearest step.
    ///
    /// # Errors
    /// [`NavError::Value`] where the field cannot hold it; an angle may lie within two turns of
    /// zero.
    pub(super) fn write(&self, words: &mut DataWords, value: f64) -> Result<(), NavError> {
        let raw = (value / self.step).round();
        let span = power_of_two(i64::from(self.length()));
        let range = match self.coding {
            Coding::Unsigned => 0.0..span,
            Coding::TwosComplement => -span / 2.0..span / 2.0,
            Coding::Turn => -2.0 * span..2.0 * span,
        };
        if !range.contains(&raw) {
            return Err(NavError::Value {
                name: self.name,
                value: value.to_string(),
                expected: "a number its LNAV field can hold",
            });
        }
        let raw = raw as i64;
        words.set_bits(self.low, raw as u32);
        if let Some(high) = self.high {
            words.set_bits(high, (raw >> self.low.1) as u32);
        }
        Ok(())
    }
}

/// One number of a record `T`: its place in the subframe and in the record.
pub(super) struct Term<T> {
    field: Field,
    of: fn(&mut T) -> &mut f64,
}

impl<T: Copy> Term<T> {
    /// Ties `field` to the member that `of` gives.
    pub(super) const fn new(field: Field, of: fn(&mut T) -> &mut f64) -> Self {
        Self { field, of }
    }

    /// Copies the number from `words` into `record`.
    pub(super) fn read(&self, words: &DataWords, record: &mut T) {
        *(self.of)(record) = self.field.read(words);
    }

    /// Copies the number from `record` into `words`.
    ///
    /// # Errors
    /// As [`Field::write`].
    pub(super) fn write(&self, words: &mut DataWords, record: &T) -> Result<(), NavError> {
        let mut record = *record;
        self.field.write(words, *(self.of)(&mut record))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPLIT: Field = Field::signed("x", (121, 24), -31).with_high((107, 8));

    #[test]
    fn numbers_in_two_runs_come_back() {
        for value in [0.0, -1.0, 0.25, power_of_two(-31), -power_of_two(-31)] {
            let mut words = DataWords::FILLER;
            SPLIT.write(&mut words, value).unwrap();
            assert_eq!(SPLIT.read(&words), value);
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        for value in [1.0, -1.1, f64::NAN, f64::INFINITY] {
            let error = SPLIT.write(&mut DataWords::default(), value).unwrap_err();
            assert!(matches!(error, NavError::Value { name: "x", .. }));
        }
    }

    #[test]
    fn angles_wrap() {
        let angle = Field::turn("m", (121, 24), -23);
        let mut words = DataWords::default();
        angle.write(&mut words, 1.5 * PI).unwrap();
        assert_eq!(angle.read(&words), -0.5 * PI);
        assert!(angle.write(&mut words, 30.0).is_err());
    }
}
