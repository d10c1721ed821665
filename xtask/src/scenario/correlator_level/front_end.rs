//! What filter, sampler and quantiser make of signal and noise before they are correlated.
//!
//! Per sample and component, thermal noise has unit variance before the filter at the sample rate
//! (as in [`if_signal`](crate::scenario::if_signal)). A correlator sum over N samples then holds
//!
//! - the signal: N g a R(lag), a its amplitude at baseband, g the quantiser's gain over the deviation
//!   of its input, R the code's autocorrelation through the filter;
//! - noise of variance N times the density of all else at the signal: thermal noise, other signals
//!   and interference weighted by the spectrum of the code, and quantiser distortion, whose
//!   colour follows from that of the input.

use anyhow::Result;
use gnss_signal::Signal;

use super::code_correlation::{Kernel, Lobe};
use super::quantiser::{LevelTable, Quantiser, Response};
use crate::scenario::antenna::Reception;
use crate::scenario::if_signal::{REACH, filter_response};

/// Points of the filter's response to a sample.
const OVERSAMPLING: usize = 4;

/// Steps of integrals over frequency.
const SPECTRUM_STEPS: usize = 2000;

/// Constants of a [`Reception`].
#[derive(Debug, Clone)]
pub(super) struct FrontEndModel {
    /// Components of a sample: 1 or 2.
    pub(super) components: f64,
    /// Amplitude of a signal at baseband over the square root of its C/N0 in Hz.
    pub(super) amplitude_scale: f64,
    /// Power that a signal adds to a component over its C/N0 in Hz.
    pub(super) power_scale: f64,
    /// Thermal noise of a component after the filter.
    pub(super) noise_power: f64,
    /// Thermal noise of a correlator sum, per sample and component, at unit gain.
    pub(super) thermal_density: f64,
    /// Part of the distortion's power per component that a sum holds, per sample.
    pub(super) distortion_density: f64,
    /// Part of a signal's power that the filter passes.
    pub(super) signal_part: f64,
    /// Overlap of the code's spectrum with that of another code, s.
    pub(super) code_overlap_s: f64,
    /// Signal through the filter; none: no filter.
    pub(super) signal_lobe: Option<Lobe>,
    /// Noise through filter and quantiser; none: white.
    pub(super) noise_lobe: Option<Lobe>,
    /// Noise density at the carrier over that of a correlator sum.
    pub(super) carrier_part: f64,
    /// Deviation of the mean sample power of N samples over its mean, times the root of N.
    pub(super) power_deviation: f64,
    levels: LevelTable,
    filter: Filter,
}

/// The front-end filter.
#[derive(Debug, Clone)]
struct Filter {
    taps: Vec<f64>,
    rate_hz: f64,
}

impl Filter {
    /// Gain at an offset from the carrier.
    fn gain(&self, offset_hz: f64) -> f64 {
        let (step_sin, step_cos) = (std::f64::consts::TAU * offset_hz / self.rate_hz).sin_cos();
        // From the middle of the symmetric taps outwards, turning a phasor: a cosine for each tap
        // would be most of what starting a run costs.
        let (middle, after) = (self.taps.len() / 2, self.taps.len() / 2 + 1);
        let (mut cos, mut sin) = (1.0, 0.0);
        let mut gain = self.taps[middle];
        for tap in &self.taps[after..] {
            (cos, sin) = (
                cos * step_cos - sin * step_sin,
                sin * step_cos + cos * step_sin,
            );
            gain += 2.0 * tap * cos;
        }
        gain
    }

    /// Covariance of the noise `lag` delivered samples apart.
    fn noise_covariance(&self, lag: usize) -> f64 {
        let shifted = self.taps.iter().skip(lag * OVERSAMPLING);
        let products = self.taps.iter().zip(shifted).map(|(a, b)| a * b);
        OVERSAMPLING as f64 * products.sum::<f64>()
    }
}

impl FrontEndModel {
    /// A front end for signals that add up to `signal_power_hz` (C/N0 in Hz) when its level is set.
    ///
    /// # Errors
    /// Where the quantiser is not modelled.
    pub(super) fn new(reception: &Reception, signal_power_hz: f64) -> Result<Self> {
        let samples = &reception.samples;
        let rate_hz = samples.sample_rate_hz;
        let complex = samples.format.is_complex();
        let components = if complex { 2.0 } else { 1.0 };
        let filter = Filter {
            taps: reception
                .bandwidth_hz
                .map_or_else(|| vec![1.0], |b| impulse_response(b / rate_hz)),
            rate_hz: OVERSAMPLING as f64 * rate_hz,
        };
        let filtered = reception.bandwidth_hz.is_some();
        let covariance = if filtered {
            (0..=filter.taps.len() / OVERSAMPLING)
                .map(|lag| filter.noise_covariance(lag))
                .collect()
        } else {
            vec![1.0]
        };
        // Real samples without a filter hold the noise of both sides of the carrier.
        let folds = !complex && !filtered;
        let power_scale = if folds { 2.0 } else { 1.0 } / rate_hz;
        let rms_squared = covariance[0] + power_scale * signal_power_hz;
        let colour = Colour {
            covariance,
            rms_squared,
            turn: std::f64::consts::TAU * samples.intermediate_frequency_hz / rate_hz,
            complex,
            chips_per_sample: Signal::GpsL1Ca.spec().code_rate_hz / rate_hz,
        };
        let quantiser = Quantiser::new(samples.format, reception.bits)?;
        let response = quantiser.response(1.0);
        let noise = colour.noise_kernel(&quantiser, response);
        let density = |kernel: &Kernel| -> f64 {
            let triangle = |lag: f64| (1.0 - lag.abs()).max(0.0);
            kernel
                .points
                .iter()
                .map(|(lag, w)| w * triangle(*lag))
                .sum()
        };
        let thermal_density = density(&colour.thermal_kernel()) / components;
        let nominal_thermal = response.gain.powi(2) / rms_squared * thermal_density;
        let kurtosis = quantiser.moment(4, 1.0) / response.power().powi(2);
        Ok(Self {
            components,
            amplitude_scale: (0.5 * components * components * power_scale).sqrt(),
            power_scale,
            noise_power: colour.covariance[0],
            thermal_density,
            distortion_density: (density(&noise) / components - nominal_thermal)
                / response.distortion,
            signal_part: if filtered {
                code_integral(|f_hz| filter.gain(f_hz).powi(2))
            } else {
                1.0
            },
            code_overlap_s: code_integral(|f_hz| {
                let gain = if filtered { filter.gain(f_hz) } else { 1.0 };
                code_spectrum_s(f_hz) * gain * gain
            }),
            signal_lobe: filtered.then(|| Lobe::new(&signal_kernel(&filter.taps, &colour))),
            noise_lobe: filtered.then(|| Lobe::new(&noise)),
            carrier_part: noise.points.iter().map(|p| p.1).sum::<f64>() / density(&noise),
            power_deviation: ((kurtosis - 1.0) / components * colour.square_sum()).sqrt(),
            levels: LevelTable::new(&quantiser),
            filter,
        })
    }

    /// The quantiser's response to components of deviation `rms`, at a level set for `level`.
    pub(super) fn response(&self, rms: f64, level: f64) -> Response {
        self.levels.at(rms / level)
    }

    /// Gain of the filter at an offset from the carrier.
    pub(super) fn filter_gain(&self, offset_hz: f64) -> f64 {
        if self.filter.taps.len() == 1 {
            1.0
        } else {
            self.filter.gain(offset_hz)
        }
    }
}

/// Coefficients of the filter that passes `bandwidth`, two-sided, as a fraction of the sample rate:
/// [`OVERSAMPLING`] to a sample, symmetric about the middle one, of unit sum.
fn impulse_response(bandwidth: f64) -> Vec<f64> {
    let reach = (REACH * OVERSAMPLING) as i64;
    let taps = (-reach..=reach).map(|k| filter_response(bandwidth, k as f64 / OVERSAMPLING as f64));
    let taps: Vec<f64> = taps.collect();
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|tap| tap / sum).collect()
}

/// The filter's impulse response over chips; it works on means of the code over its own samples.
fn signal_kernel(taps: &[f64], colour: &Colour) -> Kernel {
    let step = colour.chips_per_sample / OVERSAMPLING as f64;
    let middle = (taps.len() / 2) as f64;
    let taps = taps.iter().enumerate();
    Kernel {
        points: taps
            .map(|(k, t)| ((k as f64 - middle) * step, *t))
            .collect(),
        width_chips: step,
    }
}

/// How successive samples of noise depend on each other.
struct Colour {
    /// Covariance of a baseband component at lags from 0 on, samples.
    covariance: Vec<f64>,
    /// Variance of a component, signals included.
    rms_squared: f64,
    /// Intermediate frequency, rad a sample.
    turn: f64,
    complex: bool,
    chips_per_sample: f64,
}

impl Colour {
    /// Points at all lags of `weight`, a function of the lag in samples.
    fn kernel(&self, weight: impl Fn(usize) -> f64) -> Kernel {
        let last = self.covariance.len() as i64 - 1;
        let point = |lag: i64| {
            let weight = weight(lag.unsigned_abs() as usize);
            (lag as f64 * self.chips_per_sample, weight)
        };
        Kernel {
            points: (-last..=last).map(point).collect(),
            width_chips: 0.0,
        }
    }

    /// Thermal noise turned to baseband, before the quantiser.
    fn thermal_kernel(&self) -> Kernel {
        self.kernel(|lag| {
            let (sin, cos) = (self.turn * lag as f64).sin_cos();
            self.covariance[lag] * self.sum(cos * cos, sin * sin)
        })
    }

    /// What of a real and an imaginary product a sum holds.
    fn sum(&self, even: f64, odd: f64) -> f64 {
        if self.complex {
            2.0 * (even + odd)
        } else {
            even
        }
    }

    /// Everything but signals, behind the quantiser, turned to baseband.
    ///
    /// Components that correlate by r before it have sum b_m^2 r^m behind it.
    fn noise_kernel(&self, quantiser: &Quantiser, response: Response) -> Kernel {
        let higher = quantiser.higher_squares();
        let product = |r: f64| -> f64 {
            let orders = higher.iter().enumerate();
            let distortion: f64 = orders.map(|(k, b)| b * r.powi(2 * k as i32 + 3)).sum();
            response.gain.powi(2) * r + distortion
        };
        self.kernel(|lag| {
            let r = self.covariance[lag] / self.rms_squared;
            if lag == 0 {
                let power = response.gain.powi(2) * r + response.distortion;
                return self.sum(power, 0.0);
            }
            let (sin, cos) = (self.turn * lag as f64).sin_cos();
            self.sum(product(r * cos) * cos, product(r * sin) * sin)
        })
    }

    /// Sum over all lags of the squared correlation of a component's samples.
    fn square_sum(&self) -> f64 {
        let at = |lag: usize| {
            let cos = if self.complex {
                1.0
            } else {
                (self.turn * lag as f64).cos()
            };
            (self.covariance[lag] * cos / self.covariance[0]).powi(2)
        };
        1.0 + 2.0 * (1..self.covariance.len()).map(at).sum::<f64>()
    }
}

/// Power spectrum of the C/A code at an offset, s (of unit power; lines blurred).
pub(super) fn code_spectrum_s(offset_hz: f64) -> f64 {
    let rate_hz = Signal::GpsL1Ca.spec().code_rate_hz;
    let x = std::f64::consts::PI * offset_hz / rate_hz;
    let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
    sinc * sinc / rate_hz
}

/// Integral of the code spectrum times `weight`.
fn code_integral(weight: impl Fn(f64) -> f64) -> f64 {
    let reach_hz = 10.0 * Signal::GpsL1Ca.spec().code_rate_hz;
    let step_hz = reach_hz / SPECTRUM_STEPS as f64;
    let at = |k: usize| {
        let f_hz = (k as f64 + 0.5) * step_hz;
        code_spectrum_s(f_hz) * weight(f_hz)
    };
    2.0 * step_hz * (0..SPECTRUM_STEPS).map(at).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use gnss_signal::sample::{SampleDescription, SampleFormat};

    use super::*;
    use crate::scenario::antenna::Gain;

    fn model(format: SampleFormat, bandwidth: Option<f64>) -> FrontEndModel {
        let reception = Reception {
            samples: SampleDescription {
                format,
                sample_rate_hz: 4e6,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            bandwidth_hz: bandwidth.map(|b| b * 4e6),
            bits: None,
            gain: Gain::Fixed,
        };
        FrontEndModel::new(&reception, 0.0).unwrap()
    }

    #[test]
    fn the_gain_is_the_sum_of_cosines() {
        let filter = model(SampleFormat::Ci8, Some(0.6)).filter;
        for offset_hz in [0.0, 3e5, -1.1e6, 7.7e6] {
            let turn = std::f64::consts::TAU * offset_hz / filter.rate_hz;
            let middle = (filter.taps.len() / 2) as f64;
            let taps = filter.taps.iter().enumerate();
            let sum: f64 = taps
                .map(|(k, tap)| tap * (turn * (k as f64 - middle)).cos())
                .sum();
            // Rounding of 128 turns.
            assert!((filter.gain(offset_hz) - sum).abs() < 1e-13);
        }
    }

    #[test]
    fn white_noise_stays_white() {
        let model = model(SampleFormat::C1Msb, None);
        assert_eq!((model.thermal_density, model.noise_power), (1.0, 1.0));
        assert!((model.distortion_density - 1.0).abs() < 1e-9);
        assert!((model.carrier_part - 1.0).abs() < 1e-9);
        // The tail of the integral beyond ten chip rates: 1e-4 of it.
        assert!((model.code_overlap_s * 1.023e6 - 2.0 / 3.0).abs() < 1e-4);
    }

    #[test]
    fn a_filter_keeps_the_density_at_the_carrier_and_lessens_the_power() {
        let model = model(SampleFormat::Ci8, Some(0.8));
        // Ripple of the filter, and what of the code lies outside its band.
        assert!((model.thermal_density * model.carrier_part - 1.0).abs() < 0.01);
        assert!((model.noise_power - 0.8).abs() < 0.02);
        assert!((model.filter_gain(0.0) - 1.0).abs() < 1e-6);
        assert!(model.filter_gain(1.9e6) < 0.01);
    }
}
