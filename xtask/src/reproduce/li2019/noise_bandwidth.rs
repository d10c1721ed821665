//! One-sided noise bandwidths of estimates of a range rate, by their response to an impulse of it.
//!
//! Of white errors of single intervals an estimate of bandwidth B keeps the part 2 B T, whether a loop, a
//! mean or a navigation filter made it: the measure by which they are made alike here.

use gnss_signal::tracking::loop_filter::{CarrierBandwidth, CarrierLoop, LoopOrder};

/// Intervals after which no response is left (10 s at 10 ms).
const LENGTH: usize = 1000;
/// Interval in which the impulse arrives: means are full by then.
const ARRIVAL: usize = 50;

/// Bandwidth, Hz, of an estimate every `interval_s` that answers to an impulse by `response`: the
/// integral of |H|^2 over positive frequencies, over its value at zero.
#[must_use]
pub fn noise_bandwidth_hz(response: &[f64], interval_s: f64) -> f64 {
    let energy: f64 = response.iter().map(|h| h * h).sum();
    let sum: f64 = response.iter().sum();
    energy / (2.0 * interval_s * sum * sum)
}

/// Scatter, Hz, of an estimate whose response to a phase error of one cycle in one integration is
/// `response`, per cycle of scatter of white phase errors.
#[must_use]
pub fn phase_noise_gain_hz(response: &[f64]) -> f64 {
    response.iter().map(|h| h * h).sum::<f64>().sqrt()
}

/// What arrives in a single integration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Impulse {
    /// A signal 1 Hz higher.
    Frequency,
    /// A phase measured wrong by one cycle, of a linear discriminator.
    PhaseError,
}

/// A carrier loop and its oscillator, integration by integration.
struct Oscillator {
    /// Phase reached, cycles.
    cycles: Vec<f64>,
    /// Frequency for the integration that follows, Hz.
    frequency_hz: Vec<f64>,
    /// Its rate as the loop holds it, Hz/s.
    rate_hz_s: Vec<f64>,
}

fn follow(bandwidth: CarrierBandwidth, interval_s: f64, impulse: Impulse) -> Oscillator {
    let mut carrier = CarrierLoop::new(LoopOrder::Third, 0.0);
    let (mut signal, mut replica, mut oscillator_hz, mut before) = (0.0, 0.0, 0.0, 0.0);
    let mut followed = Oscillator {
        cycles: Vec::with_capacity(LENGTH),
        frequency_hz: Vec::with_capacity(LENGTH),
        rate_hz_s: Vec::with_capacity(LENGTH),
    };
    for k in 0..LENGTH {
        let (signal_hz, wrong) = match impulse {
            Impulse::Frequency if k == ARRIVAL => (1.0, 0.0),
            Impulse::PhaseError if k == ARRIVAL => (0.0, 1.0),
            _ => (0.0, 0.0),
        };
        // Discriminators see the middle of an integration.
        let error = signal - replica + (signal_hz - oscillator_hz) * interval_s / 2.0 + wrong;
        signal += signal_hz * interval_s;
        replica += oscillator_hz * interval_s;
        let slip_hz = (error - before) / interval_s;
        before = error;
        oscillator_hz = carrier.update(error, slip_hz, bandwidth, interval_s);
        followed.cycles.push(replica);
        followed.frequency_hz.push(oscillator_hz);
        followed.rate_hz_s.push(carrier.rate_hz_s());
    }
    followed
}

/// Response of the oscillator of a frequency-locked loop set to `setting_hz`, Hz.
#[must_use]
pub fn frequency_loop_response(setting_hz: f64, interval_s: f64, impulse: Impulse) -> Vec<f64> {
    let bandwidth = CarrierBandwidth {
        phase_hz: 0.0,
        frequency_hz: setting_hz,
    };
    follow(bandwidth, interval_s, impulse).frequency_hz
}

/// Bandwidth, Hz, of that loop: somewhat above its setting, because the loop's coefficients are those of
/// continuous time.
#[must_use]
pub fn frequency_loop_hz(setting_hz: f64, interval_s: f64) -> f64 {
    let response = frequency_loop_response(setting_hz, interval_s, Impulse::Frequency);
    noise_bandwidth_hz(&response, interval_s)
}

/// The setting, Hz, with which a frequency-locked loop has a bandwidth of `wanted_hz`, by bisection.
#[must_use]
pub fn frequency_loop_setting_hz(wanted_hz: f64, interval_s: f64) -> f64 {
    let (mut low_hz, mut high_hz) = (0.0, wanted_hz);
    for _ in 0..40 {
        let middle_hz = f64::midpoint(low_hz, high_hz);
        if frequency_loop_hz(middle_hz, interval_s) < wanted_hz {
            low_hz = middle_hz;
        } else {
            high_hz = middle_hz;
        }
    }
    f64::midpoint(low_hz, high_hz)
}

/// Response, Hz, of what a steered channel in carrier lock reports: the mean frequency of its oscillator
/// over the last `integrations`, carried to their end by the loop's acceleration.
#[must_use]
pub fn locked_carrier_response(
    phase_hz: f64,
    interval_s: f64,
    integrations: usize,
    impulse: Impulse,
) -> Vec<f64> {
    let bandwidth = CarrierBandwidth {
        phase_hz,
        frequency_hz: 0.0,
    };
    let oscillator = follow(bandwidth, interval_s, impulse);
    let span_s = integrations as f64 * interval_s;
    let cycles = &oscillator.cycles;
    let since = cycles.iter().zip(cycles.iter().skip(integrations));
    since
        .zip(oscillator.rate_hz_s.iter().skip(integrations))
        .map(|((first, last), rate_hz_s)| (last - first) / span_s + rate_hz_s * span_s / 2.0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_exponential_averages_have_the_bandwidth_of_the_textbook() {
        // A mean over n intervals: 1 / (2 n T).
        let mean = noise_bandwidth_hz(&[0.25; 4], 0.02);
        assert!((mean - 6.25).abs() < 1e-12, "{mean}");
        // x += K (z - x): K / (2 - K) / (2 T); what is cut off is below rounding.
        let gain: f64 = 0.3;
        let average: Vec<f64> = (0..200).map(|k| gain * (1.0 - gain).powi(k)).collect();
        let expected = gain / (2.0 - gain) / 0.04;
        assert!((noise_bandwidth_hz(&average, 0.02) - expected).abs() < 1e-9);
    }

    #[test]
    fn a_narrow_frequency_loop_has_the_bandwidth_it_is_set_to() {
        // Coefficients of continuous time: 2 % of B T = 0.01 by an independent computation.
        let hz = frequency_loop_hz(1.0, 0.01);
        assert!((hz - 1.026).abs() < 1e-3, "{hz}");
        let setting_hz = frequency_loop_setting_hz(10.0, 0.01);
        assert!((frequency_loop_hz(setting_hz, 0.01) - 10.0).abs() < 1e-6);
        assert!(setting_hz < 10.0);
    }

    #[test]
    fn a_locked_carrier_keeps_a_constant_frequency_and_rolls_off() {
        let response = locked_carrier_response(10.0, 0.01, 10, Impulse::Frequency);
        let sum: f64 = response.iter().sum();
        // No steady error; the tail after 9.5 s is below 1e-9.
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        let hz = noise_bandwidth_hz(&response, 0.01);
        // 10.31 Hz by an independent computation.
        assert!((hz - 10.31).abs() < 0.01, "{hz}");
    }

    #[test]
    fn phase_noise_of_a_frequency_loop_is_the_last_phase_and_little_else() {
        let errors = frequency_loop_response(1.0, 0.01, Impulse::PhaseError);
        let gain_hz = phase_noise_gain_hz(&errors);
        // A phase moves the oscillator by 1.414 * 1.0 / 0.53 Hz and is taken back with the next; what the
        // loop does meanwhile is of the order of B T = 1 %.
        let last_hz = 1.414 / 0.53;
        assert!(
            (gain_hz / last_hz - 1.0).abs() < 0.03,
            "{gain_hz} of {last_hz}"
        );
        // A wrong phase moves the oscillator's phase for a while only; 9.5 s are 100 time constants of 4 Hz.
        let wide = frequency_loop_response(4.0, 0.01, Impulse::PhaseError);
        assert!(wide.iter().sum::<f64>().abs() < 1e-9);
    }
}
