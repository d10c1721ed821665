//! The definition of the correlator sums, in `f64` and sample by sample.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::{FrontEnd, Replica, ranging_code};

/// Sums of `replica` over `samples`, one for each tap offset.
pub(super) fn correlate(
    front_end: FrontEnd,
    samples: &[i8],
    replica: &Replica,
    sums: &mut [Complex64],
) {
    let components = if front_end.complex { 2 } else { 1 };
    let code = ranging_code(replica.signal);
    let code_step_chips = replica.code_rate_hz / front_end.sample_rate_hz;
    let carrier_step_cycles = replica.carrier_frequency_hz / front_end.sample_rate_hz;
    for (n, sample) in samples.chunks_exact(components).enumerate() {
        let quadrature = sample.get(1).copied().unwrap_or(0);
        let x = Complex64::new(f64::from(sample[0]), f64::from(quadrature));
        let cycles = (replica.carrier_phase_cycles + n as f64 * carrier_step_cycles).fract();
        let baseband = x * Complex64::cis(-TAU * cycles);
        let phase_chips = replica.code_phase_chips + n as f64 * code_step_chips;
        for (sum, offset_chips) in sums.iter_mut().zip(replica.tap_offsets.as_slice()) {
            let chip = (phase_chips - offset_chips)
                .floor()
                .rem_euclid(code.len() as f64);
            *sum += baseband * f64::from(code[chip as usize]);
        }
    }
}
