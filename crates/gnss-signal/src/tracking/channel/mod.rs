//! One channel: from an acquisition to bits and epochs, interval by interval.

#[cfg(test)]
mod tests;

use super::epoch::ChannelEpoch;
use super::nco::Nco;
use super::pull_in::{PullInEstimate, Stretch};
use super::sample_grid::{early_prompt_late, with_taps};
use super::steady::Steady;
use super::steered::{BitsLate, Steering};
use super::{Lock, NoiseFloor, TrackingSettings, cn0};
use crate::{AcquisitionHit, FrontEnd, Replica, SignalId, TapOffsets, Taps};

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

/// Open-loop correlation from a fixed start.
#[derive(Debug, Clone)]
struct PullIn {
    start: Nco,
    nco: Nco,
    stretch: Stretch,
}

/// Fewest periods of a stretch: two whole bits, whose code phases can be compared.
const LEAST_PERIODS: usize = 60;
/// Periods between two looks at the stretch.
const LOOK_PERIODS: usize = 20;
/// Periods before the power of a stretch is judged.
const JUDGE_PERIODS: usize = 400;

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
            stage: Stage::PullIn(Box::new(PullIn {
                start,
                nco: start,
                stretch: Stretch::default(),
            })),
        }
    }

    /// A channel on a signal that navigation predicts, steered by it: no acquisition, no pull-in.
    ///
    /// `periods_into_bit` code periods of a data bit are over at the steering's tick.
    #[must_use]
    pub fn predicted(
        signal: SignalId,
        front_end: FrontEnd,
        settings: TrackingSettings,
        steering: &Steering,
        periods_into_bit: u8,
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
        let mut steady = Steady::predicted(nco, settings, periods_into_bit);
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

    /// Gives the oscillators back to the channel's own loops, the code phase known to
    /// `code_variance_chips2`.
    pub fn release(&mut self, code_variance_chips2: f64) {
        if let Stage::Steady(steady) = &mut self.stage {
            steady.release(code_variance_chips2);
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
        matches!(&self.stage, Stage::Steady(s) if s.is_steered())
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
                let taps = TapOffsets::early_prompt_late(spacing);
                let end = p.nco.tick_of_period(p.nco.nearest_period() + 1);
                let replica = p.nco.replica(end, taps);
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
                p.stretch.push(sums, variance);
                p.nco.advance_to(replica.end_tick);
                self.look_at_stretch()
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

    /// Moves on from pull-in where the stretch allows, or gives the signal up.
    fn look_at_stretch(&mut self) -> ChannelUpdate {
        let Stage::PullIn(p) = &mut self.stage else {
            return ChannelUpdate::default();
        };
        let periods = p.stretch.len();
        if periods < LEAST_PERIODS || periods % LOOK_PERIODS != 0 {
            return ChannelUpdate::default();
        }
        let lowest = cn0::ratio_hz(self.settings.lowest_cn0_dbhz);
        let Some(found) = p.estimate(&self.settings).filter(|f| f.cn0_hz > lowest) else {
            if periods >= JUDGE_PERIODS {
                self.stage = Stage::Lost(p.nco.signal, p.nco.doppler_hz);
            }
            return ChannelUpdate::default();
        };
        if found.bit_edge.is_some() {
            let steady = p.steady(&found, self.settings);
            let sync = p.bit_sync(&found, self.settings.spacing_chips);
            self.stage = Stage::Steady(Box::new(steady));
            return ChannelUpdate {
                bit: None,
                bit_sync: Some(sync),
            };
        }
        if periods >= self.settings.longest_pull_in_periods as usize {
            p.restart(&found);
        }
        ChannelUpdate::default()
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

impl PullIn {
    fn period_s(&self) -> f64 {
        self.start.signal.spec().code_period_s()
    }

    fn estimate(&self, settings: &TrackingSettings) -> Option<PullInEstimate> {
        self.stretch
            .estimate(self.period_s(), settings.spacing_chips)
    }

    /// The oscillators at the start, corrected by the estimate.
    ///
    /// The open-loop replica ran at another code rate: the code offset holds in the middle.
    fn corrected_start(&self, found: &PullInEstimate) -> Nco {
        let mut nco = self.start;
        nco.doppler_hz += found.doppler_offset_hz;
        let slip_hz = nco.code_rate_hz() - self.start.code_rate_hz();
        let half_s = self.stretch.len() as f64 / 2.0 * self.period_s();
        nco.shift_code(found.code_offset_chips - slip_hz * half_s);
        let to_start = found.doppler_offset_hz * self.period_s() / 2.0;
        nco.carrier_phase_cycles =
            (nco.carrier_phase_cycles + found.phase_offset_cycles - to_start).rem_euclid(1.0);
        nco
    }

    fn steady(&self, found: &PullInEstimate, settings: TrackingSettings) -> Steady {
        let mut nco = self.corrected_start(found);
        let edge = self.start.nearest_period() + i64::from(found.bit_edge.unwrap_or(0));
        if edge > nco.nearest_period() {
            nco.advance_to(nco.tick_of_period(edge));
        }
        nco.doppler_cycles = 0.0;
        let length_s = self.stretch.len() as f64 * self.period_s();
        let variance = code_variance_chips2(found.cn0_hz, length_s, settings.spacing_chips);
        Steady::new(nco, settings, found.cn0_hz, variance)
    }

    fn bit_sync(&self, found: &PullInEstimate, spacing_chips: f64) -> BitSync {
        let spec = self.start.signal.spec();
        let bit_s = f64::from(spec.code_periods_per_bit) * self.period_s();
        let first_bits = found.whole_bits / 2;
        let second_bits = found.whole_bits - first_bits;
        // The halves' middles lie half the whole bits apart.
        let apart_s = found.whole_bits as f64 * bit_s / 2.0;
        let variance =
            |bits: usize| code_variance_chips2(found.cn0_hz, bits as f64 * bit_s, spacing_chips);
        let fitted_hz = self.start.spectrum.sign() * found.doppler_offset_hz;
        BitSync {
            doppler_hz: self.start.doppler_hz + found.doppler_offset_hz,
            code_slip_hz: found.code_drift_chips / apart_s
                - fitted_hz * spec.code_rate_hz / spec.carrier_hz,
            // Infinite without a bit in either half.
            code_slip_variance_hz2: (variance(first_bits) + variance(second_bits))
                / (apart_s * apart_s),
        }
    }

    /// Begins a new stretch here, at the Doppler and code phase found.
    fn restart(&mut self, found: &PullInEstimate) {
        let mut nco = self.corrected_start(found);
        nco.advance_to(self.nco.tick);
        nco.advance_to(nco.tick_of_period(nco.nearest_period() + 1));
        self.start = nco;
        self.nco = nco;
        self.stretch = Stretch::default();
    }

    fn epoch(&self, tick: u64, settings: &TrackingSettings) -> Option<ChannelEpoch> {
        let found = self.estimate(settings)?;
        let mut nco = self.corrected_start(&found);
        nco.advance_to(tick);
        let cn0_hz = found.cn0_hz.max(1.0);
        let length_s = self.stretch.len() as f64 * self.period_s();
        let spacing = settings.spacing_chips;
        // The bound of a frequency from a stretch (Rife1974), doubled for the unknown data.
        let snr = cn0_hz * length_s;
        let tau = std::f64::consts::TAU;
        let last = self.stretch.last()?;
        let first = self.start.nearest_period();
        let sign = nco.spectrum.sign();
        Some(ChannelEpoch {
            signal: nco.signal,
            tick,
            code_period: nco.code_period,
            code_phase_chips: nco.code_phase_chips,
            periods_into_bit: found
                .bit_edge
                .map(|edge| (nco.code_period - i64::from(edge) - first).rem_euclid(20) as u8),
            code_variance_chips2: code_variance_chips2(cn0_hz, length_s, spacing),
            doppler_hz: sign * nco.doppler_hz,
            doppler_variance_hz2: 12.0 / (tau * tau * snr * length_s * length_s),
            doppler_age_s: 0.0,
            doppler_cycles: sign * nco.doppler_cycles,
            phase_slipped: true,
            cn0_dbhz: cn0::dbhz(cn0_hz),
            lock: Lock::PullIn,
            prompt: last.prompt / self.stretch.noise_variance().sqrt(),
            code_error_chips: found.code_offset_chips,
            frequency_error_hz: found.doppler_offset_hz,
        })
    }
}

/// Variance of early minus late over a stretch of `length_s`, bit by bit, chips^2.
fn code_variance_chips2(cn0_hz: f64, length_s: f64, spacing_chips: f64) -> f64 {
    let bit_snr = cn0_hz * length_s.min(0.02);
    let squaring = 1.0 + 2.0 / ((2.0 - spacing_chips) * bit_snr);
    spacing_chips / (4.0 * cn0_hz * length_s) * squaring
}
