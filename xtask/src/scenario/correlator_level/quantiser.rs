//! What a quantiser does to Gaussian samples: gain, distortion, and the colour of the distortion.
//!
//! A Gaussian input x of variance s^2 leaves as Q(x) = b x / s + d, with d uncorrelated with x
//! (Bussgang). Expanded in Hermite polynomials, Q has the coefficients b_1 = b, b_3, ..; the
//! product moment of two outputs whose inputs correlate by r is the sum of b_m^2 r^m
//! (Papoulis2002).

use std::f64::consts::{SQRT_2, TAU};

use anyhow::{Result, ensure};
use gnss_signal::sample::SampleFormat;
use statrs::function::erf::erfc;

use crate::scenario::if_signal::{RMS_8_BIT, STEPS};

/// Orders of the expansion beyond the first: 3, 5, .. 21. Only products of different samples
/// need them, whose correlation is below 1.
const HIGHER_ORDERS: usize = 10;
/// Points of [`LevelTable`], and its range of ln(rms over level).
const POINTS: usize = 401;
const RANGE: f64 = 5.0;

/// Steps of a quantiser whose level is set to an input of unit deviation.
#[derive(Debug, Clone)]
pub(super) struct Quantiser {
    /// Input at each step.
    thresholds: Vec<f64>,
    /// Height of every step, units of 8-bit values.
    height: f64,
}

/// Moments of the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Response {
    /// Output over input in units of the input's deviation.
    pub(super) gain: f64,
    /// Mean square of what is uncorrelated with the input.
    pub(super) distortion: f64,
}

impl Response {
    /// Mean square of the output.
    pub(super) fn power(&self) -> f64 {
        self.gain * self.gain + self.distortion
    }
}

impl Quantiser {
    /// The quantiser of `bits` for `format`, all that it holds where there are none; formats wider
    /// than 8 bits reach the correlators with 8.
    ///
    /// # Errors
    /// Where a format narrower or wider than 8 bits is to hold another number of bits.
    pub(super) fn new(format: SampleFormat, bits: Option<u8>) -> Result<Self> {
        let room = format.bits_per_sample() / format.components();
        let depth = bits.map_or(room, usize::from);
        ensure!(
            depth == room || (room == 8 && (1..=8).contains(&depth)),
            "bits: at the correlator level {format} cannot hold {depth}; expected none, or 1 to 8 \
             in a format of 8"
        );
        Ok(match depth {
            1 => Self {
                thresholds: vec![0.0],
                height: 2.0,
            },
            2..=7 => {
                let step = f64::from(STEPS[depth - 2]);
                let reach = (1 << (depth - 1)) - 1;
                Self {
                    thresholds: (-reach..=reach).map(|k| f64::from(k) * step).collect(),
                    height: 2.0,
                }
            }
            _ => Self {
                thresholds: (-127..127)
                    .map(|k| (f64::from(k) + 0.5) / f64::from(RMS_8_BIT))
                    .collect(),
                height: 1.0,
            },
        })
    }

    fn values(&self) -> impl Iterator<Item = f64> {
        let lowest = -0.5 * self.height * self.thresholds.len() as f64;
        (0..=self.thresholds.len()).map(move |k| lowest + self.height * k as f64)
    }

    /// Mean of the output's `power`th power for a Gaussian input of deviation `rms`.
    pub(super) fn moment(&self, power: i32, rms: f64) -> f64 {
        let below = |k: usize| self.thresholds.get(k).map_or(1.0, |t| phi_below(t / rms));
        let mut before = 0.0;
        self.values()
            .enumerate()
            .map(|(k, value)| {
                let now = below(k);
                let share = now - before;
                before = now;
                share * value.powi(power)
            })
            .sum()
    }

    /// Hermite coefficient of odd `order` for an input of deviation `rms`.
    fn coefficient(&self, order: usize, rms: f64) -> f64 {
        let term = |t: &f64| {
            let x = t / rms;
            (-0.5 * x * x).exp() / TAU.sqrt() * hermite_over_root_factorial(order - 1, x)
        };
        self.height * self.thresholds.iter().map(term).sum::<f64>() / (order as f64).sqrt()
    }

    /// Moments for a Gaussian input of deviation `rms`.
    pub(super) fn response(&self, rms: f64) -> Response {
        let gain = self.coefficient(1, rms);
        let power = self.moment(2, rms);
        Response {
            gain,
            distortion: (power - gain * gain).max(0.0),
        }
    }

    /// Squares of the coefficients of orders 3, 5, .. at unit deviation.
    pub(super) fn higher_squares(&self) -> [f64; HIGHER_ORDERS] {
        std::array::from_fn(|k| self.coefficient(2 * k + 3, 1.0).powi(2))
    }
}

/// Part of a standard normal below `x`.
fn phi_below(x: f64) -> f64 {
    0.5 * erfc(-x / SQRT_2)
}

/// He_n(x) / sqrt(n!).
fn hermite_over_root_factorial(n: usize, x: f64) -> f64 {
    let (mut before, mut now) = (0.0, 1.0);
    for k in 0..n {
        let next = (x * now - (k as f64).sqrt() * before) / (k as f64 + 1.0).sqrt();
        (before, now) = (now, next);
    }
    now
}

/// [`Response`] over the ratio of the input's deviation to the level, ready to look up.
#[derive(Debug, Clone)]
pub(super) struct LevelTable(Vec<Response>);

impl LevelTable {
    pub(super) fn new(quantiser: &Quantiser) -> Self {
        let step = 2.0 * RANGE / (POINTS - 1) as f64;
        let at = |k: usize| quantiser.response((k as f64 * step - RANGE).exp());
        Self((0..POINTS).map(at).collect())
    }

    /// Straight between points 2.5 % apart, which is good to 1e-4; held beyond a factor of
    /// 150 either way.
    pub(super) fn at(&self, rms: f64) -> Response {
        let place = (rms.ln() + RANGE) * (POINTS - 1) as f64 / (2.0 * RANGE);
        let place = place.clamp(0.0, (POINTS - 1) as f64 - 1e-9);
        let (k, part) = (place as usize, place.fract());
        let (a, b) = (self.0[k], self.0[k + 1]);
        Response {
            gain: a.gain + part * (b.gain - a.gain),
            distortion: a.distortion + part * (b.distortion - a.distortion),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_bit_obeys_the_arcsine_law() {
        let quantiser = Quantiser::new(SampleFormat::R1Msb, None).unwrap();
        let response = quantiser.response(3.0);
        assert!((response.power() - 1.0).abs() < 1e-12);
        assert!((response.gain - (2.0 / std::f64::consts::PI).sqrt()).abs() < 1e-9);
        let r: f64 = 0.7;
        let series = quantiser.higher_squares();
        let sum = response.gain.powi(2) * r
            + (series.iter().enumerate())
                .map(|(k, b)| b * r.powi(2 * k as i32 + 3))
                .sum::<f64>();
        // Orders from 23 on: below 0.7^23.
        assert!((sum - r.asin() / std::f64::consts::FRAC_PI_2).abs() < 1e-4);
    }

    #[test]
    fn the_loss_falls_with_the_bits() {
        let loss_db = |format, bits| {
            let response = Quantiser::new(format, bits).unwrap().response(1.0);
            10.0 * (response.power() / response.gain.powi(2)).log10()
        };
        // Max's quantiser: 0.55 dB (its figure has two digits); one bit: pi / 2.
        assert!((loss_db(SampleFormat::R2Msb, None) - 0.55).abs() < 0.005);
        assert!((loss_db(SampleFormat::C1Lsb, None) - 1.961).abs() < 0.001);
        assert!(loss_db(SampleFormat::Ci8, None) < 0.001);
        for (format, bits) in [(SampleFormat::C1Lsb, 1), (SampleFormat::R2Msb, 2)] {
            let wide = loss_db(SampleFormat::Ci8, Some(bits));
            assert_eq!(wide, loss_db(format, None));
        }
        // Uniform quantisers of 3, 4 and 5 bits have signal over distortion of 14.27, 19.38 and
        // 24.57 dB (`Max1960`); with the best step the gain is 1 less the distortion.
        for (bits, ratio_db) in [(3, 14.27), (4, 19.38), (5, 24.57)] {
            let loss = -10.0 * (1.0 - 10f64.powf(-ratio_db / 10.0)).log10();
            let found = loss_db(SampleFormat::Ci8, Some(bits));
            assert!((found - loss).abs() < 0.002, "{bits}: {found} dB");
        }
        assert!(Quantiser::new(SampleFormat::R2Msb, Some(1)).is_err());
        assert!(Quantiser::new(SampleFormat::Ci16Le, Some(4)).is_err());
    }

    #[test]
    fn the_table_is_what_it_tabulates() {
        for format in [SampleFormat::R1Msb, SampleFormat::R2Msb, SampleFormat::Ci8] {
            let quantiser = Quantiser::new(format, None).unwrap();
            let table = LevelTable::new(&quantiser);
            for rms in [0.31, 0.9977, 1.013, 4.7] {
                let (found, exact) = (table.at(rms), quantiser.response(rms));
                assert!((found.gain / exact.gain - 1.0).abs() < 1e-4);
                let error = found.power() / exact.power() - 1.0;
                assert!(error.abs() < 2e-4, "{error} at {rms}");
            }
        }
    }
}
