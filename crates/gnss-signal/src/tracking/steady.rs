//! Steady tracking of a signal whose bit boundaries are known: loops, lock, bits, pre-filter.
//!
//! The code oscillator follows the channel's own loop, or navigation. The carrier loop is the channel's
//! own either way; under navigation it starts from navigation's Doppler and is held to it.

use num_complex::Complex64;

use super::bit_sum::BitSum;
use super::cn0;
use super::discriminator::{EarlyPromptLate, FrequencyDiscriminator, PhaseDiscriminator};
use super::epoch::{ChannelEpoch, EpochValues, Integration, PreFilter, TapProducts};
use super::fade::{self, Fade};
use super::lock::LockDetector;
use super::loop_filter::{CarrierBandwidth, CarrierLoop, CodeLoop};
use super::nco::Nco;
use super::phase_slope::PhaseSlope;
use super::presence::Presence;
use super::sample_grid::with_taps;
use super::steered::{BitsLate, Reception, Silence, Steered, SteeredSums, Steering};
use super::{Lock, NavBit, TrackingSettings};
use crate::Replica;

/// Time constant of the smoothed C/N0, s.
const CN0_TIME_S: f64 = 1.0;

/// Deviation of the code phase when carrier lock is lost, chips.
const UNLOCKED_SIGMA_CHIPS: f64 = 0.05;

/// C/N0 from which a steered channel tracks the carrier phase, Hz (25 dB-Hz): a loop of 10 Hz slips
/// below it.
const PHASE_CN0_HZ: f64 = 316.0;
/// A carrier loop this far from navigation's Doppler follows something else, Hz: it locks falsely at
/// multiples of half the rate of integrations, and 1 g gives 1 Hz between two steerings.
const FALSE_LOCK_HZ: f64 = 10.0;

/// Who steers the code oscillator.
#[derive(Debug, Clone)]
enum Helm {
    Own(CodeLoop),
    Navigation(Box<Steered>),
}

/// A signal whose bit boundaries are known.
#[derive(Debug, Clone)]
pub(super) struct Steady {
    pub(super) nco: Nco,
    settings: TrackingSettings,
    carrier: CarrierLoop,
    helm: Helm,
    detector: LockDetector,
    lock: Lock,
    cn0_hz: f64,
    cn0_now_hz: f64,
    tap_products: TapProducts,
    previous_prompt: Option<Complex64>,
    bit: BitSum,
    pre_filter: PreFilter,
    slope: PhaseSlope,
    prompt: Complex64,
    slipped: bool,
    fade: Fade,
}

impl Steady {
    /// Tracking from `nco`, on a signal of `cn0_hz` whose code phase has that variance.
    pub(super) fn new(
        nco: Nco,
        settings: TrackingSettings,
        cn0_hz: f64,
        code_variance_chips2: f64,
    ) -> Self {
        let bit_periods = bit_periods(&nco);
        Self {
            nco,
            settings,
            carrier: CarrierLoop::new(settings.carrier_order, nco.doppler_hz),
            helm: Helm::Own(CodeLoop::new(code_variance_chips2)),
            detector: LockDetector::new(false),
            lock: Lock::Code,
            cn0_hz,
            cn0_now_hz: cn0_hz,
            tap_products: TapProducts::default(),
            previous_prompt: None,
            bit: BitSum::new(nco.nearest_period(), bit_periods),
            pre_filter: PreFilter::default(),
            slope: PhaseSlope::default(),
            prompt: Complex64::default(),
            slipped: true,
            fade: Fade::default(),
        }
    }

    /// Tracking of a signal that navigation predicts, to be steered from here on.
    pub(super) fn predicted(mut nco: Nco, settings: TrackingSettings) -> Self {
        // Periods are never counted below zero.
        nco.code_period += bit_periods(&nco);
        Self {
            helm: Helm::Navigation(Box::new(Steered::new(Presence::absent()))),
            lock: Lock::Lost,
            ..Self::new(nco, settings, 0.0, 1.0)
        }
    }

    pub(super) const fn lock(&self) -> Lock {
        self.lock
    }

    pub(super) fn cn0_dbhz(&self) -> f64 {
        cn0::dbhz(self.cn0_hz)
    }

    pub(super) const fn is_steered(&self) -> bool {
        matches!(self.helm, Helm::Navigation(_))
    }

    /// How late data bits begin in a steered channel's intervals.
    pub(super) fn bits_late(&self) -> Option<BitsLate> {
        let Helm::Navigation(steered) = &self.helm else {
            return None;
        };
        let bit_periods = self.nco.signal.spec().code_periods_per_bit;
        steered.bits_late(&self.settings.steered, bit_periods)
    }

    /// Puts the oscillators where navigation says, from the next integration on.
    pub(super) fn steer(&mut self, steering: &Steering) {
        let apparent_hz = self.nco.spectrum.sign() * steering.doppler_hz;
        let astray = (self.nco.doppler_hz - apparent_hz).abs() > FALSE_LOCK_HZ;
        if self.lock != Lock::Carrier || astray {
            self.carrier = CarrierLoop::new(self.settings.carrier_order, apparent_hz);
            self.nco.doppler_hz = apparent_hz;
        }
        if astray {
            self.detector.unlock();
        }
        let shift = self.nco.steer_code(steering);
        self.steer_bits(steering);
        if let Helm::Own(_) = self.helm {
            let presence = Presence::known(self.cn0_hz);
            self.helm = Helm::Navigation(Box::new(Steered::new(presence)));
            self.pre_filter.clear();
            self.fade = Fade::default();
        }
        if let Helm::Navigation(steered) = &mut self.helm {
            steered.shifted(shift);
        }
    }

    /// Takes bits to begin where navigation says.
    fn steer_bits(&mut self, steering: &Steering) {
        let Some(first) = self.nco.first_period_of_bit(steering) else {
            return;
        };
        if first != self.bit.edge() {
            self.bit = BitSum::new(first, bit_periods(&self.nco));
            if let Helm::Navigation(steered) = &mut self.helm {
                steered.forget_bits();
            }
        }
    }

    /// Gives the oscillators back to the channel's own loops, the code known to `variance_chips2`.
    pub(super) fn release(&mut self, variance_chips2: f64) {
        if self.is_steered() {
            self.helm = Helm::Own(CodeLoop::new(variance_chips2));
            self.nco.code_slip_hz = 0.0;
            // What the own loops saw last may be minutes old.
            self.previous_prompt = None;
            self.slope = PhaseSlope::default();
        }
    }

    /// Whether the signal stands well out of the noise of one integration.
    pub(super) fn is_strong(&self) -> bool {
        fade::is_strong(self.cn0_hz, self.interval_s())
    }

    /// The tick at which the signal faded away while others say that it should be strong.
    pub(super) fn faded_since(&self) -> Option<u64> {
        self.fade.since_tick()
    }

    /// Whether a strong signal has given way to noise: once is chance.
    pub(super) const fn is_silent(&self) -> bool {
        self.fade.is_silent()
    }

    /// Next interval: up to a bit boundary or a whole integration after one.
    pub(super) fn replica(&self) -> Replica {
        let length = i64::from(self.integration_periods());
        let now = self.nco.nearest_period();
        let end = now + length - (now - self.bit.edge()).rem_euclid(length);
        let spacing = self.settings.spacing_chips;
        let taps = crate::TapOffsets::early_prompt_late(spacing);
        let replica = self.nco.replica(self.nco.tick_of_period(end), taps);
        let replica = with_taps(replica, spacing, self.nco.front_end.sample_rate_hz);
        let further = self.settings.further_taps.as_ref();
        let further = further.filter(|_| replica.tap_offsets == taps);
        Replica {
            tap_offsets: further
                .and_then(|f| taps.with(f))
                .unwrap_or(replica.tap_offsets),
            ..replica
        }
    }

    /// Takes the sums of `replica`.
    pub(super) fn update(
        &mut self,
        taps: &EarlyPromptLate,
        noise_variance: f64,
        replica: &Replica,
    ) -> Option<NavBit> {
        let start = self.nco;
        let end_tick = replica.end_tick;
        self.nco.advance_to(end_tick);
        let interval_s = (end_tick - start.tick) as f64 / start.front_end.sample_rate_hz;
        self.watch_power(taps.prompt, noise_variance, interval_s, start.tick);
        self.prompt = taps.prompt / noise_variance.sqrt();
        self.tap_products.push(taps);
        let periods = self.nco.nearest_period() - start.nearest_period();
        let phase_error = PhaseDiscriminator::Costas.error_cycles(taps.prompt);
        let middle_s = (start.tick + end_tick) as f64 / 2.0 / start.front_end.sample_rate_hz;
        let cycles = start.doppler_cycles + start.doppler_hz * interval_s / 2.0;
        if self.is_steered() {
            let sums = SteeredSums {
                taps: *taps,
                noise_variance,
                periods,
                start_period: start.nearest_period() - self.bit.edge(),
                middle_s,
                cycles,
            };
            self.take_steered(&sums);
            self.follow_phase(phase_error, interval_s);
            if let Helm::Navigation(steered) = &mut self.helm {
                let locked = self.lock == Lock::Carrier;
                steered.follow_lock(locked, self.nco.tick, self.nco.doppler_cycles);
            }
        } else {
            let code_error = self
                .settings
                .code_discriminator
                .error_chips(taps, self.settings.spacing_chips);
            let frequency_error = self.frequency_error_hz(taps.prompt, interval_s);
            self.pre_filter.push(Integration {
                middle_s,
                phase_cycles: cycles + phase_error,
                code_error_chips: code_error,
                frequency_error_hz: frequency_error,
            });
            // Noise alone would carry the oscillators away from where the signal may return.
            if !self.fade.holds_noise() {
                self.steer_by_loops(phase_error, frequency_error, code_error, interval_s);
            }
        }
        self.bit
            .add(taps.prompt, periods, self.nco.nearest_period())
    }

    /// Adds the sums of an integration to what the steered channel measures.
    fn take_steered(&mut self, sums: &SteeredSums) {
        let reception = self.reception();
        let settings = self.settings.steered;
        let Helm::Navigation(steered) = &mut self.helm else {
            return;
        };
        if let Some(measured) = steered.push(sums, &settings, &reception) {
            let interval_s = f64::from(settings.interval_periods) * reception.period_s;
            let now =
                cn0::against_noise_floor(measured.prompt, measured.noise_variance, interval_s);
            steered.presence.observe(now, interval_s);
            self.cn0_hz = steered.presence.cn0_hz();
        }
    }

    /// Tracks the carrier phase beside navigation's Doppler, where the signal allows.
    fn follow_phase(&mut self, phase_cycles: f64, interval_s: f64) {
        if self.follows_phase() {
            let bandwidth = CarrierBandwidth {
                frequency_hz: 0.0,
                ..self.settings.locked_bandwidth
            };
            self.nco.doppler_hz = self
                .carrier
                .update(phase_cycles, 0.0, bandwidth, interval_s);
        }
    }

    /// Whether a steered channel tracks the carrier phase.
    fn follows_phase(&self) -> bool {
        self.settings.steered.carrier_phase && self.cn0_hz > PHASE_CN0_HZ
    }

    fn reception(&self) -> Reception {
        Reception {
            cn0_hz: self.cn0_hz,
            spacing_chips: self.settings.spacing_chips,
            period_s: self.nco.signal.spec().code_period_s(),
        }
    }

    fn watch_power(&mut self, prompt: Complex64, noise: f64, interval_s: f64, tick: u64) {
        let now = cn0::against_noise_floor(prompt, noise, interval_s);
        self.cn0_now_hz = now;
        self.watch_fade(now, tick);
        if !self.is_steered() {
            self.cn0_hz += (interval_s / CN0_TIME_S).min(1.0) * (now - self.cn0_hz);
        }
        let limit = cn0::ratio_hz(self.settings.lowest_cn0_dbhz);
        let strong_enough = self.cn0_hz > limit;
        let patience_s = self.settings.patience_s;
        let before = self.lock;
        let seen = self
            .detector
            .update(prompt, strong_enough, interval_s, patience_s);
        self.lock = match &self.helm {
            Helm::Own(_) if seen == Lock::Carrier && !self.settings.tracks_phase() => Lock::Code,
            Helm::Own(_) => seen,
            Helm::Navigation(steered) if !steered.presence.is_present() => Lock::Lost,
            Helm::Navigation(_) if seen == Lock::Carrier && self.follows_phase() => seen,
            Helm::Navigation(_) => Lock::Code,
        };
        self.slipped |= self.lock != Lock::Carrier;
        if before == Lock::Carrier
            && self.lock != Lock::Carrier
            && let Helm::Own(code) = &mut self.helm
        {
            code.widen(UNLOCKED_SIGMA_CHIPS * UNLOCKED_SIGMA_CHIPS);
        }
    }

    fn watch_fade(&mut self, now_hz: f64, tick: u64) {
        let (usual_hz, interval_s) = (self.cn0_hz, self.interval_s());
        if self.is_steered() {
            self.fade.watch(now_hz, usual_hz, interval_s, tick);
        } else {
            self.fade.watch_on(now_hz, usual_hz, interval_s, tick);
        }
        // Without waiting for the smoothed C/N0 to fall.
        if self.fade.shows_it_gone()
            && self.settings.steered.silence == Silence::LeftOut
            && let Helm::Navigation(steered) = &mut self.helm
        {
            steered.presence = Presence::absent();
            self.cn0_hz = 0.0;
        }
    }

    fn frequency_error_hz(&mut self, prompt: Complex64, interval_s: f64) -> f64 {
        let previous = self.previous_prompt.replace(prompt);
        previous.map_or(0.0, |first| {
            FrequencyDiscriminator::Atan.error_hz(first, prompt, interval_s)
        })
    }

    fn steer_by_loops(
        &mut self,
        phase_cycles: f64,
        frequency_hz: f64,
        code_chips: f64,
        interval_s: f64,
    ) {
        let s = &self.settings;
        let (carrier, code_hz) = if self.lock == Lock::Carrier {
            (s.locked_bandwidth, s.code_locked_hz)
        } else if s.tracks_phase() {
            (s.pull_in_bandwidth, s.code_unlocked_hz)
        } else {
            (s.locked_bandwidth, s.code_unlocked_hz)
        };
        self.nco.doppler_hz = self
            .carrier
            .update(phase_cycles, frequency_hz, carrier, interval_s);
        let variance = self.code_error_variance_chips2();
        if let Helm::Own(code) = &mut self.helm {
            let correction = code.update(code_chips, variance, code_hz, interval_s);
            self.nco.code_slip_hz = code.slip_hz();
            self.nco.shift_code(correction);
        }
    }

    /// Combines what has come since the previous epoch into one value at `tick`.
    pub(super) fn epoch(&mut self, tick: u64) -> ChannelEpoch {
        let mut at = self.nco;
        at.advance_to(tick);
        let measured = self.measured(tick);
        at.shift_code(measured.code_shift_chips);
        let sign = at.spectrum.sign();
        let epoch = ChannelEpoch {
            signal: at.signal,
            tick,
            code_period: at.code_period,
            code_phase_chips: at.code_phase_chips,
            periods_into_bit: Some(self.bit.periods_into_bit(at.code_period) as u8),
            code_variance_chips2: measured.code_variance_chips2,
            doppler_hz: sign * measured.doppler_hz,
            doppler_variance_hz2: measured.doppler_variance_hz2,
            doppler_age_s: measured
                .doppler_at_s
                .map_or(0.0, |s| tick as f64 / at.front_end.sample_rate_hz - s),
            doppler_reach: measured.reach(sign),
            doppler_cycles: sign * at.doppler_cycles,
            phase_slipped: std::mem::replace(&mut self.slipped, self.lock != Lock::Carrier),
            cn0_dbhz: cn0::dbhz(self.cn0_hz),
            cn0_now_hz: self.cn0_now_hz,
            tap_ratios: std::mem::take(&mut self.tap_products).ratios(),
            lock: self.lock,
            prompt: self.prompt,
            code_error_chips: measured.code_error_chips,
            frequency_error_hz: measured.frequency_error_hz,
        };
        self.pre_filter.clear();
        if let Helm::Navigation(steered) = &mut self.helm {
            steered.clear();
        }
        epoch
    }

    /// What the integrations since the previous epoch say of `tick`.
    fn measured(&mut self, tick: u64) -> EpochValues {
        match &self.helm {
            Helm::Own(code) => {
                let code_variance_chips2 = code.variance_chips2();
                let (code_error_chips, frequency_error_hz) = self.pre_filter.mean_errors();
                let (doppler_hz, doppler_variance_hz2) = self.doppler(tick, frequency_error_hz);
                EpochValues {
                    // The oscillator itself has smoothed the errors.
                    code_shift_chips: 0.0,
                    code_error_chips,
                    code_variance_chips2,
                    frequency_error_hz,
                    doppler_hz,
                    doppler_variance_hz2,
                    doppler_at_s: None,
                    reach_hz: f64::INFINITY,
                }
            }
            Helm::Navigation(steered) => {
                let silent = self.fade.since_tick().is_some()
                    && self.settings.steered.silence == Silence::LeftOut;
                let values = steered.values(&self.settings.steered, &self.reception());
                let values = values
                    .filter(|_| !silent)
                    .unwrap_or(EpochValues::nothing(self.nco.doppler_hz));
                let locked = self.oscillator_doppler(steered, tick);
                match locked.filter(|_| self.lock == Lock::Carrier && !silent) {
                    None => values,
                    Some((doppler_hz, doppler_variance_hz2)) => EpochValues {
                        doppler_hz,
                        doppler_variance_hz2,
                        doppler_at_s: None,
                        reach_hz: f64::INFINITY,
                        ..values
                    },
                }
            }
        }
    }

    /// Doppler of a locked carrier oscillator at `tick`, Hz, and its variance, Hz^2; `None` just after
    /// lock.
    ///
    /// The mean over the last tenth of a second, carried on by the loop's acceleration. Its noise is
    /// the jitter of the oscillator's phase at both ends (2 B T of the phase noise each); the
    /// acceleration, which follows the last phases, adds as much again.
    fn oscillator_doppler(&self, steered: &Steered, tick: u64) -> Option<(f64, f64)> {
        let rate_hz = self.nco.front_end.sample_rate_hz;
        let (since_tick, since_cycles) = steered.locked_since()?;
        let span_s = (self.nco.tick - since_tick) as f64 / rate_hz;
        let interval_s = self.interval_s();
        if span_s < 1.5 * interval_s {
            return None;
        }
        let mean_hz = (self.nco.doppler_cycles - since_cycles) / span_s;
        let ahead_s = tick.saturating_sub(self.nco.tick) as f64 / rate_hz + span_s / 2.0;
        let phase = costas_variance_cycles2(self.snr(interval_s));
        let jitter = 2.0 * self.settings.locked_bandwidth.phase_hz * interval_s * phase;
        let doppler_hz = mean_hz + self.carrier.rate_hz_s() * ahead_s;
        Some((doppler_hz, 4.0 * jitter / (span_s * span_s)))
    }

    /// Doppler at `tick`, Hz, and its variance, Hz^2: the slope of the phase where it is locked.
    fn doppler(&mut self, tick: u64, frequency_error_hz: f64) -> (f64, f64) {
        let interval_s = self.interval_s();
        let snr = self.snr(interval_s);
        let line = self
            .pre_filter
            .phase_line()
            .filter(|_| self.lock == Lock::Carrier);
        let Some(line) = line else {
            self.slope = PhaseSlope::default();
            let pair = (1.0 + 1.0 / snr) / snr / (std::f64::consts::TAU * interval_s).powi(2);
            if !self.settings.tracks_phase() {
                // Successive frequency errors are differences of phases and cancel but for the last phase,
                // which the oscillator has by the loop's gain.
                let gain_hz = self
                    .carrier
                    .frequency_gain_hz(self.settings.locked_bandwidth);
                let variance = gain_hz * gain_hz * costas_variance_cycles2(snr);
                return (self.nco.doppler_hz, variance);
            }
            return (self.nco.doppler_hz + frequency_error_hz, pair);
        };
        let time_s = tick as f64 / self.nco.front_end.sample_rate_hz;
        let variance = costas_variance_cycles2(snr) / line.spread_s2;
        (self.slope.doppler_hz(line, time_s), variance)
    }

    fn interval_s(&self) -> f64 {
        f64::from(self.integration_periods()) * self.nco.signal.spec().code_period_s()
    }

    fn integration_periods(&self) -> u32 {
        let own = self.settings.integration_periods;
        if self.is_steered() {
            self.settings.steered.integration_periods(own)
        } else {
            own
        }
    }

    fn snr(&self, interval_s: f64) -> f64 {
        let lowest = cn0::ratio_hz(self.settings.lowest_cn0_dbhz);
        self.cn0_hz.max(lowest) * interval_s
    }

    /// Variance of one code error (Kaplan2017, 8.95), chips^2.
    fn code_error_variance_chips2(&self) -> f64 {
        let spacing = self.settings.spacing_chips;
        let snr = self.snr(self.interval_s());
        spacing / (4.0 * snr) * (1.0 + 2.0 / ((2.0 - spacing) * snr))
    }
}

/// Variance of the phase of one integration (Kaplan2017, 8.80), cycles^2.
fn costas_variance_cycles2(snr: f64) -> f64 {
    (1.0 + 0.5 / snr) / (2.0 * snr) / std::f64::consts::TAU.powi(2)
}

fn bit_periods(nco: &Nco) -> i64 {
    i64::from(nco.signal.spec().code_periods_per_bit)
}
