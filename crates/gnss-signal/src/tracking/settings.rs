//! What can be set of a channel, with defaults and reasons.

use super::discriminator::CodeDiscriminator;
use super::loop_filter::{CarrierBandwidth, LoopOrder};
use super::steered::SteeredSettings;
use crate::{SignalError, TapOffsets};

/// Which way the front end maps the spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spectrum {
    /// An approaching satellite appears at a higher frequency.
    Upright,
    /// It appears at a lower one: mixed from above, or I and Q exchanged.
    Inverted,
}

impl Spectrum {
    /// Factor from apparent to physical Doppler.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::Upright => 1.0,
            Self::Inverted => -1.0,
        }
    }
}

/// Settings of scalar tracking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingSettings {
    /// Which way the front end maps the spectrum. Default: upright.
    pub spectrum: Spectrum,
    /// Coherent integration after bit synchronisation, code periods (1, 2, 4, 5, 10 or 20).
    ///
    /// Default 10: two sums in a bit, so that the frequency discriminator never meets a bit edge,
    /// and the carrier loop still takes vehicle dynamics.
    pub integration_periods: u32,
    /// Early to late, chips. Default 0.5: half the noise of one chip, and still wide enough for
    /// the code error that acquisition leaves.
    pub spacing_chips: f64,
    /// Form of the code error. Default: the envelope, which needs no carrier lock.
    pub code_discriminator: CodeDiscriminator,
    /// Order of the carrier loop. Default: third, without error under constant acceleration.
    pub carrier_order: LoopOrder,
    /// Carrier loop before carrier lock. Default 10 Hz of phase and 4 Hz of frequency.
    pub pull_in_bandwidth: CarrierBandwidth,
    /// Carrier loop in carrier lock. Default 10 Hz of phase alone. With frequency alone there is no carrier
    /// lock: the channel is a frequency-locked loop, without bits, whose Doppler is the loop's.
    pub locked_bandwidth: CarrierBandwidth,
    /// Final code loop bandwidth in carrier lock, Hz. Default 0.05: the carrier takes the
    /// dynamics, what is left is ionospheric divergence.
    pub code_locked_hz: f64,
    /// Final code loop bandwidth without carrier lock, Hz. Default 1.
    pub code_unlocked_hz: f64,
    /// A signal below this C/N0 is not believed, dB-Hz. Default 22: below it the bits are lost.
    pub lowest_cn0_dbhz: f64,
    /// Time below that before the signal counts as lost, s. Default 1.
    pub patience_s: f64,
    /// Longest stretch pulled in at once, code periods. Default 1000.
    pub longest_pull_in_periods: u32,
    /// Measurements while navigation steers.
    pub steered: SteeredSettings,
    /// Taps that steady tracking asks for behind early, prompt and late, for others to look at. It does
    /// without them where the samples' grid takes more than three taps itself. Default: none.
    pub further_taps: Option<TapOffsets>,
}

impl Default for TrackingSettings {
    fn default() -> Self {
        Self {
            spectrum: Spectrum::Upright,
            integration_periods: 10,
            spacing_chips: 0.5,
            code_discriminator: CodeDiscriminator::Envelope,
            carrier_order: LoopOrder::Third,
            pull_in_bandwidth: CarrierBandwidth {
                phase_hz: 10.0,
                frequency_hz: 4.0,
            },
            locked_bandwidth: CarrierBandwidth {
                phase_hz: 10.0,
                frequency_hz: 0.0,
            },
            code_locked_hz: 0.05,
            code_unlocked_hz: 1.0,
            lowest_cn0_dbhz: 22.0,
            patience_s: 1.0,
            longest_pull_in_periods: 1000,
            steered: SteeredSettings::default(),
            further_taps: None,
        }
    }
}

impl TrackingSettings {
    /// Whether the channel's own carrier loop ever locks to the phase.
    pub(super) fn tracks_phase(&self) -> bool {
        self.locked_bandwidth.phase_hz > 0.0
    }

    /// These settings, if all are possible.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] naming the first that is not.
    pub fn check(self) -> Result<Self, SignalError> {
        let refuse = |name, value: String, expected| {
            Err(SignalError::Parameter {
                name,
                value,
                expected,
            })
        };
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if ![1, 2, 4, 5, 10, 20].contains(&self.integration_periods) {
            let value = self.integration_periods.to_string();
            return refuse("integration (code periods)", value, "1, 2, 4, 5, 10 or 20");
        }
        let interval = self.steered.interval_periods;
        let least = self.steered.integration_periods(self.integration_periods);
        if ![1, 2, 4, 5, 10, 20].contains(&interval)
            || !interval.is_multiple_of(least.max(1))
            || least == 0
        {
            return refuse(
                "measuring interval under navigation (code periods)",
                interval.to_string(),
                "a part of 20, a multiple of the integration, at least 2 where halves are compared",
            );
        }
        if !(positive(self.spacing_chips) && self.spacing_chips <= 1.0) {
            let value = self.spacing_chips.to_string();
            return refuse("tap spacing (chips)", value, "above 0 and at most 1");
        }
        // A carrier loop may lack one of its two parts.
        let bandwidths = [
            self.pull_in_bandwidth.largest_hz(),
            self.locked_bandwidth.largest_hz(),
            self.code_locked_hz,
            self.code_unlocked_hz,
        ];
        if let Some(bad) = bandwidths.iter().find(|b| !(positive(**b) && **b <= 100.0)) {
            let value = bad.to_string();
            return refuse("loop bandwidth (Hz)", value, "above 0 and at most 100");
        }
        if !(40..=1900).contains(&self.longest_pull_in_periods) {
            let value = self.longest_pull_in_periods.to_string();
            return refuse("longest pull-in (code periods)", value, "40 to 1900");
        }
        Ok(self)
    }
}
