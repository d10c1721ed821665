//! Variance of what a channel measures, by theory, from C/N0, integration time and tap spacing.
//!
//! The formulas hold where the signal is above the noise of an integration. As C/N0 falls a
//! discriminator saturates and its output stays bounded, but it answers less and less to the
//! error; the variances here go on growing, which is what a filter has to be told.
//!
//! N independent measurements averaged have the variance over N.

use std::f64::consts::TAU;

use crate::constants::{CA_CODE_RATE_HZ, L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};

/// Length of a chip of C/A, m.
const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / CA_CODE_RATE_HZ;

/// Signal over noise of one integration, C/N0 times its length.
fn signal_to_noise(cn0_dbhz: f64, integration_s: f64) -> f64 {
    10f64.powf(cn0_dbhz / 10.0) * integration_s
}

/// Variance of a code error, m^2, by (1 - d/2) (E - L) / (E + L) of envelopes (equation (5) of
/// Jiang2017), early and late `spacing_chips` = d apart (0 < d <= 1), of one integration.
///
/// chip^2 d / (4 c) (1 + 1 / ((2 - d) c)), c = C/N0 times the integration time. The second term is
/// half of that of the power discriminator (Kaplan2017, 8.95): simulated, the deviation lies 0 to
/// 4 % below this for c above 10.
#[must_use]
pub fn code_variance_m2(cn0_dbhz: f64, integration_s: f64, spacing_chips: f64) -> f64 {
    let c = signal_to_noise(cn0_dbhz, integration_s);
    let squaring = 1.0 + 1.0 / ((2.0 - spacing_chips) * c);
    CHIP_M * CHIP_M * spacing_chips / (4.0 * c) * squaring
}

/// Variance of a range rate, (m/s)^2, by the phase between two successive prompt sums of
/// `integration_s` each.
///
/// (lambda / (2 pi T))^2 (1 + 1 / (2 c)) / c with c = C/N0 T, exact for the phase of the product of
/// the sums to its second order. It serves equation (6) of Jiang2017, cross sign(dot) / |P2|^2 (whose
/// own variance is infinite, because the divisor may come close to zero), and the bounded
/// atan2(cross, dot). Pairs that share a sum are correlated by -1/2: a filter that takes each for
/// independent is misled.
#[must_use]
pub fn sum_pair_rate_variance_m2_s2(cn0_dbhz: f64, integration_s: f64) -> f64 {
    let c = signal_to_noise(cn0_dbhz, integration_s);
    let rate_mps = L1_WAVELENGTH_M / (TAU * integration_s);
    rate_mps * rate_mps * (1.0 + 1.0 / (2.0 * c)) / c
}

/// Variance of a range rate, (m/s)^2, by the phase between the two halves of an interval: those of
/// successive intervals share nothing and stay white.
#[must_use]
pub fn half_interval_rate_variance_m2_s2(cn0_dbhz: f64, interval_s: f64) -> f64 {
    sum_pair_rate_variance_m2_s2(cn0_dbhz, interval_s / 2.0)
}

/// Variance of a range rate, (m/s)^2, by the least-squares slope of the carrier phases of
/// `integrations` successive sums of `integration_s` each, phase lock given.
///
/// Phase variance (1 + 1 / (2 c)) / (2 c) rad^2 (Kaplan2017, 8.80) over the spread of the instants,
/// T^2 N (N^2 - 1) / 12. Infinite for fewer than two.
#[must_use]
pub fn carrier_rate_variance_m2_s2(cn0_dbhz: f64, integration_s: f64, integrations: u32) -> f64 {
    let c = signal_to_noise(cn0_dbhz, integration_s);
    let n = f64::from(integrations);
    let spread_s2 = integration_s * integration_s * n * (n * n - 1.0) / 12.0;
    if spread_s2 <= 0.0 {
        return f64::INFINITY;
    }
    let phase_m = L1_WAVELENGTH_M / TAU;
    phase_m * phase_m * (1.0 + 1.0 / (2.0 * c)) / (2.0 * c) / spread_s2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up_sky::normal;
    use nalgebra::{Complex, ComplexField};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn figures_of_an_independent_computation_at_45_dbhz() {
        // Deviations of one integration, 1 chip between early and late, from an independent
        // program, to the digits printed there.
        for (ms, code_m, rate_mps) in [(1.0, 26.5, 5.43), (10.0, 8.3, 0.170), (20.0, 5.8, 0.060)] {
            let code = code_variance_m2(45.0, ms * 1e-3, 1.0).sqrt();
            let rate = sum_pair_rate_variance_m2_s2(45.0, ms * 1e-3).sqrt();
            assert!((code - code_m).abs() < 0.06, "{ms} ms: {code} m");
            assert!((rate / rate_mps - 1.0).abs() < 0.01, "{ms} ms: {rate} m/s");
        }
    }

    fn noise(rng: &mut ChaCha8Rng) -> Complex<f64> {
        Complex::new(normal(rng), normal(rng)) * 0.5f64.sqrt()
    }

    /// Deviation of the code discriminator, m, simulated on noise with the covariance 1 - d of
    /// early and late.
    fn simulated_code_sigma_m(c: f64, d: f64, rng: &mut ChaCha8Rng) -> f64 {
        let count = 20_000;
        let sum: f64 = (0..count)
            .map(|_| {
                let (shared, a, b) = (noise(rng), noise(rng), noise(rng));
                let peak = Complex::from(c.sqrt() * (1.0 - d / 2.0));
                let early = (peak + shared * (1.0 - d).sqrt() + a * d.sqrt()).modulus();
                let late = (peak + shared * (1.0 - d).sqrt() + b * d.sqrt()).modulus();
                ((1.0 - d / 2.0) * (early - late) / (early + late)).powi(2)
            })
            .sum();
        CHIP_M * (sum / f64::from(count)).sqrt()
    }

    #[test]
    fn the_simulated_code_discriminator_agrees() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for (cn0_dbhz, ms, d) in [
            (45.0, 1.0, 1.0),
            (45.0, 1.0, 0.5),
            (45.0, 20.0, 1.0),
            (35.0, 20.0, 0.5),
            (30.0, 20.0, 0.2),
        ] {
            let c = signal_to_noise(cn0_dbhz, ms * 1e-3);
            let ratio = simulated_code_sigma_m(c, d, &mut rng)
                / code_variance_m2(cn0_dbhz, ms * 1e-3, d).sqrt();
            // Statistical error of a deviation from 20 000 samples is 0.5 %, three times that
            // above; the squaring term is generous by up to 4 % below.
            assert!(
                (0.945..1.015).contains(&ratio),
                "{cn0_dbhz} {ms} {d}: {ratio}"
            );
        }
    }

    #[test]
    fn the_simulated_phase_of_a_pair_agrees() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        for (cn0_dbhz, ms) in [(45.0, 1.0), (45.0, 20.0), (40.0, 2.0)] {
            let amplitude = Complex::from(signal_to_noise(cn0_dbhz, ms * 1e-3).sqrt());
            let count = 20_000;
            let sum: f64 = (0..count)
                .map(|_| {
                    let pair = (amplitude + noise(&mut rng)) * (amplitude + noise(&mut rng)).conj();
                    pair.argument().powi(2)
                })
                .sum();
            let phase = L1_WAVELENGTH_M / (TAU * ms * 1e-3);
            let sigma = phase * (sum / f64::from(count)).sqrt();
            let ratio = sigma / sum_pair_rate_variance_m2_s2(cn0_dbhz, ms * 1e-3).sqrt();
            // 0.5 % statistical; the third order of 1/c is 2 % at c = 20.
            assert!((0.98..1.03).contains(&ratio), "{cn0_dbhz} {ms}: {ratio}");
        }
    }

    #[test]
    fn the_slope_of_two_phases_is_their_difference() {
        let pair = carrier_rate_variance_m2_s2(45.0, 0.02, 2);
        // Two phases a sum apart: the pair without the product of their noises; rounding only.
        let c = signal_to_noise(45.0, 0.02);
        assert!((pair / sum_pair_rate_variance_m2_s2(45.0, 0.02) - 1.0).abs() < 1e-12 && c > 1.0);
        assert_eq!(carrier_rate_variance_m2_s2(45.0, 0.02, 1), f64::INFINITY);
        assert_eq!(carrier_rate_variance_m2_s2(45.0, 0.02, 0), f64::INFINITY);
        let halves = half_interval_rate_variance_m2_s2(45.0, 0.02);
        assert_eq!(halves, sum_pair_rate_variance_m2_s2(45.0, 0.01));
    }
}
