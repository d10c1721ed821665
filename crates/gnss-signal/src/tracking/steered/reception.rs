//! Errors of a steered channel's sums, and their variances, by the C/N0 of its signal.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::tracking::discriminator::{CodeDiscriminator, EarlyPromptLate, FrequencyDiscriminator};

/// Ratio of signal to noise of an interval below which its own power does not normalise errors:
/// it would be mostly noise.
const WEAK_SNR: f64 = 4.0;
/// Ratio of signal to noise of an interval from which noise alone ...
const STRONG_SNR: f64 = 16.0;
/// ... hardly leaves less of the power than this: the carrier slips by half a cycle while it is summed.
const LEAST_FOUND: f64 = 0.5;
/// No signal further away than this reaches the early or late tap, chips.
const LARGEST_CHIPS: f64 = 1.5;
/// C/N0 below which signals are not told apart, Hz (8 dB-Hz): its estimate is noise.
const LOWEST_CN0_HZ: f64 = 6.0;

/// What the sums of a signal are worth: its C/N0, and the spacing of its taps.
///
/// The errors of weak signals are normalised by the power that their C/N0 promises: they stay bounded, and
/// noise does not take away their slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reception {
    /// C/N0, Hz.
    pub cn0_hz: f64,
    /// Early to late, chips.
    pub spacing_chips: f64,
    /// Length of a code period, s.
    pub period_s: f64,
}

impl Reception {
    /// Signal over noise of `interval_s`, no less than what weak signals still can be told by.
    fn snr(&self, interval_s: f64) -> f64 {
        self.cn0_hz.max(LOWEST_CN0_HZ) * interval_s
    }

    /// Variance of the code error of coherent sums over `interval_s`, chips^2 (Kaplan2017, 8.95; of the
    /// envelope's error the squaring loss is half of the power's).
    #[must_use]
    pub fn code_variance_chips2(&self, interval_s: f64) -> f64 {
        let (d, c) = (self.spacing_chips, self.snr(interval_s));
        let squaring = if c > WEAK_SNR { 1.0 } else { 2.0 };
        d / (4.0 * c) * (1.0 + squaring / ((2.0 - d) * c))
    }

    /// Variance of the frequency between two sums of `sums_s` each, their middles that far apart,
    /// Hz^2.
    #[must_use]
    pub fn frequency_variance_hz2(&self, sums_s: f64) -> f64 {
        let c = self.snr(sums_s);
        (1.0 + 0.5 / c) / c / (TAU * sums_s).powi(2)
    }

    /// Code error of coherent sums over `sums_s`, chips, that have `noise_variance` without a signal: the
    /// envelope's, or, of a weak signal and of one that a slip of the carrier has taken away, the power's over the
    /// power that its C/N0 promises.
    #[must_use]
    pub fn code_error_chips(
        &self,
        taps: &EarlyPromptLate,
        noise_variance: f64,
        sums_s: f64,
    ) -> f64 {
        let snr = self.snr(sums_s);
        let found = taps.prompt.norm_sqr() / noise_variance - 1.0;
        let slipped = snr > STRONG_SNR && found < LEAST_FOUND * snr;
        if snr > WEAK_SNR && !slipped {
            return CodeDiscriminator::Envelope.error_chips(taps, self.spacing_chips);
        }
        let peak = 1.0 - self.spacing_chips / 2.0;
        let power = snr * noise_variance;
        let error = (taps.early.norm_sqr() - taps.late.norm_sqr()) / (4.0 * peak * power);
        error.clamp(-LARGEST_CHIPS, LARGEST_CHIPS)
    }

    /// Frequency error, Hz, by the prompt sums of two halves of `sums_s` each, their middles `apart_s`
    /// apart, that have `noise_variance` without a signal: their angle, or, of a weak signal, the sine by
    /// the power that its C/N0 promises.
    #[must_use]
    pub fn frequency_error_hz(
        &self,
        halves: [Complex64; 2],
        noise_variance: f64,
        sums_s: f64,
        apart_s: f64,
    ) -> f64 {
        let [first, second] = halves;
        let snr = self.snr(sums_s);
        if 2.0 * snr > WEAK_SNR {
            return FrequencyDiscriminator::FourQuadrant.error_hz(first, second, apart_s);
        }
        let cross = (second * first.conj()).im / (snr * noise_variance);
        cross.clamp(-TAU / 2.0, TAU / 2.0) / (TAU * apart_s)
    }
}
