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

    /// Frequency held by the integrator, Hz.
    #[must_use]
    pub const fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }
}

/// A carrier-aided code loop of first order whose bandwidth narrows with time.
///
/// The carrier removes the dynamics, so the loop only averages noise: its gain follows 1/n (the
/// running mean) until it reaches the gain of the final bandwidth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CodeLoop {
    age_s: f64,
    noise_per_s: f64,
}

impl CodeLoop {
    /// A loop whose code phase is the mean of `age_s` so far.
    #[must_use]
    pub const fn new(age_s: f64) -> Self {
        Self {
            age_s,
            noise_per_s: 1.0 / age_s,
        }
    }

    /// Takes the code error of an interval and returns the correction of the code phase, chips.
    pub fn update(&mut self, error_chips: f64, final_bandwidth_hz: f64, interval_s: f64) -> f64 {
        self.age_s += interval_s;
        // First-order loop: gain = 4 * bandwidth * interval.
        let gain = (4.0 * final_bandwidth_hz * interval_s)
            .max(interval_s / self.age_s)
            .min(1.0);
        self.noise_per_s = (1.0 - gain).powi(2) * self.noise_per_s + gain * gain / interval_s;
        gain * error_chips
    }

    /// Starts to average anew, from a mean of `age_s`.
    pub const fn widen(&mut self, age_s: f64) {
        *self = Self::new(age_s);
    }

    /// Variance of the code phase over the variance of the code error times its interval, 1/s:
    /// 2 * bandwidth once the loop is settled.
    #[must_use]
    pub const fn noise_per_s(&self) -> f64 {
        self.noise_per_s
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
    fn code_loop_is_a_mean_until_its_final_bandwidth() {
        let mut filter = CodeLoop::new(1e-12);
        let mut phase = 0.0;
        let offsets = [0.1, 0.3, -0.2, 0.4];
        for offset in offsets {
            phase += filter.update(offset - phase, 0.05, 0.01);
        }
        // The running mean, and a quarter of the variance; the age begins at a picosecond.
        assert_abs_diff_eq!(phase, 0.15, epsilon = 1e-9);
        assert_abs_diff_eq!(filter.noise_per_s(), 0.25 / 0.01, epsilon = 1e-6);
        for _ in 0..100_000 {
            filter.update(0.0, 0.05, 0.01);
        }
        // Twice the bandwidth, to first order in the gain of 0.002.
        assert_abs_diff_eq!(filter.noise_per_s(), 0.1, epsilon = 2e-4);
    }
}
