//! The code error of the receiver's own, narrow loop from short signals.
//!
//! A loop of 0.05 Hz has an independent error every five seconds: hours of signal would tell two
//! rates apart. But its error has two parts that each show in little. What sampling does to the
//! code phase is the error of a signal far above the noise. Noise passes a loop by its bandwidth:
//! a wide one has a new error in almost every integration.

use anyhow::Result;
use gnss_nav::constants::L1_HZ;
use gnss_signal::tracking::loop_filter::CodeLoop;

use super::experiment::measure_means;
use super::{Case, CodeError, Experiment, measure};

/// C/N0 at which noise is 1 % of that at 45 dB-Hz.
const FAR_ABOVE_NOISE_DBHZ: f64 = 85.0;
/// Bandwidth in which parts are measured, Hz.
const WIDE_HZ: f64 = 40.0;
/// Code periods of an integration in that.
const WIDE_PERIODS: u32 = 5;
/// Code period, s.
const PERIOD_S: f64 = 1e-3;
/// Independent errors in a measured one: each is corrected by 0.64 (3.2 B T), so that successive
/// ones correlate by r = 0.36, and (1 - r^2) / (1 + r^2) of their squares tell something new.
const INDEPENDENT: f64 = 0.77;
/// Turn of the chips against the samples from which a loop averages what they do, over the
/// inverse of its bandwidth B: a pole at 4 B leaves a twentieth.
const AVERAGED_TURN: f64 = 0.08;

/// The two measurements.
#[derive(Debug, Clone, Copy)]
pub struct Parts {
    /// The loop whose error is told.
    narrow: Experiment,
    /// The one in which parts are measured.
    wide: Experiment,
}

impl Parts {
    /// The receiver's own loop at 45 dB-Hz, from that many runs of up to 1 s.
    #[must_use]
    pub fn new(seeds: u64) -> Self {
        let narrow = Experiment {
            // Tracking begins at the first sample, and a wide loop settles in no time.
            settle_s: 0.1,
            judged_s: 0.5,
            seeds,
            ..Experiment::default()
        };
        let mut wide = narrow.with_code_bandwidth(WIDE_HZ);
        wide.tracking.integration_periods = WIDE_PERIODS;
        Self { narrow, wide }
    }

    /// Code error of `case` in the narrow loop; its mean is what sampling does, its epochs those
    /// of the wide loop.
    ///
    /// # Errors
    /// As [`measure`].
    pub fn measure(&self, case: Case) -> Result<CodeError> {
        Ok(together(self.sampling(case)?, self.noise(case)?))
    }

    /// What sampling does to `case`.
    ///
    /// # Errors
    /// As [`measure`].
    pub fn sampling(&self, case: Case) -> Result<CodeError> {
        let narrow = self.narrow.tracking;
        let turn_s = L1_HZ / (case.sample_rate_hz * case.doppler_hz.abs());
        let averages = turn_s < AVERAGED_TURN / narrow.code_locked_hz;
        let far_above = Experiment {
            cn0_dbhz: FAR_ABOVE_NOISE_DBHZ,
            // What turns more slowly is taken to stand still.
            judged_s: if averages { turn_s } else { 0.05 },
            ..self.narrow
        };
        measure_means(&far_above.with_code_bandwidth(WIDE_HZ), case)
    }

    /// What noise leaves in the narrow loop, sampling included where it turns with the Doppler.
    ///
    /// # Errors
    /// As [`measure`].
    pub fn noise(&self, case: Case) -> Result<CodeError> {
        let wide = measure(&self.wide, case)?;
        let part = (noise_passed(&self.narrow) / noise_passed(&self.wide)).sqrt();
        let rms_chips = part * wide.rms_chips;
        Ok(CodeError {
            rms_chips,
            rms_deviation_chips: rms_chips / (2.0 * INDEPENDENT * wide.epochs as f64).sqrt(),
            mean_chips: part * wide.mean_chips,
            stated_chips: part * wide.stated_chips,
            epochs: wide.epochs,
        })
    }
}

/// Variance that a loop leaves in the code phase over that of a code error of 10 ms.
fn noise_passed(experiment: &Experiment) -> f64 {
    let bandwidth_hz = experiment.tracking.code_locked_hz;
    let interval_s = f64::from(experiment.tracking.integration_periods) * PERIOD_S;
    let variance = 0.01 / interval_s;
    let mut filter = CodeLoop::new(variance);
    for _ in 0..100_000 {
        filter.update(0.0, variance, bandwidth_hz, interval_s);
    }
    filter.variance_chips2()
}

/// What sampling and noise make together.
fn together(sampling: CodeError, noise: CodeError) -> CodeError {
    let rms_chips = sampling.rms_chips.hypot(noise.rms_chips);
    let part = |e: CodeError| e.rms_chips * e.rms_deviation_chips / rms_chips;
    CodeError {
        rms_chips,
        rms_deviation_chips: part(sampling).hypot(part(noise)),
        mean_chips: sampling.mean_chips,
        ..noise
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DOPPLERS_HZ, INTEGER_AND_BESIDE_HZ, ratio};
    use super::*;

    #[test]
    fn noise_passes_by_the_bandwidth() {
        // 2 B of the variance in a second, 0.01 of that in 10 ms, to first order in the gain.
        for (bandwidth_hz, periods) in [(0.05, 10), (0.05, 5), (0.5, 10)] {
            let mut experiment = Experiment::default().with_code_bandwidth(bandwidth_hz);
            experiment.tracking.integration_periods = periods;
            let passed = noise_passed(&experiment);
            let gain = 3.2 * bandwidth_hz * f64::from(periods) * PERIOD_S;
            assert!((passed / (0.02 * bandwidth_hz) - 1.0).abs() < 1.5 * gain);
        }
    }

    #[test]
    fn the_parts_add_up_as_squares() {
        let error = |rms_chips, rms_deviation_chips| CodeError {
            rms_chips,
            rms_deviation_chips,
            mean_chips: rms_chips - 1.0,
            stated_chips: 8.0,
            epochs: 7,
        };
        let sum = together(error(3.0, 0.5), error(4.0, 0.5));
        assert_eq!((sum.rms_chips, sum.mean_chips), (5.0, 2.0));
        // (3 * 0.5, 4 * 0.5) over 5.
        assert!((sum.rms_deviation_chips - 0.5).abs() < 1e-12);
    }

    #[test]
    fn whole_samples_per_chip_cost_nothing_behind_a_filter() {
        for (integer_hz, beside_hz) in INTEGER_AND_BESIDE_HZ {
            // Sampling does less at high rates: fewer runs do. One run holds noise enough.
            let (seeds, judged_s) = if integer_hz < 1e7 { (6, 3.0) } else { (3, 1.8) };
            let mut parts = Parts::new(seeds);
            (parts.wide.seeds, parts.wide.judged_s) = (1, judged_s);
            let case = |sample_rate_hz, doppler_hz| Case {
                sample_rate_hz,
                bandwidth: Some(0.8),
                doppler_hz,
            };
            // Noise is the same at any Doppler.
            let noise = |rate_hz| parts.noise(case(rate_hz, 1000.0)).unwrap();
            let (noise, noise_beside) = (noise(integer_hz), noise(beside_hz));
            for doppler_hz in DOPPLERS_HZ {
                let sampling = |rate_hz| parts.sampling(case(rate_hz, doppler_hz)).unwrap();
                let error = together(sampling(integer_hz), noise);
                let ratio = ratio(error, together(sampling(beside_hz), noise_beside));
                // Two standard errors below what is asked for.
                assert!(
                    ratio.value + 2.0 * ratio.deviation <= 1.2,
                    "{integer_hz} over {beside_hz} at {doppler_hz} Hz: {ratio:?}"
                );
                // Nor by what is common to both: half the noise at 45 dB-Hz.
                let sampling_m = sampling(integer_hz).rms_chips * 293.0;
                assert!(sampling_m < 0.1, "{integer_hz}: {sampling_m} m");
            }
        }
    }
}
