//! The plainest way of a signal: at a constant Doppler.

use anyhow::Result;
use gnss_nav::GpsTime;
use gnss_nav::constants::L1_HZ;

use super::antenna::Arrival;

/// Where a signal's code and carrier stand when they arrive.
pub trait SignalPath: Send {
    /// What arrives when the receiver's clock has run for `elapsed_s` since the first sample
    /// (below zero: before it).
    ///
    /// # Errors
    /// Where the path has no answer.
    fn arrival(&self, elapsed_s: f64) -> Result<Arrival>;
}

/// A signal of constant Doppler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UniformPath {
    /// Reading of the satellite's clock in the code that arrives with the first sample.
    pub code_time: GpsTime,
    /// Doppler of carrier and code, Hz of L1.
    pub doppler_hz: f64,
}

impl SignalPath for UniformPath {
    fn arrival(&self, elapsed_s: f64) -> Result<Arrival> {
        Ok(Arrival {
            code_time: self.code_time + elapsed_s * (1.0 + self.doppler_hz / L1_HZ),
            carrier_cycles: self.doppler_hz * elapsed_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_path_advances_code_and_carrier_alike() {
        let path = UniformPath {
            code_time: GpsTime::new(2350, 5.0),
            doppler_hz: 1540.0,
        };
        let arrival = path.arrival(2.0).unwrap();
        // One chip in 1540 cycles.
        let chips = (arrival.code_time - path.code_time - 2.0) * 1.023e6;
        assert!((chips - 2.0).abs() < 1e-6);
        assert_eq!(arrival.carrier_cycles, 3080.0);
    }
}
