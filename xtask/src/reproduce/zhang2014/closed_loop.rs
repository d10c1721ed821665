//! A code loop closed on drawn correlator sums: one channel, whose carrier is tracked.

use fault_ml::shape::SHAPE_TAPS_CHIPS;
use nalgebra::SMatrix;
use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::correlation::Correlation;

/// Early, the taps of the shape, late.
const TAPS: usize = SHAPE_TAPS_CHIPS.len() + 2;
/// Added to the variance of every tap, so that the noise of a narrow band, which is nearly the same in
/// neighbouring taps, has a factor.
const OWN_VARIANCE: f64 = 1e-9;

/// What a loop is and hears.
#[derive(Debug, Clone)]
pub struct Setting {
    /// C/N0 of the direct signal, dB-Hz.
    pub cn0_dbhz: f64,
    /// Coherent integration, s.
    pub integration_s: f64,
    /// Early to late, chips.
    pub spacing_chips: f64,
    /// One-sided noise bandwidth of the loop, of first order, Hz.
    pub loop_hz: f64,
    /// Correlation of the code behind the front end.
    pub correlation: Correlation,
}

impl Setting {
    /// The paper's: sums of 1 ms, a chip between early and late, an unlimited band; the bandwidth of the
    /// loop is the one that gives the paper's deviation.
    #[must_use]
    pub const fn paper(cn0_dbhz: f64) -> Self {
        Self {
            cn0_dbhz,
            integration_s: 1e-3,
            spacing_chips: 1.0,
            loop_hz: 3.0,
            correlation: Correlation::Triangle,
        }
    }

    /// The receiver's: sums of 10 ms, half a chip between early and late.
    #[must_use]
    pub const fn receiver(cn0_dbhz: f64, correlation: Correlation) -> Self {
        Self {
            cn0_dbhz,
            integration_s: 1e-2,
            spacing_chips: 0.5,
            loop_hz: 0.05,
            correlation,
        }
    }
}

/// A reflection beside the direct signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflection {
    /// Amplitude, that of the direct signal is 1.
    pub amplitude: f64,
    /// Delay, chips.
    pub delay_chips: f64,
    /// Carrier phase against the direct signal, rad.
    pub phase_rad: f64,
}

/// Magnitudes of the sums of one integration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnitudes {
    /// Early.
    pub early: f64,
    /// At [`SHAPE_TAPS_CHIPS`].
    pub shape: [f64; SHAPE_TAPS_CHIPS.len()],
    /// Late.
    pub late: f64,
}

impl Magnitudes {
    fn new(sums: &[Complex64; TAPS]) -> Self {
        let magnitudes = sums.map(|s| s.norm_sqr().sqrt());
        Self {
            early: magnitudes[0],
            shape: std::array::from_fn(|k| magnitudes[k + 1]),
            late: magnitudes[TAPS - 1],
        }
    }
}

/// Sums that `correlation` gives of a direct signal and `reflections`, by a replica `late_chips` late.
fn signal(
    offsets_chips: &[f64; TAPS],
    correlation: &Correlation,
    late_chips: f64,
    reflections: &[Reflection],
) -> [Complex64; TAPS] {
    let mut sums = offsets_chips.map(|x| Complex64::from(correlation.at(x + late_chips)));
    for r in reflections {
        let amplitude = Complex64::from_polar(r.amplitude, r.phase_rad);
        for (sum, x) in sums.iter_mut().zip(offsets_chips) {
            *sum += amplitude * correlation.at(x + late_chips - r.delay_chips);
        }
    }
    sums
}

fn offsets_chips(spacing_chips: f64) -> [f64; TAPS] {
    std::array::from_fn(|k| match k {
        0 => -spacing_chips / 2.0,
        k if k == TAPS - 1 => spacing_chips / 2.0,
        k => SHAPE_TAPS_CHIPS[k - 1],
    })
}

/// Code error by early and late envelope, chips; above zero the signal is early.
fn code_error(sums: &Magnitudes, spacing_chips: f64) -> f64 {
    (1.0 - spacing_chips / 2.0) * (sums.early - sums.late) / (sums.early + sums.late)
}

/// Where a loop settles without noise on a direct signal and `reflections`, from no error on: how late
/// the replica then is, chips, and the sums that it sees there.
#[must_use]
pub fn settled(
    correlation: &Correlation,
    spacing_chips: f64,
    reflections: &[Reflection],
) -> (f64, Magnitudes) {
    /// Each removes a third of what is left.
    const STEPS: usize = 200;
    let offsets = offsets_chips(spacing_chips);
    let mut late_chips = 0.0;
    let mut sums = Magnitudes::new(&signal(&offsets, correlation, 0.0, reflections));
    for _ in 0..STEPS {
        late_chips -= code_error(&sums, spacing_chips) * 2.0 / 3.0;
        sums = Magnitudes::new(&signal(&offsets, correlation, late_chips, reflections));
    }
    (late_chips, sums)
}

/// A loop under way.
#[derive(Debug, Clone)]
pub struct ClosedLoop {
    setting: Setting,
    offsets_chips: [f64; TAPS],
    /// Columns of the factor of the noise's covariance over the taps.
    factor: [[f64; TAPS]; TAPS],
    amplitude: f64,
    gain: f64,
    late_chips: f64,
    rng: ChaCha8Rng,
}

impl ClosedLoop {
    /// A loop on its signal.
    #[must_use]
    pub fn new(setting: Setting, seed: u64) -> Self {
        let offsets_chips = offsets_chips(setting.spacing_chips);
        let covariance = SMatrix::<f64, TAPS, TAPS>::from_fn(|a, b| {
            let own = if a == b { OWN_VARIANCE } else { 0.0 };
            setting.correlation.at(offsets_chips[a] - offsets_chips[b]) + own
        });
        let factor = covariance
            .cholesky()
            .map_or_else(SMatrix::identity, |c| c.l());
        let snr = 10f64.powf(setting.cn0_dbhz / 10.0) * setting.integration_s;
        Self {
            offsets_chips,
            factor: std::array::from_fn(|j| std::array::from_fn(|k| factor[(k, j)])),
            // In units of the deviation of either component of the noise.
            amplitude: (2.0 * snr).sqrt(),
            gain: 4.0 * setting.loop_hz * setting.integration_s,
            late_chips: 0.0,
            rng: ChaCha8Rng::seed_from_u64(seed),
            setting,
        }
    }

    /// This loop with its replica `late_chips` late.
    #[must_use]
    pub const fn at(mut self, late_chips: f64) -> Self {
        self.late_chips = late_chips;
        self
    }

    /// How late the replica is, chips.
    #[must_use]
    pub const fn late_chips(&self) -> f64 {
        self.late_chips
    }

    /// Integrates once over the direct signal and `reflections`, and follows.
    pub fn step(&mut self, reflections: &[Reflection]) -> Magnitudes {
        let setting = &self.setting;
        let signal = signal(
            &self.offsets_chips,
            &setting.correlation,
            self.late_chips,
            reflections,
        );
        let mut re = signal.map(|s| self.amplitude * s.re);
        let mut im = signal.map(|s| self.amplitude * s.im);
        for column in &self.factor {
            let (a, b): (f64, f64) = (
                self.rng.sample(StandardNormal),
                self.rng.sample(StandardNormal),
            );
            for k in 0..TAPS {
                re[k] += a * column[k];
                im[k] += b * column[k];
            }
        }
        let sums = Magnitudes::new(&std::array::from_fn(|k| Complex64::new(re[k], im[k])));
        self.late_chips -= self.gain * code_error(&sums, setting.spacing_chips);
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_errs_as_theory_says() {
        let mut channel = ClosedLoop::new(Setting::paper(50.0), 1);
        let n = 200_000;
        let errors: Vec<f64> = (0..n)
            .map(|_| {
                channel.step(&[]);
                channel.late_chips()
            })
            .collect();
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / f64::from(n);
        // 2 B T of the variance of a chip's early minus late (Kaplan2017, 8.95).
        let snr = 1e5 * 1e-3;
        let expected = 2.0 * 3.0 * 1e-3 / (4.0 * snr) * (1.0 + 1.0 / snr);
        // 1200 time constants: 4 % standard error.
        assert!(
            (variance / expected - 1.0).abs() < 0.12,
            "{variance} {expected}"
        );
    }

    #[test]
    fn it_settles_where_the_noiseless_one_does() {
        let reflections = [Reflection {
            amplitude: 0.5,
            delay_chips: 0.6,
            phase_rad: 0.4,
        }];
        let (expected, _) = settled(&Correlation::Triangle, 1.0, &reflections);
        let mut channel = ClosedLoop::new(Setting::paper(60.0), 2);
        (0..3_000).for_each(|_| _ = channel.step(&reflections));
        let n = 2_000;
        let mean = (0..n)
            .map(|_| {
                channel.step(&reflections);
                channel.late_chips()
            })
            .sum::<f64>()
            / f64::from(n);
        assert!((mean - expected).abs() < 0.004, "{mean} {expected}");
    }
}
