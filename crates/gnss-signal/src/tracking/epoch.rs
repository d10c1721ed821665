//! The pre-filter: all integrations of a navigation epoch combined into one value.

use num_complex::Complex64;

use super::Lock;
use super::discriminator::EarlyPromptLate;
use crate::SignalId;

/// What a channel says at a navigation epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEpoch {
    /// The signal.
    pub signal: SignalId,
    /// The tick at which the state holds: that of the epoch.
    pub tick: u64,
    /// Code periods completed since the channel's first began.
    pub code_period: i64,
    /// Code phase, chips, in [0, code length).
    pub code_phase_chips: f64,
    /// Code periods since the present data bit began, where bit boundaries are known.
    pub periods_into_bit: Option<u8>,
    /// Variance of the code phase, chips^2; infinite where a steered channel measured nothing since
    /// the previous epoch.
    pub code_variance_chips2: f64,
    /// Doppler, Hz, above zero when approaching (whichever way the spectrum runs).
    pub doppler_hz: f64,
    /// Its variance, Hz^2; infinite where a steered channel measured none.
    pub doppler_variance_hz2: f64,
    /// How long before the epoch a steered channel's Doppler holds, s; zero where it is carried there.
    pub doppler_age_s: f64,
    /// Where the Doppler of a steered channel had to lie to be relied on; `None` where that is not limited: of a locked
    /// carrier, and of a channel that nobody steers.
    pub doppler_reach: Option<DopplerReach>,
    /// Integral of the Doppler since the channel's start, cycles.
    pub doppler_cycles: f64,
    /// Phase lock was lost since the previous epoch.
    pub phase_slipped: bool,
    /// C/N0, smoothed, dB-Hz.
    pub cn0_dbhz: f64,
    /// C/N0 by the last integration alone, or while it pulls in by the latest ones, Hz; noise may take it below
    /// zero.
    pub cn0_now_hz: f64,
    /// Early and late sums over prompt, in phase with it, of the integrations since the previous epoch; `None`
    /// without one and while the channel pulls in.
    pub tap_ratios: Option<[f64; 2]>,
    /// What the channel sees.
    pub lock: Lock,
    /// Prompt sum of the last integration over the noise deviation.
    pub prompt: Complex64,
    /// Mean code error of the epoch's integrations, chips.
    pub code_error_chips: f64,
    /// Mean frequency error of the epoch's integrations, Hz.
    pub frequency_error_hz: f64,
}

/// How far from the oscillator a frequency discriminator is relied on: half of what it takes for another frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DopplerReach {
    /// Doppler of the oscillator, Hz, above zero when approaching.
    pub oscillator_hz: f64,
    /// How far from it, Hz.
    pub width_hz: f64,
}

impl DopplerReach {
    /// Whether a signal of `doppler_hz`, above zero when approaching, is measured as what it is.
    #[must_use]
    pub fn holds(&self, doppler_hz: f64) -> bool {
        (doppler_hz - self.oscillator_hz).abs() <= self.width_hz
    }
}

/// What the integrations of an epoch say together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EpochValues {
    /// Code phase measured minus that of the oscillator, chips.
    pub(super) code_shift_chips: f64,
    pub(super) code_error_chips: f64,
    pub(super) code_variance_chips2: f64,
    pub(super) frequency_error_hz: f64,
    /// Apparent Doppler, Hz.
    pub(super) doppler_hz: f64,
    pub(super) doppler_variance_hz2: f64,
    /// When the Doppler holds, s on the channel's clock; `None`: at the epoch.
    pub(super) doppler_at_s: Option<f64>,
    /// How far from the oscillator's it can be told, Hz.
    pub(super) reach_hz: f64,
}

impl EpochValues {
    /// Where the Doppler had to lie to be told, above zero when approaching where `sign` is that of the spectrum.
    pub(super) fn reach(&self, sign: f64) -> Option<DopplerReach> {
        self.reach_hz.is_finite().then_some(DopplerReach {
            oscillator_hz: sign * (self.doppler_hz - self.frequency_error_hz),
            width_hz: self.reach_hz,
        })
    }

    /// Nothing was measured; the oscillator has that Doppler.
    pub(super) const fn nothing(doppler_hz: f64) -> Self {
        Self {
            code_shift_chips: 0.0,
            code_error_chips: 0.0,
            code_variance_chips2: f64::INFINITY,
            frequency_error_hz: 0.0,
            doppler_hz,
            doppler_variance_hz2: f64::INFINITY,
            doppler_at_s: None,
            reach_hz: f64::INFINITY,
        }
    }
}

/// One integration as the pre-filter takes it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Integration {
    /// Middle of the integration, s on the channel's clock.
    pub(super) middle_s: f64,
    /// Measured integral of the Doppler at the middle, cycles.
    pub(super) phase_cycles: f64,
    pub(super) code_error_chips: f64,
    pub(super) frequency_error_hz: f64,
}

/// Products of the sums since the previous epoch with prompt.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TapProducts {
    early: f64,
    prompt: f64,
    late: f64,
}

impl TapProducts {
    pub(super) fn push(&mut self, taps: &EarlyPromptLate) {
        let in_phase = |tap: Complex64| tap.re * taps.prompt.re + tap.im * taps.prompt.im;
        self.early += in_phase(taps.early);
        self.prompt += in_phase(taps.prompt);
        self.late += in_phase(taps.late);
    }

    /// Early and late over prompt.
    pub(super) fn ratios(&self) -> Option<[f64; 2]> {
        (self.prompt > 0.0).then(|| [self.early / self.prompt, self.late / self.prompt])
    }
}

/// The integrations since the previous epoch.
#[derive(Debug, Clone, Default)]
pub(super) struct PreFilter {
    held: Vec<Integration>,
}

/// A straight line through the phases of an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PhaseLine {
    /// Time at which the slope holds best, s.
    pub(super) middle_s: f64,
    /// Doppler, Hz.
    pub(super) slope_hz: f64,
    /// Sum of squared distances from the middle, s^2: slope variance = phase variance / spread.
    pub(super) spread_s2: f64,
}

impl PreFilter {
    pub(super) fn push(&mut self, integration: Integration) {
        self.held.push(integration);
    }

    /// Least-squares line through the phases; `None` with fewer than two integrations.
    pub(super) fn phase_line(&self) -> Option<PhaseLine> {
        let n = self.held.len() as f64;
        let middle_s = self.held.iter().map(|i| i.middle_s).sum::<f64>() / n;
        let spread_s2: f64 = self
            .held
            .iter()
            .map(|i| (i.middle_s - middle_s).powi(2))
            .sum();
        let phases = self
            .held
            .iter()
            .map(|i| (i.middle_s - middle_s) * i.phase_cycles);
        (spread_s2 > 0.0).then(|| PhaseLine {
            middle_s,
            slope_hz: phases.sum::<f64>() / spread_s2,
            spread_s2,
        })
    }

    /// Mean code error, chips, and frequency error, Hz.
    pub(super) fn mean_errors(&self) -> (f64, f64) {
        let n = self.held.len().max(1) as f64;
        let code = self.held.iter().map(|i| i.code_error_chips).sum::<f64>();
        let frequency = self.held.iter().map(|i| i.frequency_error_hz).sum::<f64>();
        (code / n, frequency / n)
    }

    pub(super) fn clear(&mut self) {
        self.held.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn ratios_are_those_in_phase_with_prompt() {
        let mut products = TapProducts::default();
        assert_eq!(products.ratios(), None);
        // A strong integration, and a weak one of the other sign whose late sum is a quarter cycle ahead.
        for (early, prompt, late) in [(6.0, 8.0, 4.0), (-1.0, -2.0, 0.0)] {
            products.push(&EarlyPromptLate {
                early: Complex64::new(early, 0.0),
                prompt: Complex64::new(prompt, 0.0),
                late: Complex64::new(late, if late == 0.0 { 2.0 } else { 0.0 }),
            });
        }
        let [early, late] = products.ratios().unwrap();
        assert_abs_diff_eq!(early, 50.0 / 68.0, epsilon = 1e-15);
        assert_abs_diff_eq!(late, 32.0 / 68.0, epsilon = 1e-15);
    }

    #[test]
    fn the_line_has_the_slope_of_the_phase() {
        let mut filter = PreFilter::default();
        for k in 0..10 {
            let middle_s = 3.0 + 0.01 * f64::from(k);
            filter.push(Integration {
                middle_s,
                phase_cycles: 1000.0 + 123.0 * middle_s,
                code_error_chips: 0.1,
                frequency_error_hz: -0.5,
            });
        }
        let line = filter.phase_line().unwrap();
        // Rounding of phases near 1000 over 0.1 s.
        assert_abs_diff_eq!(line.slope_hz, 123.0, epsilon = 1e-9);
        assert_abs_diff_eq!(line.middle_s, 3.045, epsilon = 1e-12);
        let (code, frequency) = filter.mean_errors();
        assert_abs_diff_eq!(code, 0.1, epsilon = 1e-12);
        assert_abs_diff_eq!(frequency, -0.5, epsilon = 1e-12);
        filter.clear();
        assert_eq!(filter.phase_line(), None);
    }
}
