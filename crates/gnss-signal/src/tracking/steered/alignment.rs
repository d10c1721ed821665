//! Whether intervals still begin with data bits.
//!
//! A receiver's clock that jumps by whole code periods leaves the code where it was: only the bits begin
//! elsewhere. Where the sign of a bit differs from that of the one before, the half of the interval that
//! holds the edge is then weaker than its neighbour across the boundary.

use std::collections::VecDeque;

use num_complex::Complex64;

/// Changes of sign that are looked back on: a second of bits.
const REMEMBERED: usize = 25;
/// Fewest that tell.
const FEWEST: usize = 8;

/// By how many code periods bits begin late, as far as a channel can tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BitsLate {
    /// Code periods; below zero: early.
    pub periods: f64,
    /// Variance, periods^2.
    pub variance: f64,
}

/// Remembers how amplitudes differ across boundaries.
#[derive(Debug, Clone, Default)]
pub(super) struct Alignment {
    previous: Option<Complex64>,
    /// (before - after) / (before + after) of amplitudes at changes of sign.
    differences: VecDeque<f64>,
}

impl Alignment {
    /// Takes in the prompt sums of the halves of the next interval.
    pub(super) fn observe(&mut self, first: Complex64, second: Complex64) {
        if let Some(before) = self.previous.replace(second)
            && (before.conj() * first).re < 0.0
        {
            let (before, after) = (before.norm(), first.norm());
            if self.differences.len() == REMEMBERED {
                self.differences.pop_front();
            }
            self.differences
                .push_back((before - after) / (before + after));
        }
    }

    /// The next interval does not follow the last.
    pub(super) fn interrupt(&mut self) {
        self.previous = None;
    }

    /// How late bits begin in intervals whose halves have so many periods; `None` before enough bits.
    ///
    /// An edge m periods into a half of H leaves 1 - 2 m / H of its amplitude: a difference of m / (H - m).
    pub(super) fn bits_late(&self, half_periods: f64) -> Option<BitsLate> {
        let n = self.differences.len();
        if n < FEWEST {
            return None;
        }
        let mean = self.differences.iter().sum::<f64>() / n as f64;
        let squares = self.differences.iter().map(|d| (d - mean).powi(2));
        let variance = squares.sum::<f64>() / (n * (n - 1)) as f64;
        Some(BitsLate {
            periods: half_periods * mean / (1.0 + mean.abs()),
            variance: half_periods * half_periods * variance,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of halves of ten periods of alternating bits that begin `late` periods late.
    fn observed(late: i32) -> BitsLate {
        let mut alignment = Alignment::default();
        let sign = |period: i32| {
            let bit = (period - late).div_euclid(20);
            if bit.rem_euclid(2) == 0 { 1.0 } else { -1.0 }
        };
        let half = |begin: i32| (begin..begin + 10).map(sign).sum::<f64>();
        for interval in 0..30 {
            // A carrier that turns, and a little noise that is the same in all runs.
            let phase = Complex64::cis(0.3 * f64::from(interval));
            let noise = Complex64::new(0.1 * f64::from(interval % 3 - 1), 0.05);
            let begin = 20 * interval;
            alignment.observe(
                half(begin) * phase + noise,
                half(begin + 10) * phase - noise,
            );
        }
        alignment.bits_late(10.0).unwrap()
    }

    #[test]
    fn edges_elsewhere_are_found() {
        for late in [-3, -1, 0, 1, 3] {
            let found = observed(late);
            // The noise is 1 % of a half, averaged over 25.
            assert!(
                (found.periods - f64::from(late)).abs() < 0.1,
                "{late}: {found:?}"
            );
            assert!(found.variance < 0.1);
        }
    }

    #[test]
    fn few_changes_of_sign_tell_nothing() {
        let mut alignment = Alignment::default();
        for k in 0..FEWEST {
            assert_eq!(alignment.bits_late(10.0), None, "{k}");
            alignment.interrupt();
            alignment.observe(Complex64::ONE, Complex64::ONE);
            alignment.observe(-Complex64::ONE, -Complex64::ONE);
        }
        assert!(alignment.bits_late(10.0).is_some());
    }
}
