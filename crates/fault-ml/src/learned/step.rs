//! What a learned monitor sees of a channel at one step.

use super::StrengthChange;
use crate::Innovation;

/// One channel at one update of the navigation filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelStep {
    /// Whose, by any number the caller likes; another one starts the monitor anew.
    pub satellite: u32,
    /// What the filter did not expect; without a range rate its deviation is infinite.
    pub innovation: Innovation,
    /// What neither the filter nor the other channels of the epoch expected: without what is common to all.
    pub given_others: Innovation,
    /// C/N0, smoothed, dB-Hz.
    pub cn0_dbhz: f64,
    /// C/N0 by the last integration alone, Hz; noise may take it below zero.
    pub cn0_now_hz: f64,
    /// By how much the C/N0 of the other channels has changed, as [`CommonStrength`](super::CommonStrength) says.
    pub others_change: StrengthChange,
    /// Early and late correlator sums over prompt, in phase with it, since the last step, where there are any.
    pub tap_ratios: Option<[f64; 2]>,
}

#[cfg(test)]
impl ChannelStep {
    /// Innovations of so many deviations (8 m, 0.2 m/s) at 45 dB-Hz.
    pub(crate) fn normal(satellite: u32, code: f64, rate: f64) -> Self {
        let innovation = Innovation {
            code_m: 8.0 * code,
            code_sigma_m: 8.0,
            rate_mps: 0.2 * rate,
            rate_sigma_mps: 0.2,
        };
        Self {
            satellite,
            innovation,
            given_others: innovation,
            cn0_dbhz: 45.0,
            cn0_now_hz: 3e4,
            others_change: StrengthChange::default(),
            tap_ratios: Some([0.75; 2]),
        }
    }
}
