//! Steady tracking of a signal whose bit boundaries are known: loops, lock, bits, pre-filter.

use num_complex::Complex64;

use super::cn0;
use super::discriminator::{EarlyPromptLate, FrequencyDiscriminator, PhaseDiscriminator};
use super::epoch::{ChannelEpoch, Integration, PhaseLine, PreFilter};
use super::lock::LockDetector;
use super::loop_filter::{CarrierLoop, CodeLoop};
use super::nco::Nco;
use super::sample_grid::with_taps;
use super::{Lock, NavBit, TrackingSettings};
use crate::Replica;

/// Time constant of the smoothed C/N0, s.
const CN0_TIME_S: f64 = 1.0;
/// Weight of a new difference of Dopplers in the acceleration that carries them to the epoch.
const ACCELERATION_GAIN: f64 = 0.2;

/// Ratio of signal to noise in one integration from which a fade is told from noise.
const STRONG_SNR: f64 = 20.0;

/// Deviation of the code phase when carrier lock is lost, chips.
const UNLOCKED_SIGMA_CHIPS: f64 = 0.05;

/// A signal tracked by its own loops.
#[derive(Debug, Clone)]
pub(super) struct Steady {
    pub(super) nco: Nco,
    settings: TrackingSettings,
    /// First period that begins a bit, modulo the periods of a bit.
    bit_edge: i64,
    carrier: CarrierLoop,
    code: CodeLoop,
    detector: LockDetector,
    lock: Lock,
    cn0_hz: f64,
    previous_prompt: Option<Complex64>,
    bit: Bit,
    pre_filter: PreFilter,
    last_line: Option<PhaseLine>,
    acceleration_hz_s: f64,
    prompt: Complex64,
    slipped: bool,
    fade: Fade,
}

/// The bit being summed.
#[derive(Debug, Clone, Copy, Default)]
struct Bit {
    sum: Complex64,
    periods: i64,
}

/// Successive integrations without the power that the C/N0 promises.
#[derive(Debug, Clone, Copy, Default)]
struct Fade {
    since_tick: u64,
    integrations: u32,
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
            bit_edge: nco.nearest_period().rem_euclid(bit_periods),
            carrier: CarrierLoop::new(settings.carrier_order, nco.doppler_hz),
            code: CodeLoop::new(code_variance_chips2),
            detector: LockDetector::new(false),
            lock: Lock::Code,
            cn0_hz,
            previous_prompt: None,
            bit: Bit::default(),
            pre_filter: PreFilter::default(),
            last_line: None,
            acceleration_hz_s: 0.0,
            prompt: Complex64::default(),
            slipped: true,
            fade: Fade::default(),
        }
    }

    pub(super) const fn lock(&self) -> Lock {
        self.lock
    }

    /// Whether the signal stands well out of the noise of one integration.
    pub(super) fn is_strong(&self) -> bool {
        self.cn0_hz * self.interval_s() > STRONG_SNR
    }

    /// The tick at which the signal faded away while others say that it should be strong.
    pub(super) fn faded_since(&self) -> Option<u64> {
        (self.fade.integrations > 0).then_some(self.fade.since_tick)
    }

    /// Next interval: up to a bit boundary or a whole integration after one.
    pub(super) fn replica(&self) -> Replica {
        let length = i64::from(self.settings.integration_periods);
        let now = self.nco.nearest_period();
        let end = now + length - (now - self.bit_edge).rem_euclid(length);
        let spacing = self.settings.spacing_chips;
        let taps = crate::TapOffsets::early_prompt_late(spacing);
        let replica = self.nco.replica(self.nco.tick_of_period(end), taps);
        with_taps(replica, spacing, self.nco.front_end.sample_rate_hz)
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
        let phase_error = PhaseDiscriminator::Costas.error_cycles(taps.prompt);
        let frequency_error = self.frequency_error_hz(taps.prompt, interval_s);
        let code_error = self
            .settings
            .code_discriminator
            .error_chips(taps, self.settings.spacing_chips);
        self.pre_filter.push(Integration {
            middle_s: (start.tick + end_tick) as f64 / 2.0 / start.front_end.sample_rate_hz,
            phase_cycles: start.doppler_cycles + start.doppler_hz * interval_s / 2.0 + phase_error,
            code_error_chips: code_error,
            frequency_error_hz: frequency_error,
        });
        self.steer(phase_error, frequency_error, code_error, interval_s);
        self.sum_bit(taps.prompt)
    }

    fn watch_power(&mut self, prompt: Complex64, noise: f64, interval_s: f64, tick: u64) {
        let now = cn0::against_noise_floor(prompt, noise, interval_s);
        // Where the signal stands well out of the noise, a quarter of its power is no accident.
        let faded = self.is_strong() && now < 0.25 * self.cn0_hz;
        self.fade = match (faded, self.fade.integrations) {
            (false, _) => Fade::default(),
            (true, 0) => Fade {
                since_tick: tick,
                integrations: 1,
            },
            (true, n) => Fade {
                integrations: n + 1,
                ..self.fade
            },
        };
        self.cn0_hz += (interval_s / CN0_TIME_S).min(1.0) * (now - self.cn0_hz);
        let limit = cn0::ratio_hz(self.settings.lowest_cn0_dbhz);
        let strong_enough = self.cn0_hz > limit;
        let patience_s = self.settings.patience_s;
        let before = self.lock;
        self.lock = self
            .detector
            .update(prompt, strong_enough, interval_s, patience_s);
        self.slipped |= self.lock != Lock::Carrier;
        if before == Lock::Carrier && self.lock != Lock::Carrier {
            self.code.widen(UNLOCKED_SIGMA_CHIPS * UNLOCKED_SIGMA_CHIPS);
        }
    }

    fn frequency_error_hz(&mut self, prompt: Complex64, interval_s: f64) -> f64 {
        let previous = self.previous_prompt.replace(prompt);
        previous.map_or(0.0, |first| {
            FrequencyDiscriminator::Atan.error_hz(first, prompt, interval_s)
        })
    }

    fn steer(&mut self, phase_cycles: f64, frequency_hz: f64, code_chips: f64, interval_s: f64) {
        let s = &self.settings;
        let (carrier, code_hz) = if self.lock == Lock::Carrier {
            (s.locked_bandwidth, s.code_locked_hz)
        } else {
            (s.pull_in_bandwidth, s.code_unlocked_hz)
        };
        self.nco.doppler_hz = self
            .carrier
            .update(phase_cycles, frequency_hz, carrier, interval_s);
        let variance = self.code_error_variance_chips2();
        let correction = self.code.update(code_chips, variance, code_hz, interval_s);
        self.nco.code_slip_hz = self.code.slip_hz();
        self.nco.shift_code(correction);
    }

    /// Adds to the bit and returns it where it is complete.
    fn sum_bit(&mut self, prompt: Complex64) -> Option<NavBit> {
        let bit_periods = bit_periods(&self.nco);
        self.bit.sum += prompt;
        self.bit.periods += i64::from(self.settings.integration_periods);
        let now = self.nco.nearest_period();
        if (now - self.bit_edge).rem_euclid(bit_periods) != 0 {
            return None;
        }
        let bit = std::mem::take(&mut self.bit);
        (bit.periods == bit_periods).then(|| NavBit {
            soft: bit.sum.re as f32,
            code_period: (now - bit_periods).unsigned_abs(),
        })
    }

    /// Combines what has come since the previous epoch into one value at `tick`.
    pub(super) fn epoch(&mut self, tick: u64) -> ChannelEpoch {
        let mut at = self.nco;
        at.advance_to(tick);
        let (code_error_chips, frequency_error_hz) = self.pre_filter.mean_errors();
        let (doppler_hz, doppler_variance_hz2) = self.doppler(tick, frequency_error_hz);
        let sign = at.spectrum.sign();
        let epoch = ChannelEpoch {
            signal: at.signal,
            tick,
            code_period: at.code_period,
            code_phase_chips: at.code_phase_chips,
            periods_into_bit: Some(
                (at.code_period - self.bit_edge).rem_euclid(bit_periods(&at)) as u8,
            ),
            code_variance_chips2: self.code.variance_chips2(),
            doppler_hz: sign * doppler_hz,
            doppler_variance_hz2,
            doppler_cycles: sign * at.doppler_cycles,
            phase_slipped: std::mem::replace(&mut self.slipped, self.lock != Lock::Carrier),
            cn0_dbhz: cn0::dbhz(self.cn0_hz),
            lock: self.lock,
            prompt: self.prompt,
            code_error_chips,
            frequency_error_hz,
        };
        self.pre_filter.clear();
        epoch
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
            self.last_line = None;
            self.acceleration_hz_s = 0.0;
            let pair = (1.0 + 1.0 / snr) / snr / (std::f64::consts::TAU * interval_s).powi(2);
            return (self.nco.doppler_hz + frequency_error_hz, pair);
        };
        if let Some(before) = self.last_line.replace(line) {
            let slope = (line.slope_hz - before.slope_hz) / (line.middle_s - before.middle_s);
            self.acceleration_hz_s += ACCELERATION_GAIN * (slope - self.acceleration_hz_s);
        }
        let ahead_s = tick as f64 / self.nco.front_end.sample_rate_hz - line.middle_s;
        // Costas phase variance, cycles^2 (Kaplan2017, 8.80 per integration).
        let phase = (1.0 + 0.5 / snr) / (2.0 * snr) / std::f64::consts::TAU.powi(2);
        let doppler_hz = line.slope_hz + self.acceleration_hz_s * ahead_s;
        (doppler_hz, phase / line.spread_s2)
    }

    fn interval_s(&self) -> f64 {
        f64::from(self.settings.integration_periods) * self.nco.signal.spec().code_period_s()
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

fn bit_periods(nco: &Nco) -> i64 {
    i64::from(nco.signal.spec().code_periods_per_bit)
}
