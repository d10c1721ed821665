//! Steps of the receiver's clock by whole code periods: no pseudorange shows them, only where bits begin.

use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_signal::tracking::{BitsLate, Channel};

/// Fewest channels that tell a slip of time from an error of their own.
const FEWEST: usize = 4;
/// A slip is a whole number of periods: half a period lies between none and one, ...
const SMALLEST_PERIODS: f64 = 0.5;
/// ... and stands out by so many deviations.
const SIGMAS: f64 = 6.0;
/// Bits that tell of the same slip begin within so many periods.
const AGREEMENT_PERIODS: f64 = 0.5;
/// A code period in range, m.
const PERIOD_M: f64 = SPEED_OF_LIGHT_MPS * 1e-3;

/// By how much all pseudoranges have become longer, m, where bits say that they have.
pub(super) fn find<'a>(channels: impl Iterator<Item = &'a Channel>) -> Option<f64> {
    let late: Vec<BitsLate> = channels.filter_map(Channel::bits_late).collect();
    slip_periods(&late).map(|periods| PERIOD_M * periods)
}

/// Whole periods by which the bits of three quarters of the channels begin late, in the weighted mean of those that are
/// within half a period of the median: a false signal may have its bits anywhere.
fn slip_periods(late: &[BitsLate]) -> Option<f64> {
    let mut sorted: Vec<f64> = late.iter().map(|one| one.periods).collect();
    sorted.sort_by(f64::total_cmp);
    let median = *sorted.get(sorted.len() / 2)?;
    let agrees = |one: &&BitsLate| (one.periods - median).abs() <= AGREEMENT_PERIODS;
    let all = late.len();
    let late: Vec<&BitsLate> = late.iter().filter(agrees).collect();
    if late.len() < FEWEST || 4 * late.len() < 3 * all {
        return None;
    }
    // A variance from a few bits may come out small by chance.
    let weight = |one: &&BitsLate| 1.0 / one.variance.max(1e-3);
    let weights: f64 = late.iter().map(weight).sum();
    let mean = late
        .iter()
        .map(|one| weight(one) * one.periods)
        .sum::<f64>()
        / weights;
    (mean.abs() > SMALLEST_PERIODS && mean.abs() > SIGMAS / weights.sqrt()).then(|| mean.round())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(periods: &[f64], variance: f64) -> Vec<BitsLate> {
        let late = periods.iter();
        late.map(|&periods| BitsLate { periods, variance })
            .collect()
    }

    #[test]
    fn what_all_bits_agree_on_is_a_slip() {
        let late = channels(&[0.8, 1.1, 0.9, 1.2, 0.95], 0.04);
        assert_eq!(slip_periods(&late), Some(1.0));
        let early = channels(&[-2.1, -1.8, -2.0, -2.2], 0.1);
        assert_eq!(slip_periods(&early), Some(-2.0));
    }

    #[test]
    fn one_whose_bits_are_false_does_not_move_time() {
        let counterfeit = channels(&[0.1, -0.1, 0.0, 0.1, 3.0], 0.01);
        assert_eq!(slip_periods(&counterfeit), None);
        let beside = channels(&[1.0, 1.1, 0.9, 1.0, -4.0], 0.01);
        assert_eq!(slip_periods(&beside), Some(1.0));
        let two = channels(&[1.0, 1.1, 0.9, 1.0, -4.0, 5.0], 0.01);
        assert_eq!(slip_periods(&two), None);
    }

    #[test]
    fn noise_and_few_channels_are_none() {
        assert_eq!(slip_periods(&channels(&[0.3, -0.2, 0.1, 0.4], 0.04)), None);
        // Mean 0.9, but its deviation is 0.4.
        assert_eq!(slip_periods(&channels(&[0.9; 5], 0.8)), None);
        assert_eq!(slip_periods(&channels(&[1.0; 3], 0.01)), None);
    }
}
