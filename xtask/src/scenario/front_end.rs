//! The front end of a scenario file.

use anyhow::{Context, Result, ensure};
use gnss_signal::sample::{SampleDescription, SampleFormat};
use serde::Deserialize;

use super::antenna::{Gain, Reception};

/// Front end of a scenario file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrontEndSpec {
    /// Sample format, as `receiver run --format`.
    format: String,
    /// Samples (I, Q pairs where complex) per second.
    sample_rate_hz: f64,
    /// Intermediate frequency, Hz; may be negative where samples are complex.
    #[serde(default)]
    if_hz: f64,
    /// Two-sided bandwidth of the filter around the signal, Hz; without it there is no filter.
    bandwidth_hz: Option<f64>,
    /// Time constant of the level control, s; without it the gain is fixed.
    agc_time_s: Option<f64>,
    /// Bits of the quantiser, 1 to 8, where the format has room for more.
    bits: Option<u8>,
    /// Whether I and Q are exchanged.
    #[serde(default)]
    swap_iq: bool,
}

impl FrontEndSpec {
    /// The front end, checked.
    ///
    /// # Errors
    /// Names a value that is impossible.
    pub fn reception(&self) -> Result<Reception> {
        let format: SampleFormat = self
            .format
            .parse()
            .with_context(|| format!("format is {:?}", self.format))?;
        let (rate_hz, if_hz) = (self.sample_rate_hz, self.if_hz);
        ensure!(
            (1e6..=1e9).contains(&rate_hz),
            "sample_rate_hz is {rate_hz}: expected 1e6 to 1e9"
        );
        let lowest_hz = if format.is_complex() {
            -rate_hz / 2.0
        } else {
            0.0
        };
        ensure!(
            (lowest_hz..=rate_hz / 2.0).contains(&if_hz),
            "if_hz is {if_hz}: expected {lowest_hz} to half the sample rate, {}",
            rate_hz / 2.0
        );
        if let Some(bandwidth_hz) = self.bandwidth_hz {
            ensure!(
                (0.05..=0.95).contains(&(bandwidth_hz / rate_hz)),
                "bandwidth_hz is {bandwidth_hz}: expected 0.05 to 0.95 of the sample rate"
            );
        }
        let gain = match self.agc_time_s {
            None => Gain::Fixed,
            Some(time_s) => {
                ensure!(
                    (1e-4..=1e3).contains(&time_s),
                    "agc_time_s is {time_s}: expected 1e-4 to 1e3"
                );
                Gain::Automatic { time_s }
            }
        };
        Ok(Reception {
            samples: SampleDescription {
                format,
                sample_rate_hz: rate_hz,
                intermediate_frequency_hz: if_hz,
                swap_iq: self.swap_iq,
            },
            bits: self.bits,
            bandwidth_hz: self.bandwidth_hz,
            gain,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        let spec: FrontEndSpec = toml::from_str(text).unwrap();
        format!("{:#}", spec.reception().unwrap_err())
    }

    #[test]
    fn impossible_front_ends_are_named() {
        let nyquist = "format = 'r2_lsb'\nsample_rate_hz = 16.369e6\nif_hz = 9e6";
        assert!(message(nyquist).starts_with("if_hz is 9000000: expected 0 to half"));
        let negative = "format = 'ri8'\nsample_rate_hz = 16e6\nif_hz = -4e6";
        assert!(message(negative).contains("expected 0 to"));
        let wide = "format = 'ci8'\nsample_rate_hz = 4e6\nbandwidth_hz = 8e6";
        assert!(message(wide).starts_with("bandwidth_hz"));
        assert!(message("format = 'c9'\nsample_rate_hz = 4e6").starts_with("format is \"c9\""));
    }
}
