//! What a channel steered by navigation measures: code phase and Doppler, interval by interval.
//!
//! An interval is a data bit or a whole part of one, and has two halves. The code error comes from
//! its coherent sums, the frequency error from the phase between its halves: nothing is shared
//! between intervals, so that errors stay white, and no bit edge falls between the halves, so that
//! the sign of the bit does not matter.

mod alignment;
mod reception;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use num_complex::Complex64;

use super::discriminator::{EarlyPromptLate, FrequencyDiscriminator};
use super::epoch::EpochValues;
use super::presence::Presence;
use alignment::Alignment;
pub use alignment::BitsLate;

pub use reception::Reception;

/// Where navigation puts the oscillators of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steering {
    /// Tick at which all of it holds.
    pub tick: u64,
    /// Code phase, chips, in [0, code length).
    pub code_phase_chips: f64,
    /// Code periods of a data bit that are over; `None` where that is not known.
    pub periods_into_bit: Option<u8>,
    /// Code rate, chips/s.
    pub code_rate_hz: f64,
    /// Doppler, Hz; above zero when approaching (whichever way the spectrum runs).
    pub doppler_hz: f64,
}

/// Which sums a frequency error is formed of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrequencyPairs {
    /// The two halves of an interval, by their angle: bounded, and white from interval to interval.
    Halves,
    /// Each interval and the one before, by equation (6) of Jiang2017: unbounded where the signal
    /// is gone, and successive errors share a sum.
    Successive,
}

impl FrequencyPairs {
    /// Half of what errors by sums of `sums_s` are ambiguous beyond, Hz. Up to there an angle is exact, equation (6) short
    /// by a tenth, the sine that weak signals are measured by, below 23 dB-Hz, by a third.
    fn reach_hz(self, sums_s: f64) -> f64 {
        match self {
            Self::Halves => 1.0 / (4.0 * sums_s),
            Self::Successive => 1.0 / (8.0 * sums_s),
        }
    }
}

/// What a steered channel measures of a signal that is gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Silence {
    /// Nothing, until the signal is back.
    LeftOut,
    /// The noise, as if it were the signal.
    Measured,
}

/// How a steered channel measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteeredSettings {
    /// Length of an interval, code periods (2, 4, 10 or 20; with successive pairs 1, 5 too).
    /// Default 20: a data bit.
    pub interval_periods: u32,
    /// How a frequency error is formed. Default: halves.
    pub pairs: FrequencyPairs,
    /// Whether the carrier phase is tracked where the signal allows, beside navigation's Doppler.
    /// Default: it is.
    pub carrier_phase: bool,
    /// What is measured of a signal that is gone. Default: nothing.
    pub silence: Silence,
}

impl Default for SteeredSettings {
    fn default() -> Self {
        Self {
            interval_periods: 20,
            pairs: FrequencyPairs::Halves,
            carrier_phase: true,
            silence: Silence::LeftOut,
        }
    }
}

impl SteeredSettings {
    /// Integration of a steered channel whose own loops integrate over `own_periods`: no more than a
    /// half where halves are compared.
    pub(super) fn integration_periods(&self, own_periods: u32) -> u32 {
        match self.pairs {
            FrequencyPairs::Halves => own_periods.min(self.interval_periods / 2),
            FrequencyPairs::Successive => own_periods.min(self.interval_periods),
        }
    }
}

/// Integrations over which the Doppler of a locked carrier is a mean: with 10 ms a tenth of a second,
/// short against the changes of a car's acceleration.
const LOCKED_INTEGRATIONS: usize = 10;

/// One integration as an interval takes it.
#[derive(Debug, Clone, Copy)]
pub(super) struct SteeredSums {
    pub(super) taps: EarlyPromptLate,
    /// Variance of a sum under noise alone.
    pub(super) noise_variance: f64,
    /// Code periods summed, and how many lie between the beginning of a bit and them.
    pub(super) periods: i64,
    pub(super) start_period: i64,
    /// Middle, s on the channel's clock, and the oscillator's Doppler cycles there.
    pub(super) middle_s: f64,
    pub(super) cycles: f64,
}

/// Weighted sums of a part of an interval.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    early: Complex64,
    prompt: Complex64,
    late: Complex64,
    noise_variance: f64,
    periods: i64,
    middle_s: f64,
    cycles: f64,
    shifted_chips: f64,
}

impl Part {
    fn add(&mut self, sums: &SteeredSums, shifted_chips: f64) {
        let weight = sums.periods as f64;
        self.early += sums.taps.early;
        self.prompt += sums.taps.prompt;
        self.late += sums.taps.late;
        self.noise_variance += sums.noise_variance;
        self.periods += sums.periods;
        self.middle_s += weight * sums.middle_s;
        self.cycles += weight * sums.cycles;
        self.shifted_chips += weight * shifted_chips;
    }

    fn joined(&self, other: &Self) -> Self {
        Self {
            early: self.early + other.early,
            prompt: self.prompt + other.prompt,
            late: self.late + other.late,
            noise_variance: self.noise_variance + other.noise_variance,
            periods: self.periods + other.periods,
            middle_s: self.middle_s + other.middle_s,
            cycles: self.cycles + other.cycles,
            shifted_chips: self.shifted_chips + other.shifted_chips,
        }
    }

    fn mean(&self, total: f64) -> f64 {
        total / self.periods as f64
    }
}

/// What one interval measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// Prompt sum over the interval and its variance under noise alone.
    pub(super) prompt: Complex64,
    pub(super) noise_variance: f64,
    /// Code error against the oscillator as it ran, chips.
    code_error_chips: f64,
    /// Shifts of the oscillator until then, chips.
    shifted_chips: f64,
    /// Frequency error against the oscillator, Hz, and apparent Doppler, Hz; `None` without a pair.
    frequency: Option<Frequency>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Frequency {
    error_hz: f64,
    doppler_hz: f64,
    /// When it holds, s on the channel's clock.
    at_s: f64,
}

/// The interval being summed.
#[derive(Debug, Clone, Copy, Default)]
struct Interval {
    first: Part,
    second: Part,
    previous: Option<Part>,
}

impl Interval {
    /// Adds an integration; returns the two halves of the interval where it is complete.
    fn push(&mut self, sums: &SteeredSums, shifted_chips: f64, length: i64) -> Option<[Part; 2]> {
        let before = sums.start_period.rem_euclid(length);
        let part = if 2 * before < length {
            &mut self.first
        } else {
            &mut self.second
        };
        part.add(sums, shifted_chips);
        if before + sums.periods < length {
            return None;
        }
        let halves = [
            std::mem::take(&mut self.first),
            std::mem::take(&mut self.second),
        ];
        let whole = halves[0].periods + halves[1].periods == length;
        if !whole {
            self.previous = None;
        }
        whole.then_some(halves)
    }
}

/// What a channel keeps while navigation steers it.
#[derive(Debug, Clone)]
pub(super) struct Steered {
    pub(super) presence: Presence,
    shifted_chips: f64,
    interval: Interval,
    /// Since the previous epoch.
    measured: Vec<Measured>,
    /// Tick and Doppler cycles at the end of each of the last integrations in carrier lock.
    locked: VecDeque<(u64, f64)>,
    alignment: Alignment,
}

impl Steered {
    pub(super) fn new(presence: Presence) -> Self {
        Self {
            presence,
            shifted_chips: 0.0,
            interval: Interval::default(),
            measured: Vec::new(),
            locked: VecDeque::new(),
            alignment: Alignment::default(),
        }
    }

    /// An integration ended, in carrier lock or not, with the oscillator at `cycles`.
    pub(super) fn follow_lock(&mut self, locked: bool, tick: u64, cycles: f64) {
        if !locked {
            self.locked.clear();
            return;
        }
        if self.locked.len() > LOCKED_INTEGRATIONS {
            self.locked.pop_front();
        }
        self.locked.push_back((tick, cycles));
    }

    /// Tick and Doppler cycles from which on the carrier has been locked, at most
    /// [`LOCKED_INTEGRATIONS`] ago.
    pub(super) fn locked_since(&self) -> Option<(u64, f64)> {
        self.locked.front().copied()
    }

    /// The code oscillator was shifted.
    pub(super) fn shifted(&mut self, chips: f64) {
        self.shifted_chips += chips;
    }

    /// Bits begin elsewhere from here on.
    pub(super) fn forget_bits(&mut self) {
        self.interval = Interval::default();
        self.alignment = Alignment::default();
    }

    /// Takes an integration; returns what its interval measured where it is complete.
    pub(super) fn push(
        &mut self,
        sums: &SteeredSums,
        settings: &SteeredSettings,
        reception: &Reception,
    ) -> Option<Measured> {
        let length = i64::from(settings.interval_periods);
        let [first, second] = self.interval.push(sums, self.shifted_chips, length)?;
        let whole = first.joined(&second);
        let pair = match settings.pairs {
            FrequencyPairs::Halves => Some((first, second)),
            FrequencyPairs::Successive => self.interval.previous.map(|before| (before, whole)),
        };
        self.interval.previous = Some(whole);
        let measured = Measured {
            prompt: whole.prompt,
            noise_variance: whole.noise_variance,
            code_error_chips: code_error_chips(&whole, reception),
            shifted_chips: whole.mean(whole.shifted_chips),
            frequency: pair.map(|(a, b)| frequency(&a, &b, settings.pairs, reception)),
        };
        if self.presence.is_present() {
            self.alignment.observe(first.prompt, second.prompt);
        } else {
            self.alignment.interrupt();
        }
        // The interval in which a signal returns is only partly its own.
        if self.presence.is_present() || settings.silence == Silence::Measured {
            self.measured.push(measured);
        }
        Some(measured)
    }

    /// The measurements since the previous epoch as one; `None` where there are none.
    pub(super) fn values(
        &self,
        settings: &SteeredSettings,
        reception: &Reception,
    ) -> Option<EpochValues> {
        let n = self.measured.len() as f64;
        let mean =
            |value: &dyn Fn(&Measured) -> f64| self.measured.iter().map(value).sum::<f64>() / n;
        let frequencies = || self.measured.iter().filter_map(|m| m.frequency);
        let pairs = frequencies().count() as f64;
        let interval_s = f64::from(settings.interval_periods) * reception.period_s;
        let sums_s = match settings.pairs {
            FrequencyPairs::Halves => interval_s / 2.0,
            FrequencyPairs::Successive => interval_s,
        };
        (n > 0.0).then(|| EpochValues {
            code_shift_chips: mean(&|m| m.code_error_chips + m.shifted_chips) - self.shifted_chips,
            code_error_chips: mean(&|m| m.code_error_chips),
            code_variance_chips2: reception.code_variance_chips2(interval_s) / n,
            frequency_error_hz: frequencies().map(|f| f.error_hz).sum::<f64>() / pairs.max(1.0),
            doppler_hz: frequencies().map(|f| f.doppler_hz).sum::<f64>() / pairs.max(1.0),
            doppler_variance_hz2: reception.frequency_variance_hz2(sums_s) / pairs,
            reach_hz: if pairs > 0.0 {
                settings.pairs.reach_hz(sums_s)
            } else {
                f64::INFINITY
            },
            doppler_at_s: (pairs > 0.0).then(|| frequencies().map(|f| f.at_s).sum::<f64>() / pairs),
        })
    }

    /// How late data bits of `bit_periods` begin; `None` where that is not known or intervals are shorter.
    pub(super) fn bits_late(
        &self,
        settings: &SteeredSettings,
        bit_periods: u32,
    ) -> Option<BitsLate> {
        let whole = settings.interval_periods == bit_periods;
        whole.then(|| self.alignment.bits_late(f64::from(bit_periods) / 2.0))?
    }

    /// A new epoch begins.
    pub(super) fn clear(&mut self) {
        self.measured.clear();
    }
}

/// Code error of coherent sums.
fn code_error_chips(sums: &Part, reception: &Reception) -> f64 {
    let taps = EarlyPromptLate {
        early: sums.early,
        prompt: sums.prompt,
        late: sums.late,
    };
    let sums_s = sums.periods as f64 * reception.period_s;
    reception.code_error_chips(&taps, sums.noise_variance, sums_s)
}

fn frequency(a: &Part, b: &Part, pairs: FrequencyPairs, reception: &Reception) -> Frequency {
    let apart_s = b.mean(b.middle_s) - a.mean(a.middle_s);
    let oscillator_hz = (b.mean(b.cycles) - a.mean(a.cycles)) / apart_s;
    let error_hz = match pairs {
        FrequencyPairs::Successive => {
            FrequencyDiscriminator::CrossSignDot.error_hz(a.prompt, b.prompt, apart_s)
        }
        FrequencyPairs::Halves => {
            let sums_s = a.periods as f64 * reception.period_s;
            let noise_variance = (a.noise_variance + b.noise_variance) / 2.0;
            reception.frequency_error_hz([a.prompt, b.prompt], noise_variance, sums_s, apart_s)
        }
    };
    Frequency {
        error_hz,
        doppler_hz: oscillator_hz + error_hz,
        at_s: (a.mean(a.middle_s) + b.mean(b.middle_s)) / 2.0,
    }
}
