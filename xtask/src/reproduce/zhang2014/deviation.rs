//! Which integration gives the paper's deviation: sigma by integration, loop and bandwidth; by C/N0.

use fault_ml::shape::{SHAPE_TAPS_CHIPS, largest_tap};

use super::closed_loop::{ClosedLoop, Setting};
use super::correlation::Correlation;

/// SNR of the paper over 5 MHz of complex samples, and of real ones, dB-Hz.
pub const COMPLEX_DBHZ: f64 = 43.99;
const REAL_DBHZ: f64 = 40.98;
/// Integrations of a case: the deviation is good to 0.5 %.
const STEPS: usize = 60_000;

/// A case and the deviation of T in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    /// Integration, ms.
    pub integration_ms: f64,
    /// Noise bandwidth of the loop, Hz; zero: held on the signal.
    pub loop_hz: f64,
    /// One-sided bandwidth of the front end, MHz; infinite without a filter.
    pub bandwidth_mhz: f64,
    /// C/N0, dB-Hz.
    pub cn0_dbhz: f64,
    /// Deviation of the observable, chips.
    pub sigma_chips: f64,
}

/// By integration, loop, bandwidth and reading of the paper's SNR.
#[must_use]
pub fn by_integration() -> Vec<Case> {
    let mut cases = Vec::new();
    for cn0_dbhz in [COMPLEX_DBHZ, REAL_DBHZ] {
        for (bandwidth_mhz, correlation) in bands() {
            for integration_ms in [1.0, 2.0, 5.0] {
                for loop_hz in [0.0, 2.0, 3.0, 5.0] {
                    let setting = Setting {
                        integration_s: integration_ms * 1e-3,
                        loop_hz,
                        correlation: correlation.clone(),
                        ..Setting::paper(cn0_dbhz)
                    };
                    cases.push(Case {
                        integration_ms,
                        loop_hz,
                        bandwidth_mhz,
                        cn0_dbhz,
                        sigma_chips: deviation(setting),
                    });
                }
            }
        }
    }
    cases
}

/// C/N0 and deviation at the paper's integration and loop.
#[must_use]
pub fn by_cn0() -> Vec<(f64, f64)> {
    let all = (0..7).map(|k| 32.0 + 3.0 * f64::from(k));
    all.map(|cn0| (cn0, deviation(Setting::paper(cn0))))
        .collect()
}

/// Front ends: one-sided bandwidth, MHz, and correlation.
#[must_use]
pub fn bands() -> [(f64, Correlation); 3] {
    [
        (f64::INFINITY, Correlation::Triangle),
        (2.5, Correlation::filtered(2.5e6)),
        (1.25, Correlation::filtered(1.25e6)),
    ]
}

fn deviation(setting: Setting) -> f64 {
    let mut closed = ClosedLoop::new(setting, 17);
    let observed = (0..STEPS).map(|_| {
        let sums = closed.step(&[]);
        largest_tap(&SHAPE_TAPS_CHIPS, &sums.shape).unwrap_or(0.0)
    });
    (observed.map(|t| t * t).sum::<f64>() / STEPS as f64).sqrt()
}
