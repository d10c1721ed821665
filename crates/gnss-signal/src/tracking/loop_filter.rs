//! Loop filters: code (DLL) and carrier (PLL of second or third order, FLL-assisted).
//!
//! Coefficients after Kaplan2017, table 8.23 and figure 8.21: natural frequencies from one-sided
//! noise bandwidths, integrators by the rectangle rule, valid for bandwidth times interval up to
//! about 0.3.

/// Order of the phase-locked loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoopOrder {
    /// Follows constant velocity without error.
    Second,
    /// Follows constant acceleration without error.
    Third,
}

/// A carrier loop: a phase-locked loop assisted by a frequency-locked loop of one order less.
///
/// A bandwidth of zero switches its part off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarrierLoop {
    order: LoopOrder,
    frequency_hz: f64,
    rate_hz_s: f64,
}

/// Bandwidths of a [`CarrierLoop`], one-sided, Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarrierBandwidth {
    /// Of the phase-locked loop.
    pub phase_hz: f64,
    /// Of the assisting frequency-locked loop.
    pub frequency_hz: f64,
}

impl CarrierBandwidth {
    /// The wider part, Hz.
    pub(super) const fn largest_hz(self) -> f64 {
        self.phase_hz.max(self.frequency_hz)
    }
}

impl CarrierLoop {
    /// A loop at rest at `frequency_hz`.
    #[must_use]
    pub const fn new(order: LoopOrder, frequency_hz: f64) -> Self {
        Self {
            order,
            frequency_hz,
            rate_hz_s: 0.0,
        }
    }

    /// Takes the errors of an interval of `interval_s` and returns the frequency of the
    /// oscillator, Hz, for the next.
    pub fn update(
        &mut self,
        phase_error_cycles: f64,
        frequency_error_hz: f64,
        bandwidth: CarrierBandwidth,
        interval_s: f64,
    ) -> f64 {
        match self.order {
            LoopOrder::Second => {
                let w = bandwidth.phase_hz / 0.53;
                let wf = bandwidth.frequency_hz / 0.25;
                self.frequency_hz +=
                    interval_s * (w * w * phase_error_cycles + wf * frequency_error_hz);
                self.frequency_hz + 1.414 * w * phase_error_cycles
            }
            LoopOrder::Third => {
                let w = bandwidth.phase_hz / 0.7845;
                let wf = bandwidth.frequency_hz / 0.53;
                self.rate_hz_s +=
                    interval_s * (w.powi(3) * phase_error_cycles + wf * wf * frequency_error_hz);
                let change = 1.1 * w * w * phase_error_cycles + 1.414 * wf * frequency_error_hz;
                self.frequency_hz += interval_s * (self.rate_hz_s + change);
                self.frequency_hz + 2.4 * w * phase_error_cycles
            }
        }
    }

    /// Change of the oscillator's frequency, Hz, for a phase that advanced by a cycle since the previous
    /// interval, with the frequency-locked part alone.
    pub(super) const fn frequency_gain_hz(&self, bandwidth: CarrierBandwidth) -> f64 {
        match self.order {
            LoopOrder::Second => bandwidth.frequency_hz / 0.25,
            LoopOrder::Third => 1.414 * bandwidth.frequency_hz / 0.53,
        }
    }

    /// Frequency held by the integrator, Hz.
    #[must_use]
    pub const fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// Rate of the frequency held by the second integrator of a third-order loop, Hz/s.
    #[must_use]
    pub const fn rate_hz_s(&self) -> f64 {
        self.rate_hz_s
    }
}

/// A carrier-aided code loop: a Kalman filter of code phase and of the rate at which the code
/// slips against its carrier, whose gains never fall below those of a final bandwidth.
///
/// The carrier removes the dynamics. What slips is what carrier and code do not share: the error
/// of a nominal intermediate frequency (300 Hz are 0.2 chips/s), ionospheric divergence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CodeLoop {
    slip_hz: f64,
    /// Variances of phase (chips^2) and slip ((chips/s)^2), and their covariance.
    phase: f64,
    slip: f64,
    both: f64,
    /// Sliding mean of code errors over their deviation.
    surprise: f64,
}

/// Deviation of the slip at first, chips/s (15 Hz of carrier): oscillators mostly share a clock.
const SLIP_SIGMA_HZ: f64 = 0.01;
/// Deviation of the slip once the errors deny that, chips/s (450 Hz of carrier).
const FREE_SLIP_SIGMA_HZ: f64 = 0.3;
/// Code errors over their deviation are averaged over so many intervals ...
const SURPRISE_INTERVALS: f64 = 50.0;
/// ... and deny what is assumed above this mean, five of its deviations.
const SURPRISE: f64 = 0.5;

impl CodeLoop {
    /// A loop whose code phase has a variance of `variance_chips2`.
    #[must_use]
    pub const fn new(variance_chips2: f64) -> Self {
        Self {
            slip_hz: 0.0,
            phase: variance_chips2,
            slip: SLIP_SIGMA_HZ * SLIP_SIGMA_HZ,
            both: 0.0,
            surprise: 0.0,
        }
    }

    /// Takes the code error of an interval, chips, over which the replica slipped at
    /// [`CodeLoop::slip_hz`], and its variance; returns the correction of the code phase, chips.
    pub fn update(
        &mut self,
        error_chips: f64,
        variance_chips2: f64,
        final_bandwidth_hz: f64,
        interval_s: f64,
    ) -> f64 {
        self.phase += interval_s * (2.0 * self.both + interval_s * self.slip);
        self.both += interval_s * self.slip;
        // The floor: a loop of second order, damped by 1, of that one-sided bandwidth
        // (B = 5/8 w, phase gain 2 w T).
        let floor = (3.2 * final_bandwidth_hz * interval_s).min(1.0);
        self.doubt(error_chips / variance_chips2.sqrt(), variance_chips2);
        let total = self.phase + variance_chips2;
        let phase_gain = (self.phase / total).max(floor);
        let slip_gain = (self.both / total).max(floor * floor / 4.0 / interval_s);
        self.reduce(phase_gain, slip_gain, variance_chips2);
        self.slip_hz += slip_gain * error_chips;
        phase_gain * error_chips
    }

    /// Frees the slip where the errors keep to one side.
    fn doubt(&mut self, error: f64, variance: f64) {
        self.surprise += (error - self.surprise) / SURPRISE_INTERVALS;
        if self.surprise.abs() > SURPRISE {
            self.phase += self.surprise * self.surprise * variance;
            self.slip = FREE_SLIP_SIGMA_HZ * FREE_SLIP_SIGMA_HZ;
            self.both = 0.0;
            self.surprise = 0.0;
        }
    }

    /// Covariance after an update with any gain (Joseph's form).
    fn reduce(&mut self, phase_gain: f64, slip_gain: f64, variance: f64) {
        let (p, b, s) = (self.phase, self.both, self.slip);
        let keep = 1.0 - phase_gain;
        self.phase = keep * keep * p + phase_gain * phase_gain * variance;
        self.both = keep * (b - slip_gain * p) + phase_gain * slip_gain * variance;
        self.slip = s - 2.0 * slip_gain * b + slip_gain * slip_gain * (p + variance);
    }

    /// Forgets what it knew to better than `variance_chips2` and the first slip.
    pub const fn widen(&mut self, variance_chips2: f64) {
        *self = Self {
            slip_hz: self.slip_hz,
            ..Self::new(variance_chips2)
        };
    }

    /// Code rate of the signal over the one that belongs to its carrier, chips/s.
    #[must_use]
    pub const fn slip_hz(&self) -> f64 {
        self.slip_hz
    }

    /// Variance of the code phase, chips^2.
    #[must_use]
    pub const fn variance_chips2(&self) -> f64 {
        self.phase
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Runs a loop against a phase of `f` Hz and `rate` Hz/s and returns the last phase error.
    fn settle(order: LoopOrder, f: f64, rate: f64, bandwidth: CarrierBandwidth) -> f64 {
        let dt = 0.01;
        let mut filter = CarrierLoop::new(order, 0.0);
        let (mut replica, mut oscillator, mut error, mut before) = (0.0, 0.0, 0.0, None);
        for k in 0..400 {
            let middle = (f64::from(k) + 0.5) * dt;
            let signal = f * middle + 0.5 * rate * middle * middle;
            error = signal - (replica + oscillator * dt / 2.0);
            let slip = before.map_or(0.0, |b: f64| (error - b) / dt);
            before = Some(error);
            replica += oscillator * dt;
            oscillator = filter.update(error, slip, bandwidth, dt);
        }
        error
    }

    const PLL: CarrierBandwidth = CarrierBandwidth {
        phase_hz: 15.0,
        frequency_hz: 0.0,
    };

    #[test]
    fn second_order_follows_a_constant_frequency() {
        // 4 s are 60 time constants: only rounding is left.
        assert_abs_diff_eq!(
            settle(LoopOrder::Second, 3.0, 0.0, PLL),
            0.0,
            epsilon = 1e-9
        );
        let w: f64 = 15.0 / 0.53;
        let lag = settle(LoopOrder::Second, 0.0, 10.0, PLL);
        // Steady error of a type-2 loop: rate / w^2.
        assert_abs_diff_eq!(lag, 10.0 / (w * w), epsilon = 1e-6);
    }

    #[test]
    fn third_order_follows_a_constant_acceleration() {
        // 4 s are 40 time constants: only rounding is left.
        assert_abs_diff_eq!(
            settle(LoopOrder::Third, 3.0, 50.0, PLL),
            0.0,
            epsilon = 1e-7
        );
    }

    #[test]
    fn frequency_assistance_pulls_in_without_phase() {
        let fll = CarrierBandwidth {
            phase_hz: 0.0,
            frequency_hz: 4.0,
        };
        let dt = 0.01;
        for order in [LoopOrder::Second, LoopOrder::Third] {
            let mut filter = CarrierLoop::new(order, 0.0);
            let mut oscillator = 0.0;
            for _ in 0..400 {
                oscillator = filter.update(0.0, 20.0 - oscillator, fll, dt);
            }
            // 4 s at 4 Hz: e^-30 of 20 Hz.
            assert_abs_diff_eq!(oscillator, 20.0, epsilon = 1e-4);
        }
    }

    #[test]
    fn code_loop_averages_and_says_how_well() {
        // Without slip the phase is a mean: a phase known to 1, measured to 1, is known to 1/2.
        let mut filter = CodeLoop::new(1.0);
        let correction = filter.update(0.3, 1.0, 0.05, 1e-6);
        assert_abs_diff_eq!(correction, 0.15, epsilon = 1e-9);
        assert_abs_diff_eq!(filter.variance_chips2(), 0.5, epsilon = 1e-9);
    }

    #[test]
    fn code_loop_follows_a_slip_without_error() {
        let (mut filter, dt, slip) = (CodeLoop::new(1e-3), 0.01, 0.15);
        let (mut error, mut largest) = (0.0, 0.0f64);
        for _ in 0..20_000 {
            error += (slip - filter.slip_hz()) * dt;
            largest = largest.max(error);
            error -= filter.update(error, 1e-3, 0.05, dt);
        }
        // Noticed at half a deviation of the code error (0.03 chip), and then quickly followed.
        assert!(largest < 0.08, "{largest} chips");
        // 200 s are twenty time constants of the final bandwidth.
        assert_abs_diff_eq!(error, 0.0, epsilon = 1e-6);
    }

    #[test]
    fn the_floor_is_a_loop_of_the_bandwidth_asked_for() {
        let (mut filter, dt, bandwidth) = (CodeLoop::new(1e-3), 0.01, 0.05);
        for _ in 0..100_000 {
            filter.update(0.0, 1e-3, bandwidth, dt);
        }
        // Noise of a loop: 2 * bandwidth * interval * variance; to first order in the gain.
        let expected = 2.0 * bandwidth * dt * 1e-3;
        assert_abs_diff_eq!(
            filter.variance_chips2(),
            expected,
            epsilon = 0.02 * expected
        );
    }
}
