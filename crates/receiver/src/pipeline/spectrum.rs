//! Which way the front end maps the spectrum, told from the codes.
//!
//! The code rate follows the physical Doppler, the carrier the apparent one. Where they disagree
//! in sign on several satellites, I and Q are exchanged or the mixer works from above.

use gnss_signal::Signal;
use gnss_signal::tracking::BitSync;

/// Log likelihood ratio at which the spectrum counts as inverted: one wrong in 10^5.
const CERTAIN: f64 = 12.0;

/// Weighs what the codes say of the spectrum.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SpectrumSense {
    log_likelihood_ratio: f64,
}

impl SpectrumSense {
    /// Takes what a channel found while it was tracked as if the spectrum were upright.
    pub(super) fn weigh(&mut self, sync: &BitSync) {
        let spec = Signal::GpsL1Ca.spec();
        let if_inverted = -2.0 * sync.doppler_hz * spec.code_rate_hz / spec.carrier_hz;
        let upright = sync.code_slip_hz.powi(2);
        let inverted = (sync.code_slip_hz - if_inverted).powi(2);
        let ratio = (upright - inverted) / (2.0 * sync.code_slip_variance_hz2);
        if ratio.is_finite() {
            self.log_likelihood_ratio += ratio;
        }
    }

    /// Whether the spectrum is inverted beyond doubt.
    pub(super) fn is_inverted(&self) -> bool {
        self.log_likelihood_ratio > CERTAIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sync(doppler_hz: f64, code_slip_hz: f64) -> BitSync {
        BitSync {
            doppler_hz,
            code_slip_hz,
            code_slip_variance_hz2: 0.25,
        }
    }

    #[test]
    fn satellites_that_slip_against_their_doppler_tell_an_inverted_spectrum() {
        let mut sense = SpectrumSense::default();
        for doppler_hz in [3_000.0, -2_500.0, 200.0] {
            sense.weigh(&sync(doppler_hz, -2.0 * doppler_hz / 1540.0 + 0.4));
        }
        assert!(sense.is_inverted());
    }

    #[test]
    fn satellites_that_do_not_slip_tell_nothing_of_the_kind() {
        let mut sense = SpectrumSense::default();
        for doppler_hz in [3_000.0, -2_500.0, 200.0] {
            sense.weigh(&sync(doppler_hz, 0.4));
        }
        sense.weigh(&BitSync {
            code_slip_variance_hz2: f64::INFINITY,
            ..sync(1_000.0, f64::NAN)
        });
        assert!(!sense.is_inverted());
    }
}
