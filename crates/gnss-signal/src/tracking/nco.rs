//! The code and carrier oscillators of a channel, on the sample clock.

use super::Spectrum;
use super::steered::Steering;
use crate::{FrontEnd, Replica, SignalId, TapOffsets};

/// State of both oscillators at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nco {
    pub(super) signal: SignalId,
    pub(super) front_end: FrontEnd,
    pub(super) spectrum: Spectrum,
    /// Where the state holds.
    pub(super) tick: u64,
    /// Code periods completed since the channel's first began.
    pub(super) code_period: i64,
    /// Code phase, chips, in [0, code length).
    pub(super) code_phase_chips: f64,
    /// Carrier phase as sampled, cycles, in [0, 1).
    pub(super) carrier_phase_cycles: f64,
    /// Integral of the apparent Doppler since the channel's start, cycles.
    pub(super) doppler_cycles: f64,
    /// Apparent Doppler, Hz.
    pub(super) doppler_hz: f64,
    /// Code rate over the one that belongs to the Doppler, chips/s.
    pub(super) code_slip_hz: f64,
}

impl Nco {
    /// Code rate, chips/s: that of the Doppler, and the slip.
    pub(super) fn code_rate_hz(&self) -> f64 {
        let spec = self.signal.spec();
        let aided_hz =
            spec.code_rate_hz * (1.0 + self.spectrum.sign() * self.doppler_hz / spec.carrier_hz);
        aided_hz + self.code_slip_hz
    }

    /// Chips in a code period.
    pub(super) fn code_length_chips(&self) -> f64 {
        f64::from(self.signal.spec().code_length_chips)
    }

    /// The code period whose beginning is nearest.
    pub(super) fn nearest_period(&self) -> i64 {
        self.code_period + i64::from(self.code_phase_chips > self.code_length_chips() / 2.0)
    }

    /// The first tick at or after the beginning of `code_period`, at least one from here.
    pub(super) fn tick_of_period(&self, code_period: i64) -> u64 {
        let periods = (code_period - self.code_period) as f64;
        let chips = periods * self.code_length_chips() - self.code_phase_chips;
        let samples = (chips / self.code_rate_hz() * self.front_end.sample_rate_hz).ceil();
        self.tick + samples.max(1.0) as u64
    }

    /// A replica from here to `end_tick`.
    pub(super) fn replica(&self, end_tick: u64, tap_offsets: TapOffsets) -> Replica {
        Replica {
            signal: self.signal,
            start_tick: self.tick,
            end_tick,
            code_phase_chips: self.code_phase_chips,
            code_rate_hz: self.code_rate_hz(),
            carrier_phase_cycles: self.carrier_phase_cycles,
            carrier_frequency_hz: self.front_end.intermediate_frequency_hz + self.doppler_hz,
            tap_offsets,
        }
    }

    /// Moves to `tick`, not before the present one.
    pub(super) fn advance_to(&mut self, tick: u64) {
        let elapsed_s = tick.saturating_sub(self.tick) as f64 / self.front_end.sample_rate_hz;
        self.tick = tick;
        self.shift_code(self.code_rate_hz() * elapsed_s);
        self.doppler_cycles += self.doppler_hz * elapsed_s;
        let frequency_hz = self.front_end.intermediate_frequency_hz + self.doppler_hz;
        self.carrier_phase_cycles =
            (self.carrier_phase_cycles + frequency_hz * elapsed_s).rem_euclid(1.0);
    }

    /// Code phase that navigation wants here, chips; it goes on where a period ends.
    fn wanted_chips(&self, steering: &Steering) -> f64 {
        let since_s = (self.tick as f64 - steering.tick as f64) / self.front_end.sample_rate_hz;
        steering.code_phase_chips + steering.code_rate_hz * since_s
    }

    /// Puts the code where navigation says, at its rate whatever the Doppler is; returns the shift, chips.
    pub(super) fn steer_code(&mut self, steering: &Steering) -> f64 {
        self.code_slip_hz = 0.0;
        self.code_slip_hz = steering.code_rate_hz - self.code_rate_hz();
        let wanted = self.wanted_chips(steering);
        let half = self.code_length_chips() / 2.0;
        let error = wanted - self.code_phase_chips;
        let shift = (error + half).rem_euclid(2.0 * half) - half;
        self.shift_code(shift);
        shift
    }

    /// The code period, below those of a bit, with which bits begin where `steering` says so, once the code is
    /// there.
    pub(super) fn first_period_of_bit(&self, steering: &Steering) -> Option<i64> {
        let ahead = self.wanted_chips(steering) - self.code_phase_chips;
        let since = (ahead / self.code_length_chips()).round() as i64;
        let over = i64::from(steering.periods_into_bit?) + since;
        let bit_periods = i64::from(self.signal.spec().code_periods_per_bit);
        Some((self.code_period - over).rem_euclid(bit_periods))
    }

    /// Adds to the code phase; a whole code length is a code period.
    pub(super) fn shift_code(&mut self, chips: f64) {
        let length = self.code_length_chips();
        let phase = self.code_phase_chips + chips;
        let periods = (phase / length).floor();
        self.code_period += periods as i64;
        // The remainder can round up to the length itself.
        self.code_phase_chips = (phase - periods * length).clamp(0.0, length.next_down());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn nco(code_phase_chips: f64, doppler_hz: f64) -> Nco {
        Nco {
            signal: SignalId::gps_l1_ca(7).unwrap(),
            front_end: FrontEnd {
                sample_rate_hz: 4.0e6,
                intermediate_frequency_hz: 1.0e3,
                complex: true,
            },
            spectrum: Spectrum::Upright,
            tick: 100,
            code_period: 0,
            code_phase_chips,
            carrier_phase_cycles: 0.25,
            doppler_cycles: 0.0,
            doppler_hz,
            code_slip_hz: 0.0,
        }
    }

    #[test]
    fn code_periods_end_on_the_next_sample() {
        let mut nco = nco(1000.0, 2_500.0);
        let end = nco.tick_of_period(1);
        nco.advance_to(end);
        assert_eq!(nco.code_period, 1);
        // Within one sample of the boundary.
        assert!(nco.code_phase_chips < 1.023e6 / 4.0e6 * 1.01);
        let twenty = nco.tick_of_period(21);
        nco.advance_to(twenty);
        assert_eq!(nco.code_period, 21);
    }

    #[test]
    fn carrier_follows_intermediate_frequency_and_doppler() {
        let mut nco = nco(0.0, 500.0);
        nco.advance_to(100 + 4_000);
        // 1 ms at 1.5 kHz from a quarter cycle; rounding only.
        assert_abs_diff_eq!(nco.carrier_phase_cycles, 0.75, epsilon = 1e-9);
        assert_abs_diff_eq!(nco.doppler_cycles, 0.5, epsilon = 1e-12);
    }

    #[test]
    fn code_shifts_backwards_across_a_period() {
        let mut nco = nco(0.2, 0.0);
        nco.code_period = 5;
        nco.shift_code(-0.5);
        assert_eq!((nco.code_period, nco.nearest_period()), (4, 5));
        // Rounding only.
        assert_abs_diff_eq!(nco.code_phase_chips, 1022.7, epsilon = 1e-9);
    }
}
