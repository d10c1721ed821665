//! Prompt sums between the boundaries of data bits.

use num_complex::Complex64;

use super::NavBit;

/// The bit being summed.
#[derive(Debug, Clone, Copy)]
pub(super) struct BitSum {
    /// First period that begins a bit, modulo the periods of a bit.
    edge: i64,
    bit_periods: i64,
    sum: Complex64,
    /// Periods summed.
    periods: i64,
}

impl BitSum {
    /// No sum yet of bits of `bit_periods`, one of which begins with `period`.
    pub(super) fn new(period: i64, bit_periods: i64) -> Self {
        Self {
            edge: period.rem_euclid(bit_periods),
            bit_periods,
            sum: Complex64::default(),
            periods: 0,
        }
    }

    /// First period that begins a bit, modulo the periods of a bit.
    pub(super) const fn edge(&self) -> i64 {
        self.edge
    }

    /// Periods from the last boundary of bits to `period`.
    pub(super) const fn periods_into_bit(&self, period: i64) -> i64 {
        (period - self.edge).rem_euclid(self.bit_periods)
    }

    /// Adds the prompt sum of the `periods` that end with `end`, and returns the bit where it is complete.
    pub(super) fn add(&mut self, prompt: Complex64, periods: i64, end: i64) -> Option<NavBit> {
        self.sum += prompt;
        self.periods += periods;
        if self.periods_into_bit(end) != 0 {
            return None;
        }
        let bit = std::mem::replace(self, Self::new(self.edge, self.bit_periods));
        (bit.periods == self.bit_periods).then(|| NavBit {
            soft: bit.sum.re as f32,
            code_period: (end - self.bit_periods).unsigned_abs(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_is_returned_at_its_end_and_only_where_it_is_whole() {
        let mut bit = BitSum::new(47, 20);
        assert_eq!((bit.edge(), bit.periods_into_bit(50)), (7, 3));
        let one = Complex64::new(1.0, 5.0);
        assert!(bit.add(one, 10, 57).is_none());
        assert!(
            bit.add(one, 10, 67)
                .is_some_and(|bit| { bit.soft == 2.0 && bit.code_period == 47 })
        );
        assert!(bit.add(one, 10, 87).is_none(), "half of it is missing");
    }
}
