//! Autocorrelation of a ranging code, plain or through a filter.
//!
//! Without a filter it is exact: straight between the values at whole chips, side lobes included
//! (up to 6 % of the peak, one chip from it in some codes). Through a filter it is tabulated within
//! [`NEAR_CHIPS`] of the peak; beyond, where only side lobes are left, their corners stay unrounded.

use gnss_signal::{SignalId, ranging_code};

/// Points of the tables in a chip; straight in between, good to 2e-4 of the peak for a front end
/// of 50 MHz and to the square of the bandwidth less below.
const POINTS_PER_CHIP: usize = 256;
/// Reach of the table around the peak, chips.
const NEAR_CHIPS: usize = 3;
const LENGTH: usize = 1023;

/// A symmetric impulse response: delays (chips) and weights.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kernel {
    /// Delay, chips, and weight.
    pub(super) points: Vec<(f64, f64)>,
    /// Width of the rectangle that every point stands for, chips; zero: none.
    pub(super) width_chips: f64,
}

/// The triangle of one chip after a [`Kernel`], from zero on.
#[derive(Debug, Clone)]
pub(super) struct Lobe {
    values: Vec<f64>,
    /// Sum of the kernel's weights.
    sum: f64,
}

impl Lobe {
    pub(super) fn new(kernel: &Kernel) -> Self {
        let reach = kernel.points.iter().map(|p| p.0).fold(0.0, f64::max);
        let points = ((reach + kernel.width_chips + 1.0) * POINTS_PER_CHIP as f64).ceil() as usize;
        let at = |lag: f64| -> f64 {
            let near = kernel.points.iter().filter(|p| (lag - p.0).abs() < 2.0);
            near.map(|(delay, weight)| weight * smoothed_triangle(lag - delay, kernel.width_chips))
                .sum()
        };
        Self {
            values: (0..=points)
                .map(|k| at(k as f64 / POINTS_PER_CHIP as f64))
                .collect(),
            sum: kernel.points.iter().map(|p| p.1).sum(),
        }
    }

    fn at_point(&self, point: isize) -> f64 {
        self.values
            .get(point.unsigned_abs())
            .copied()
            .unwrap_or(0.0)
    }

    fn reach_chips(&self) -> isize {
        (self.values.len() / POINTS_PER_CHIP) as isize + 1
    }
}

/// Mean of the triangle over `width` around `lag`.
fn smoothed_triangle(lag: f64, width: f64) -> f64 {
    let triangle = |x: f64| (1.0 - x.abs()).max(0.0);
    if width == 0.0 {
        return triangle(lag);
    }
    const PARTS: u32 = 4;
    let offset = |k: u32| (f64::from(k) + 0.5) / f64::from(PARTS) - 0.5;
    let sum: f64 = (0..PARTS).map(|k| triangle(lag + width * offset(k))).sum();
    sum / f64::from(PARTS)
}

/// Correlation of one code with itself over the lag.
#[derive(Debug, Clone)]
pub(super) struct CodeCorrelation {
    /// At whole chips from 0 to the code length, times the kernel's weight.
    at_chips: Box<[f32; LENGTH + 1]>,
    /// From zero to [`NEAR_CHIPS`]; empty without a filter.
    near: Vec<f32>,
}

impl CodeCorrelation {
    /// That of `signal` through the filter of `lobe`; none: no filter.
    pub(super) fn new(signal: SignalId, lobe: Option<&Lobe>) -> Self {
        let exact = side_lobes(signal);
        let sum = lobe.map_or(1.0, |lobe| lobe.sum);
        Self {
            at_chips: Box::new(std::array::from_fn(|k| (sum * exact[k % LENGTH]) as f32)),
            near: lobe.map_or_else(Vec::new, |lobe| near_peak(&exact, lobe)),
        }
    }

    /// A bare peak without side lobes, given from zero lag on.
    pub(super) fn peak(shape: impl Fn(f64) -> f64) -> Self {
        let points = NEAR_CHIPS * POINTS_PER_CHIP + 1;
        let at = |k: usize| shape(k as f64 / POINTS_PER_CHIP as f64) as f32;
        Self {
            at_chips: Box::new([0.0; LENGTH + 1]),
            near: (0..=points).map(at).collect(),
        }
    }

    /// Value at `lag_chips` (any), over the peak without filter.
    pub(super) fn at(&self, lag_chips: f64) -> f64 {
        let length = LENGTH as f64;
        let mut lag = lag_chips.abs();
        if lag > 0.5 * length {
            lag = (lag - length * (lag / length).round()).abs();
        }
        let (table, place): (&[f32], f64) = if !self.near.is_empty() && lag < NEAR_CHIPS as f64 {
            (&self.near, lag * POINTS_PER_CHIP as f64)
        } else {
            (self.at_chips.as_slice(), lag)
        };
        let whole = place as usize;
        let part = (place - whole as f64) as f32;
        match table.get(whole..whole + 2) {
            Some([a, b]) => f64::from(a + part * (b - a)),
            _ => 0.0,
        }
    }
}

/// Values at whole chips, of which the first is 1.
fn side_lobes(signal: SignalId) -> Vec<f64> {
    let code = ranging_code(signal);
    let mut signs = [0_u64; 2 * SIGN_WORDS + 1];
    for n in 0..2 * LENGTH {
        signs[n / 64] |= u64::from(code[n % LENGTH] < 0) << (n % 64);
    }
    (0..LENGTH)
        .map(|lag| f64::from(at_lag(&signs, lag)) / LENGTH as f64)
        .collect()
}

/// 64-bit words that hold the signs of a code period.
const SIGN_WORDS: usize = LENGTH.div_ceil(64);

/// Sum of the products of a code with itself `lag` chips on, from the signs of two periods: chips
/// less twice the number of signs that differ.
fn at_lag(signs: &[u64; 2 * SIGN_WORDS + 1], lag: usize) -> i32 {
    let (word, bit) = (lag / 64, lag % 64);
    let different: u32 = (0..SIGN_WORDS)
        .map(|k| {
            let pair = u128::from(signs[word + k + 1]) << 64 | u128::from(signs[word + k]);
            let left = LENGTH - 64 * k;
            let mask = if left < 64 { (1 << left) - 1 } else { u64::MAX };
            (((pair >> bit) as u64 ^ signs[k]) & mask).count_ones()
        })
        .sum();
    LENGTH as i32 - 2 * different as i32
}

fn near_peak(at_chips: &[f64], lobe: &Lobe) -> Vec<f32> {
    let reach = lobe.reach_chips() + NEAR_CHIPS as isize;
    let at = |point: usize| -> f64 {
        (-reach..=reach)
            .map(|chip| {
                let away = point as isize - chip * POINTS_PER_CHIP as isize;
                at_chips[chip.rem_euclid(LENGTH as isize) as usize] * lobe.at_point(away)
            })
            .sum()
    };
    (0..=NEAR_CHIPS * POINTS_PER_CHIP + 1)
        .map(|k| at(k) as f32)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prn(prn: u8) -> SignalId {
        SignalId::gps_l1_ca(prn).unwrap()
    }

    #[test]
    fn without_a_filter_it_is_the_triangle_on_side_lobes_of_three_values() {
        for n in [1, 7, 24] {
            let correlation = CodeCorrelation::new(prn(n), None);
            assert_eq!(correlation.at(0.0), 1.0);
            let lobe = correlation.at(1.0) * 1023.0;
            assert!([-65.0, -1.0, 63.0].iter().any(|v| (v - lobe).abs() < 1e-3));
            // Straight within the chip; single precision.
            let expected = 0.7 + 0.3 * lobe / 1023.0;
            assert!((correlation.at(-0.3) - expected).abs() < 1e-6);
            assert!((correlation.at(1023.3) - expected).abs() < 1e-6);
            assert!((correlation.at(-1022.7) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn side_lobes_are_the_sums_of_products() {
        for n in [1, 19, 32] {
            let code = ranging_code(prn(n));
            let found = side_lobes(prn(n));
            for lag in [0, 1, 63, 64, 65, 511, 960, 1022] {
                let products =
                    (0..LENGTH).map(|k| i32::from(code[k]) * i32::from(code[(k + lag) % LENGTH]));
                assert_eq!(found[lag], f64::from(products.sum::<i32>()) / 1023.0);
            }
        }
    }

    #[test]
    fn a_delta_kernel_changes_nothing_and_a_wide_one_rounds_the_peak() {
        let delta = Lobe::new(&Kernel {
            points: vec![(0.0, 1.0)],
            width_chips: 0.0,
        });
        let wide = Lobe::new(&Kernel {
            points: vec![(-0.2, 0.25), (0.0, 0.5), (0.2, 0.25)],
            width_chips: 0.0,
        });
        let plain = CodeCorrelation::new(prn(5), None);
        let same = CodeCorrelation::new(prn(5), Some(&delta));
        let rounded = CodeCorrelation::new(prn(5), Some(&wide));
        for lag in [0.0, 0.13, 0.5, 0.99, 1.4, 2.7, 300.2] {
            // A corner between points of the table: 1/256 chip.
            assert!((same.at(lag) - plain.at(lag)).abs() < 2e-3);
            let mean = 0.5 * plain.at(lag) + 0.25 * (plain.at(lag - 0.2) + plain.at(lag + 0.2));
            if lag < 3.0 {
                assert!((rounded.at(lag) - mean).abs() < 2e-3);
            }
        }
    }
}
