//! One channel: from an acquisition to bits and epochs, interval by interval.

mod open_loop;
#[cfg(test)]
mod tests;

use super::epoch::ChannelEpoch;
use super::nco::Nco;
use super::sample_grid::{early_prompt_late, with_taps};
use super::steady::Steady;
use super::steered::{BitsLate, Steering};
use super::{Lock, NoiseFloor, TrackingSettings};
use crate::{AcquisitionHit, FrontEnd, Replica, SignalId, Taps};
use open_loop::{Outlook, PullIn};

/// A data bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavBit {
    /// Its sum: the sign is the bit (polarity unresolved), the magnitude the confidence.
    pub soft: f32,
    /// The code period in which it begins, counted since the channel's first.
    pub code_period: u64,
}

/// What one integration brought.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ChannelUpdate {
    /// A complete data bit.
    pub bit: Option<NavBit>,
    /// The bit boundaries were found: tracking restarts at the beginning of the stretch.
    pub bit_sync: Option<BitSync>,
}

/// What a channel knows when it has found the bit boundaries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BitSync {
    /// Apparent Doppler, Hz.
    pub doppler_hz: f64,
    /// Code rate of the signal over the one that belongs to the Doppler, chips/s.
    pub code_slip_hz: f64,
    /// Its variance, (chips/s)^2.
    pub code_slip_variance_hz2: f64,
}

/// Follows one signal with its own loops.
///
/// A channel asks for correlations by [`Channel::replica`] and takes their sums by
/// [`Channel::update`]. It may ask for samples up to two seconds old: once the bit boundaries are
/// found in the pull-in, it goes back to its first sample.
#[derive(Debug, Clone)]
pub struct Channel {
    settings: TrackingSettings,
    sample_rate_hz: f64,
    stage: Stage,
}

#[derive(Debug, Clone)]
enum Stage {
    PullIn(Box<PullIn>),
    Steady(Box<Steady>),
    /// With the last Doppler, Hz.
    Lost(SignalId, f64),
}

impl Channel {
    /// A channel on the signal of `hit`.
    #[must_use]
    pub fn new(hit: &AcquisitionHit, front_end: FrontEnd, settings: TrackingSettings) -> Self {
        let mut start = Nco {
            signal: hit.signal,
            front_end,
            spectrum: settings.spectrum,
            tick: hit.tick,
            code_period: 0,
            code_phase_chips: 0.0,
            carrier_phase_cycles: 0.0,
            doppler_cycles: 0.0,
            doppler_hz: hit.doppler_hz,
            code_slip_hz: 0.0,
        };
        start.shift_code(hit.code_phase_chips);
        if start.code_phase_chips > 0.0 {
            start.advance_to(start.tick_of_period(1));
        }
        start.code_period = 0;
        start.doppler_cycles = 0.0;
        Self {
            settings,
            sample_rate_hz: front_end.sample_rate_hz,
            stage: Stage::PullIn(Box::new(PullIn::new(start))),
        }
    }

    /// A channel on a signal that navigation predicts, steered by it: no acquisition, no pull-in. Where steering
    /// does not say otherwise a data bit begins with the code period.
    #[must_use]
    pub fn predicted(
        signal: SignalId,
        front_end: FrontEnd,
        settings: TrackingSettings,
        steering: &Steering,
    ) -> Self {
        let nco = Nco {
            signal,
            front_end,
            spectrum: settings.spectrum,
            tick: steering.tick,
            code_period: 0,
            code_phase_chips: steering.code_phase_chips,
            carrier_phase_cycles: 0.0,
            doppler_cycles: 0.0,
            doppler_hz: settings.spectrum.sign() * steering.doppler_hz,
            code_slip_hz: 0.0,
        };
        let mut steady = Steady::predicted(nco, settings);
        steady.steer(steering);
        Self {
            settings,
            sample_rate_hz: front_end.sample_rate_hz,
            stage: Stage::Steady(Box::new(steady)),
        }
    }

    /// Lets navigation steer; the channel then measures against its oscillators and no longer
    /// loses its signal. Does nothing before the bit boundaries are known, or once it is lost;
    /// returns whether it does anything.
    pub fn steer(&mut self, steering: &Steering) -> bool {
        let Stage::Steady(steady) = &mut self.stage else {
            return false;
        };
        steady.steer(steering);
        true
    }

    /// As [`Self::steer`], and before the bit boundaries are known too. The channel then measures over
    /// code periods until it is released.
    pub fn steer_early(&mut self, steering: &Steering) -> bool {
        if let Stage::PullIn(pull_in) = &mut self.stage {
            pull_in.steer(steering);
            return true;
        }
        self.steer(steering)
    }

    /// Gives the oscillators back to the channel's own loops, the code phase known to
    /// `code_variance_chips2`.
    pub fn release(&mut self, code_variance_chips2: f64) {
        match &mut self.stage {
            Stage::PullIn(pull_in) => {
                if let Some(steady) = pull_in.release(self.settings, code_variance_chips2) {
                    self.stage = Stage::Steady(Box::new(steady));
                }
            }
            Stage::Steady(steady) => steady.release(code_variance_chips2),
            Stage::Lost(..) => {}
        }
    }

    /// How late data bits begin against where they are taken to; `None` where navigation does not steer over
    /// whole bits, or too few have changed sign.
    #[must_use]
    pub fn bits_late(&self) -> Option<BitsLate> {
        match &self.stage {
            Stage::Steady(steady) => steady.bits_late(),
            _ => None,
        }
    }

    /// Whether navigation steers.
    #[must_use]
    pub fn is_steered(&self) -> bool {
        match &self.stage {
            Stage::PullIn(p) => p.is_steered(),
            Stage::Steady(s) => s.is_steered(),
            Stage::Lost(..) => false,
        }
    }

    /// The signal.
    #[must_use]
    pub fn signal(&self) -> SignalId {
        match &self.stage {
            Stage::PullIn(p) => p.nco.signal,
            Stage::Steady(s) => s.nco.signal,
            Stage::Lost(signal, _) => *signal,
        }
    }

    /// What the channel sees.
    #[must_use]
    pub fn lock(&self) -> Lock {
        match &self.stage {
            Stage::PullIn(_) => Lock::PullIn,
            Stage::Steady(s) => s.lock(),
            Stage::Lost(..) => Lock::Lost,
        }
    }

    /// Apparent Doppler of the replica, Hz; the last one where the signal is lost.
    #[must_use]
    pub fn doppler_hz(&self) -> f64 {
        match &self.stage {
            Stage::PullIn(p) => p.nco.doppler_hz,
            Stage::Steady(s) => s.nco.doppler_hz,
            Stage::Lost(_, doppler_hz) => *doppler_hz,
        }
    }

    /// Smoothed C/N0, dB-Hz, once the bit boundaries are known.
    #[must_use]
    pub fn cn0_dbhz(&self) -> Option<f64> {
        match &self.stage {
            Stage::Steady(s) => Some(s.cn0_dbhz()),
            Stage::PullIn(_) | Stage::Lost(..) => None,
        }
    }

    /// Whether the signal stands well out of the noise of one integration, or did until now.
    #[must_use]
    pub fn is_strong(&self) -> bool {
        match &self.stage {
            Stage::Steady(s) => s.is_strong(),
            Stage::PullIn(_) | Stage::Lost(..) => false,
        }
    }

    /// Since when a signal that should be strong has been missing, if it is.
    #[must_use]
    pub fn faded_since(&self) -> Option<u64> {
        match &self.stage {
            Stage::Steady(s) => s.faded_since(),
            Stage::PullIn(_) | Stage::Lost(..) => None,
        }
    }

    /// Whether a signal that was strong has just given way to noise: lock and C/N0 remember it for a second,
    /// but nothing is measured of it.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        matches!(&self.stage, Stage::Steady(s) if s.is_silent())
    }

    /// The next correlation; `None` once the signal is lost.
    #[must_use]
    pub fn replica(&self) -> Option<Replica> {
        match &self.stage {
            Stage::PullIn(p) => {
                let spacing = self.settings.spacing_chips;
                let replica = p.replica(&self.settings);
                Some(with_taps(replica, spacing, self.sample_rate_hz))
            }
            Stage::Steady(s) => Some(s.replica()),
            Stage::Lost(..) => None,
        }
    }

    /// Takes the sums of the last replica.
    pub fn update(&mut self, replica: &Replica, taps: &Taps, noise: &NoiseFloor) -> ChannelUpdate {
        let (spacing, rate_hz) = (self.settings.spacing_chips, self.sample_rate_hz);
        let Some(sums) = early_prompt_late(taps, replica, spacing, rate_hz) else {
            return ChannelUpdate::default();
        };
        let variance = noise.variance(taps);
        match &mut self.stage {
            Stage::PullIn(p) => {
                p.push(sums, variance, replica.end_tick);
                match p.look(&self.settings) {
                    Outlook::Goes => ChannelUpdate::default(),
                    Outlook::Lost => {
                        self.stage = Stage::Lost(p.nco.signal, p.nco.doppler_hz);
                        ChannelUpdate::default()
                    }
                    Outlook::Synced(sync) => ChannelUpdate {
                        bit: None,
                        bit_sync: Some(sync),
                    },
                    Outlook::Found(steady, sync) => {
                        self.stage = Stage::Steady(steady);
                        ChannelUpdate {
                            bit: None,
                            bit_sync: Some(sync),
                        }
                    }
                }
            }
            Stage::Steady(s) => {
                let bit = s.update(&sums, variance, replica);
                // Navigation steers on where a signal is gone, so that it is there on its return.
                if s.lock() == Lock::Lost && !s.is_steered() {
                    self.stage = Stage::Lost(s.nco.signal, s.nco.doppler_hz);
                }
                ChannelUpdate {
                    bit,
                    bit_sync: None,
                }
            }
            Stage::Lost(..) => ChannelUpdate::default(),
        }
    }

    /// Combines what has come since the previous epoch into one value at `tick`.
    ///
    /// In pull-in that is the estimate of the stretch so far; `None` where there is none, or the
    /// signal is lost.
    pub fn epoch(&mut self, tick: u64) -> Option<ChannelEpoch> {
        match &mut self.stage {
            Stage::PullIn(p) => p.epoch(tick, &self.settings),
            Stage::Steady(s) => Some(s.epoch(tick)),
            Stage::Lost(..) => None,
        }
    }
}
