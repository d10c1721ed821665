//! Discriminators: from correlator sums to code, phase and frequency errors.
//!
//! Signs: a code error above zero means that the signal is early (its code phase is ahead of the
//! replica), a phase or frequency error above zero that it leads the replica. Each is exact, for
//! an undistorted triangle and without noise, where its documentation says so.

use std::f64::consts::{FRAC_PI_2, TAU};

use num_complex::Complex64;

/// Early, prompt and late sums of one integration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EarlyPromptLate {
    /// Sum with the advanced replica.
    pub early: Complex64,
    /// Sum with the prompt replica.
    pub prompt: Complex64,
    /// Sum with the delayed replica.
    pub late: Complex64,
}

impl EarlyPromptLate {
    /// The sums with their phases turned by `rotor`.
    pub(super) fn turned(&self, rotor: Complex64) -> Self {
        Self {
            early: self.early * rotor,
            prompt: self.prompt * rotor,
            late: self.late * rotor,
        }
    }
}

/// How a code error is formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CodeDiscriminator {
    /// Early minus late envelope, equation (5) of Jiang2017: needs no carrier lock.
    Envelope,
    /// Early minus late power: needs no carrier lock.
    Power,
    /// In-phase early minus late, over prompt: needs carrier phase lock.
    Coherent,
    /// Dot product of prompt and early minus late: needs no carrier lock.
    DotProduct,
}

impl CodeDiscriminator {
    /// Code error, chips, for early and late taps `spacing_chips` apart (0 < spacing <= 1).
    ///
    /// Exact on the ideal triangle within half the spacing (`Power`: to first order; the
    /// others exactly). Zero where the sums are all zero. Source: Kaplan2017, table 8.6.
    #[must_use]
    pub fn error_chips(self, taps: &EarlyPromptLate, spacing_chips: f64) -> f64 {
        let (e, l) = (taps.early.norm(), taps.late.norm());
        let slope_free = 1.0 - spacing_chips / 2.0;
        match self {
            Self::Envelope => slope_free * ratio(e - l, e + l),
            Self::Power => slope_free / 2.0 * ratio(e * e - l * l, e * e + l * l),
            Self::Coherent => {
                let prompt = taps.prompt.re;
                0.5 * ratio(
                    (taps.early.re - taps.late.re) * prompt.signum(),
                    prompt.abs(),
                ) * peak_correction(taps, spacing_chips)
            }
            Self::DotProduct => {
                let difference = taps.early - taps.late;
                let dot = difference.re * taps.prompt.re + difference.im * taps.prompt.im;
                0.5 * ratio(dot, taps.prompt.norm_sqr()) * peak_correction(taps, spacing_chips)
            }
        }
    }
}

/// The peak of the triangle over the prompt sum, so that normalising by prompt stays exact when
/// prompt is off the peak: early plus late is 2 - spacing times the peak within half the spacing.
fn peak_correction(taps: &EarlyPromptLate, spacing_chips: f64) -> f64 {
    let peak = (taps.early.norm() + taps.late.norm()) / (2.0 - spacing_chips);
    ratio(taps.prompt.norm(), peak)
}

fn ratio(numerator: f64, denominator: f64) -> f64 {
    if denominator > 0.0 {
        numerator / denominator
    } else {
        0.0
    }
}

/// How a carrier phase error is formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PhaseDiscriminator {
    /// atan(Q / I): blind to data bits, range a quarter cycle each way.
    Costas,
    /// atan2(Q, I): for wiped or absent data bits, range half a cycle each way.
    FourQuadrant,
}

impl PhaseDiscriminator {
    /// Phase error, cycles. Exact within its range. Zero for a zero sum.
    #[must_use]
    pub fn error_cycles(self, prompt: Complex64) -> f64 {
        match self {
            _ if prompt.re == 0.0 && prompt.im == 0.0 => 0.0,
            Self::Costas if prompt.re == 0.0 => prompt.im.signum() * FRAC_PI_2 / TAU,
            Self::Costas => (prompt.im / prompt.re).atan() / TAU,
            Self::FourQuadrant => prompt.im.atan2(prompt.re) / TAU,
        }
    }
}

/// How a frequency error is formed from two prompt sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrequencyDiscriminator {
    /// Equations (6) to (9) of Jiang2017: cross * sign(dot) over the power of the second sum.
    /// Exact to first order; unbounded under noise alone.
    CrossSignDot,
    /// atan(cross / dot): blind to data bits, range 1 / (4 dt) each way. Exact.
    Atan,
    /// atan2(cross, dot): for sums within one data bit, range 1 / (2 dt) each way. Exact.
    FourQuadrant,
}

impl FrequencyDiscriminator {
    /// Frequency error, Hz, of sums whose middles lie `dt_s` apart. Zero for zero sums.
    #[must_use]
    pub fn error_hz(self, first: Complex64, second: Complex64, dt_s: f64) -> f64 {
        let product = second * first.conj();
        let (cross, dot) = (product.im, product.re);
        match self {
            Self::CrossSignDot => {
                let sign = if dot < 0.0 { -1.0 } else { 1.0 };
                ratio(cross * sign, second.norm_sqr()) / (TAU * dt_s)
            }
            Self::Atan => PhaseDiscriminator::Costas.error_cycles(product) / dt_s,
            Self::FourQuadrant => PhaseDiscriminator::FourQuadrant.error_cycles(product) / dt_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Sums on the ideal triangle for a signal `error` chips early at `phase_cycles`.
    fn triangle(error: f64, spacing: f64, phase_cycles: f64) -> EarlyPromptLate {
        let r = |tau: f64| {
            Complex64::from_polar(1000.0 * (1.0 - tau.abs()).max(0.0), TAU * phase_cycles)
        };
        EarlyPromptLate {
            early: r(error - spacing / 2.0),
            prompt: r(error),
            late: r(error + spacing / 2.0),
        }
    }

    #[test]
    fn code_discriminators_are_exact_on_the_triangle() {
        for spacing in [0.2, 0.5, 1.0] {
            for step in -10..=10 {
                let error = f64::from(step) / 10.0 * spacing / 2.0;
                for data in [0.0, 0.5] {
                    let taps = triangle(error, spacing, data);
                    for kind in [
                        CodeDiscriminator::Envelope,
                        CodeDiscriminator::Coherent,
                        CodeDiscriminator::DotProduct,
                    ] {
                        // Rounding of a few operations on values near 1.
                        assert_abs_diff_eq!(
                            kind.error_chips(&taps, spacing),
                            error,
                            epsilon = 1e-12
                        );
                    }
                }
                let power =
                    CodeDiscriminator::Power.error_chips(&triangle(error, spacing, 0.2), spacing);
                // (E^2-L^2)/(E^2+L^2) = 2x/(1+x^2) with x = error / (1 - spacing/2).
                let x = error / (1.0 - spacing / 2.0);
                assert_abs_diff_eq!(power, error / (1.0 + x * x), epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn non_coherent_code_discriminators_ignore_the_phase() {
        for phase in [0.1, 0.3, 0.77] {
            let taps = triangle(0.13, 0.5, phase);
            for kind in [CodeDiscriminator::Envelope, CodeDiscriminator::DotProduct] {
                // Rounding only.
                assert_abs_diff_eq!(kind.error_chips(&taps, 0.5), 0.13, epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn equation_5_is_the_envelope_at_one_chip() {
        let taps = triangle(-0.21, 1.0, 0.4);
        let (e, l) = (taps.early.norm(), taps.late.norm());
        let printed = 0.5 * (e - l) / (e + l);
        // The same expression up to rounding.
        assert_abs_diff_eq!(
            CodeDiscriminator::Envelope.error_chips(&taps, 1.0),
            printed,
            epsilon = 1e-15
        );
    }

    #[test]
    fn phase_discriminators_are_exact_within_their_range() {
        for step in -24..=24 {
            let phase = f64::from(step) / 100.0;
            let sum = Complex64::from_polar(3.0, TAU * phase);
            // Rounding only.
            assert_abs_diff_eq!(
                PhaseDiscriminator::Costas.error_cycles(sum),
                phase,
                epsilon = 1e-14
            );
            assert_abs_diff_eq!(
                PhaseDiscriminator::Costas.error_cycles(-sum),
                phase,
                epsilon = 1e-14
            );
            let wide = Complex64::from_polar(3.0, TAU * 2.0 * phase);
            let four = PhaseDiscriminator::FourQuadrant.error_cycles(wide);
            assert_abs_diff_eq!(four, 2.0 * phase, epsilon = 1e-14);
        }
    }

    #[test]
    fn frequency_discriminators_are_exact_within_their_range() {
        let dt = 0.01;
        for step in -24..=24 {
            let frequency = f64::from(step);
            let first = Complex64::from_polar(2.0, 0.7);
            let second = first * Complex64::from_polar(1.0, TAU * frequency * dt);
            let atan = FrequencyDiscriminator::Atan;
            // Rounding of an angle near 1, divided by dt.
            assert_abs_diff_eq!(atan.error_hz(first, second, dt), frequency, epsilon = 1e-11);
            assert_abs_diff_eq!(
                atan.error_hz(first, -second, dt),
                frequency,
                epsilon = 1e-11
            );
            let four = FrequencyDiscriminator::FourQuadrant.error_hz(first, second, dt);
            assert_abs_diff_eq!(four, frequency, epsilon = 1e-11);
            let paper = FrequencyDiscriminator::CrossSignDot.error_hz(first, second, dt);
            let expected =
                (TAU * frequency * dt).sin() * (TAU * frequency * dt).cos().signum() / (TAU * dt);
            assert_abs_diff_eq!(paper, expected, epsilon = 1e-11);
        }
    }

    #[test]
    fn sums_of_zero_give_no_error() {
        let zero = EarlyPromptLate {
            early: Complex64::default(),
            prompt: Complex64::default(),
            late: Complex64::default(),
        };
        for kind in [
            CodeDiscriminator::Envelope,
            CodeDiscriminator::Power,
            CodeDiscriminator::Coherent,
            CodeDiscriminator::DotProduct,
        ] {
            assert_eq!(kind.error_chips(&zero, 0.5), 0.0);
        }
        for frequency in [
            FrequencyDiscriminator::CrossSignDot,
            FrequencyDiscriminator::Atan,
            FrequencyDiscriminator::FourQuadrant,
        ] {
            assert_eq!(frequency.error_hz(zero.prompt, -zero.prompt, 0.01), 0.0);
            assert_eq!(
                frequency.error_hz(Complex64::new(-3.0, 1.0), zero.prompt, 0.01),
                0.0
            );
        }
        for phase in [PhaseDiscriminator::Costas, PhaseDiscriminator::FourQuadrant] {
            assert_eq!(phase.error_cycles(-zero.prompt), 0.0);
        }
    }
}
