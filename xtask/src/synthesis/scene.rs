//! What arrives at the antenna and how it is sampled.

use anyhow::{Result, ensure};
use gnss_signal::SignalId;
use gnss_signal::sample::SampleDescription;

use super::message::Message;
use super::path::SignalPath;

/// One satellite's signal.
pub struct SceneSignal {
    /// Its ranging code.
    pub signal: SignalId,
    /// Carrier power over noise density, before filter and quantiser, dB-Hz.
    pub cn0_dbhz: f64,
    /// Where code and carrier stand.
    pub path: Box<dyn SignalPath>,
    /// Its data.
    pub message: Message,
}

/// Signals in white noise through a front end.
pub struct Scene {
    /// The samples to make.
    pub samples: SampleDescription,
    /// Length, s.
    pub duration_s: f64,
    /// The signals.
    pub signals: Vec<SceneSignal>,
    /// Two-sided bandwidth of the front-end filter as a fraction of the sample rate, centred on
    /// the intermediate frequency; none: no filter.
    pub bandwidth: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
}

impl Scene {
    pub(super) fn check(&self) -> Result<()> {
        let rate_hz = self.samples.sample_rate_hz;
        let if_hz = self.samples.intermediate_frequency_hz;
        ensure!(
            (1e6..=1e9).contains(&rate_hz),
            "sample rate is {rate_hz} Hz: expected 1e6 to 1e9"
        );
        ensure!(if_hz.is_finite(), "intermediate frequency is {if_hz} Hz");
        ensure!(
            (0.0..=1e6).contains(&self.duration_s),
            "duration is {} s: expected 0 to 1e6",
            self.duration_s
        );
        if let Some(bandwidth) = self.bandwidth {
            ensure!(
                (0.05..=0.95).contains(&bandwidth),
                "front-end bandwidth is {bandwidth} of the sample rate: expected 0.05 to 0.95"
            );
        }
        for signal in &self.signals {
            let cn0 = signal.cn0_dbhz;
            ensure!(
                (0.0..=100.0).contains(&cn0),
                "C/N0 is {cn0} dB-Hz: expected 0 to 100"
            );
        }
        Ok(())
    }

    /// Number of samples.
    pub(super) fn length_ticks(&self) -> i64 {
        (self.duration_s * self.samples.sample_rate_hz).round() as i64
    }

    /// Amplitude of a signal where each component of the noise has unit variance.
    ///
    /// Complex samples: C = A^2, N0 = 2 / fs. Real ones: C = A^2 / 2, N0 = 2 / fs.
    pub(super) fn amplitude(&self, cn0_dbhz: f64) -> f64 {
        let carrier_over_noise = 10f64.powf(cn0_dbhz / 10.0) / self.samples.sample_rate_hz;
        let complex = self.samples.format.is_complex();
        (carrier_over_noise * if complex { 2.0 } else { 4.0 }).sqrt()
    }
}
