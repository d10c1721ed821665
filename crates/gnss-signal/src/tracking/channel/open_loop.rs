//! A channel before its bit boundaries are known: period by period along oscillators that no loop moves.
//!
//! From a fixed start, or along where navigation steers. The sums that tell the bit boundaries are turned
//! to the carrier of the start either way; what is measured since a steering is that of the sums since.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::super::discriminator::EarlyPromptLate;
use super::super::epoch::ChannelEpoch;
use super::super::nco::Nco;
use super::super::pull_in::{PullInEstimate, Stretch};
use super::super::steady::Steady;
use super::super::steered::Steering;
use super::super::{Lock, TrackingSettings, cn0};
use super::BitSync;
use crate::{Replica, TapOffsets};

/// Fewest periods of a stretch: two whole bits, whose code phases can be compared.
const LEAST_PERIODS: usize = 60;
/// Periods between two looks at the stretch.
const LOOK_PERIODS: usize = 20;
/// Periods that tracking goes back when navigation lets go, at most: two seconds of samples are kept.
const OLDEST_PERIODS: i64 = 1500;
/// Periods before the power of a stretch is judged.
const JUDGE_PERIODS: usize = 400;

/// Open-loop correlation.
#[derive(Debug, Clone)]
pub(super) struct PullIn {
    start: Nco,
    pub(super) nco: Nco,
    /// Since the start, turned to the carrier that went on from there.
    stretch: Stretch,
    guided: Option<Guided>,
    /// What the stretch said when the bit boundaries were found while navigation steered.
    found: Option<PullInEstimate>,
}

/// What navigation has steered since a tick.
#[derive(Debug, Clone)]
struct Guided {
    since_tick: u64,
    /// Against the oscillators as they ran.
    sums: Stretch,
}

/// What became of a pull-in.
pub(super) enum Outlook {
    /// It goes on.
    Goes,
    /// There is no signal.
    Lost,
    /// The bit boundaries are known, but navigation goes on steering.
    Synced(BitSync),
    /// The bit boundaries are known.
    Found(Box<Steady>, BitSync),
}

impl PullIn {
    /// Begins at `start`, the beginning of a code period.
    pub(super) fn new(start: Nco) -> Self {
        Self {
            start,
            nco: start,
            stretch: Stretch::default(),
            guided: None,
            found: None,
        }
    }

    pub(super) const fn is_steered(&self) -> bool {
        self.guided.is_some()
    }

    /// Puts the oscillators where navigation says, from the next period on.
    pub(super) fn steer(&mut self, steering: &Steering) {
        self.nco.doppler_hz = self.nco.spectrum.sign() * steering.doppler_hz;
        self.nco.steer_code(steering);
        self.guided = Some(Guided {
            since_tick: self.nco.tick,
            sums: Stretch::default(),
        });
    }

    /// Navigation no longer steers: tracking begins with the first whole bit where the boundaries are known,
    /// the code to `code_variance_chips2`; else a new stretch begins here.
    pub(super) fn release(
        &mut self,
        settings: TrackingSettings,
        code_variance_chips2: f64,
    ) -> Option<Steady> {
        self.guided.take()?;
        let Some((found, edge)) = self.found.take().and_then(|f| Some((f, f.bit_edge?))) else {
            self.nco.code_slip_hz = 0.0;
            self.begin_at(self.nco);
            return None;
        };
        let start = self.steered_start(&found);
        let nco = self.at_first_bit(start, self.recent(edge));
        Some(Steady::new(
            nco,
            settings,
            found.cn0_hz,
            code_variance_chips2,
        ))
    }

    /// The boundary of bits at `edge` periods from the start, or a later one that is not too old.
    fn recent(&self, edge: u32) -> u32 {
        let since = self.nco.nearest_period() - self.start.nearest_period();
        let oldest = u32::try_from(since - OLDEST_PERIODS).unwrap_or(0);
        let bit = self.start.signal.spec().code_periods_per_bit;
        edge + oldest.saturating_sub(edge).div_ceil(bit) * bit
    }

    /// The next period.
    pub(super) fn replica(&self, settings: &TrackingSettings) -> Replica {
        let taps = TapOffsets::early_prompt_late(settings.spacing_chips);
        let end = self.nco.tick_of_period(self.nco.nearest_period() + 1);
        self.nco.replica(end, taps)
    }

    /// Takes the sums of a period that ends at `end_tick`.
    pub(super) fn push(&mut self, sums: EarlyPromptLate, noise_variance: f64, end_tick: u64) {
        let before = self.nco;
        self.nco.advance_to(end_tick);
        let Some(guided) = &mut self.guided else {
            return self.stretch.push(sums, noise_variance);
        };
        guided.sums.push(sums, noise_variance);
        let middle = (before.doppler_cycles + self.nco.doppler_cycles) / 2.0;
        let middle_tick = (before.tick + end_tick) as f64 / 2.0;
        let since_s = (middle_tick - self.start.tick as f64) / before.front_end.sample_rate_hz;
        let ahead = middle - self.start.doppler_cycles - self.start.doppler_hz * since_s;
        let turned = sums.turned(Complex64::cis(TAU * ahead));
        self.stretch.push(turned, noise_variance);
    }

    /// Looks at the stretch now and then: moves on where it allows, or gives the signal up.
    pub(super) fn look(&mut self, settings: &TrackingSettings) -> Outlook {
        let periods = self.stretch.len();
        let too_early = periods < LEAST_PERIODS || !periods.is_multiple_of(LOOK_PERIODS);
        if too_early || self.found.is_some() {
            return Outlook::Goes;
        }
        let lowest = cn0::ratio_hz(settings.lowest_cn0_dbhz);
        let Some(found) = self.estimate(settings).filter(|f| f.cn0_hz > lowest) else {
            return if periods < JUDGE_PERIODS {
                Outlook::Goes
            } else {
                Outlook::Lost
            };
        };
        if let Some(edge) = found.bit_edge {
            let sync = self.bit_sync(&found, settings.spacing_chips);
            if self.is_steered() {
                self.found = Some(found);
                return Outlook::Synced(sync);
            }
            return Outlook::Found(Box::new(self.steady(&found, edge, *settings)), sync);
        }
        if periods >= settings.longest_pull_in_periods as usize {
            self.restart(&found);
        }
        Outlook::Goes
    }

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
        let mut nco = self.corrected_carrier(found);
        let slip_hz = nco.code_rate_hz() - self.start.code_rate_hz();
        let half_s = self.stretch.len() as f64 / 2.0 * self.period_s();
        nco.shift_code(found.code_offset_chips - slip_hz * half_s);
        nco
    }

    /// The oscillators at the start, from where navigation has the code now.
    fn steered_start(&self, found: &PullInEstimate) -> Nco {
        let mut nco = self.corrected_carrier(found);
        let mut now = nco;
        now.advance_to(self.nco.tick);
        let periods = (self.nco.code_period - now.code_period) as f64;
        let ahead = self.nco.code_phase_chips - now.code_phase_chips;
        nco.shift_code(periods * self.nco.code_length_chips() + ahead);
        nco
    }

    /// The oscillators at the start with the carrier of the estimate.
    fn corrected_carrier(&self, found: &PullInEstimate) -> Nco {
        let mut nco = self.start;
        nco.doppler_hz += found.doppler_offset_hz;
        let to_start = found.doppler_offset_hz * self.period_s() / 2.0;
        nco.carrier_phase_cycles =
            (nco.carrier_phase_cycles + found.phase_offset_cycles - to_start).rem_euclid(1.0);
        nco
    }

    /// Tracking from the first whole bit on.
    fn steady(&self, found: &PullInEstimate, edge: u32, settings: TrackingSettings) -> Steady {
        let nco = self.at_first_bit(self.corrected_start(found), edge);
        let length_s = self.stretch.len() as f64 * self.period_s();
        let variance = code_variance_chips2(found.cn0_hz, length_s, settings.spacing_chips);
        Steady::new(nco, settings, found.cn0_hz, variance)
    }

    /// `nco`, which stands at the start, at the first bit: `edge` periods later.
    fn at_first_bit(&self, mut nco: Nco, edge: u32) -> Nco {
        let edge = self.start.nearest_period() + i64::from(edge);
        if edge > nco.nearest_period() {
            nco.advance_to(nco.tick_of_period(edge));
        }
        nco.doppler_cycles = 0.0;
        nco
    }

    fn bit_sync(&self, found: &PullInEstimate, spacing_chips: f64) -> BitSync {
        let doppler_hz = self.start.doppler_hz + found.doppler_offset_hz;
        if self.is_steered() {
            // Steering takes the slip out.
            return BitSync {
                doppler_hz,
                code_slip_hz: 0.0,
                code_slip_variance_hz2: f64::INFINITY,
            };
        }
        let spec = self.start.signal.spec();
        let bit_s = f64::from(spec.code_periods_per_bit) * self.period_s();
        let first_bits = found.drift_bits / 2;
        let second_bits = found.drift_bits - first_bits;
        // The halves' middles lie half of those bits apart.
        let apart_s = found.drift_bits as f64 * bit_s / 2.0;
        let variance =
            |bits: usize| code_variance_chips2(found.cn0_hz, bits as f64 * bit_s, spacing_chips);
        let fitted_hz = self.start.spectrum.sign() * found.doppler_offset_hz;
        BitSync {
            doppler_hz,
            code_slip_hz: found.code_drift_chips / apart_s
                - fitted_hz * spec.code_rate_hz / spec.carrier_hz,
            // Infinite without a bit in either half.
            code_slip_variance_hz2: (variance(first_bits) + variance(second_bits))
                / (apart_s * apart_s),
        }
    }

    /// Begins a new stretch here, at the Doppler and code phase found.
    fn restart(&mut self, found: &PullInEstimate) {
        let mut nco = self.nco;
        if !self.is_steered() {
            nco = self.corrected_start(found);
            nco.advance_to(self.nco.tick);
            nco.advance_to(nco.tick_of_period(nco.nearest_period() + 1));
        }
        self.begin_at(nco);
    }

    fn begin_at(&mut self, start: Nco) {
        self.start = start;
        self.nco = start;
        self.stretch = Stretch::default();
    }

    /// The estimate of the stretch so far, or of what has come since a steering, at `tick`.
    pub(super) fn epoch(&self, tick: u64, settings: &TrackingSettings) -> Option<ChannelEpoch> {
        let found = self.found.or_else(|| self.estimate(settings))?;
        match &self.guided {
            None => {
                let mut nco = self.corrected_start(&found);
                nco.advance_to(tick);
                self.epoch_of(&self.stretch, &found, &found, &nco, settings)
            }
            Some(guided) => {
                let spacing = settings.spacing_chips;
                let recent = guided.sums.estimate(self.period_s(), spacing)?;
                let mut nco = self.nco;
                nco.advance_to(tick);
                nco.shift_code(recent.code_offset_chips);
                nco.doppler_hz += recent.doppler_offset_hz;
                let middle_tick = (guided.since_tick + self.nco.tick) as f64 / 2.0;
                let age_s = (tick as f64 - middle_tick) / nco.front_end.sample_rate_hz;
                let epoch = self.epoch_of(&guided.sums, &recent, &found, &nco, settings)?;
                Some(ChannelEpoch {
                    doppler_age_s: age_s,
                    ..epoch
                })
            }
        }
    }

    /// What `sums` say, with the oscillators at `nco`; the whole stretch says the bits and the C/N0.
    fn epoch_of(
        &self,
        sums: &Stretch,
        recent: &PullInEstimate,
        whole: &PullInEstimate,
        nco: &Nco,
        settings: &TrackingSettings,
    ) -> Option<ChannelEpoch> {
        let cn0_hz = whole.cn0_hz.max(1.0);
        let length_s = sums.len() as f64 * self.period_s();
        let first = self.start.nearest_period();
        let sign = nco.spectrum.sign();
        // The bound of a frequency from a stretch (Rife1974), doubled for the unknown data; a bit edge cuts
        // a short one in two, which in the mean costs a factor of 2.5.
        let data = if self.is_steered() { 2.5 } else { 2.0 };
        let snr = cn0_hz * length_s;
        Some(ChannelEpoch {
            signal: nco.signal,
            tick: nco.tick,
            code_period: nco.code_period,
            code_phase_chips: nco.code_phase_chips,
            periods_into_bit: whole
                .bit_edge
                .map(|edge| (nco.code_period - i64::from(edge) - first).rem_euclid(20) as u8),
            code_variance_chips2: code_variance_chips2(cn0_hz, length_s, settings.spacing_chips),
            doppler_hz: sign * nco.doppler_hz,
            doppler_variance_hz2: data * 6.0 / (TAU * TAU * snr * length_s * length_s),
            doppler_age_s: 0.0,
            doppler_reach: None,
            doppler_cycles: sign * nco.doppler_cycles,
            phase_slipped: true,
            cn0_dbhz: cn0::dbhz(cn0_hz),
            cn0_now_hz: recent.cn0_hz,
            tap_ratios: None,
            lock: Lock::PullIn,
            prompt: sums.last()?.prompt / sums.noise_variance().sqrt(),
            code_error_chips: recent.code_offset_chips,
            frequency_error_hz: recent.doppler_offset_hz,
        })
    }
}

/// Variance of early minus late over a stretch of `length_s`, bit by bit, chips^2.
fn code_variance_chips2(cn0_hz: f64, length_s: f64, spacing_chips: f64) -> f64 {
    let bit_snr = cn0_hz * length_s.min(0.02);
    let squaring = 1.0 + 2.0 / ((2.0 - spacing_chips) * bit_snr);
    spacing_chips / (4.0 * cn0_hz * length_s) * squaring
}
