//! Band-limited spectrum of one code period.

use num_complex::{Complex32, Complex64};
use rustfft::FftPlanner;

use super::POINTS;
use crate::ca_code::ranging_code;
use crate::{Signal, SignalId};

/// Conjugated spectrum of one period of rectangular chips, cut to the band of [`POINTS`] samples a
/// period: entry k is the line at k (or k - [`POINTS`]) periods^-1.
///
/// The lines are exact (transform of the chip sequence times the sinc of a chip), so nothing
/// aliases in as it would by sampling the chips.
pub(super) fn conjugated(signal: SignalId) -> Vec<Complex32> {
    let mut chips: Vec<Complex64> = ranging_code(signal)
        .iter()
        .map(|chip| Complex64::new(f64::from(*chip), 0.0))
        .collect();
    let length = chips.len();
    FftPlanner::new()
        .plan_fft_forward(length)
        .process(&mut chips);
    let mut spectrum = vec![Complex32::default(); POINTS];
    let half = POINTS as i64 / 2;
    for line in 1 - half..half {
        let chip_line = chips[line.rem_euclid(length as i64) as usize];
        let value = chip_line * chip_transform(line as f64 / length as f64);
        spectrum[line.rem_euclid(POINTS as i64) as usize] =
            Complex32::new(value.re as f32, -value.im as f32);
    }
    spectrum
}

/// Transform of one rectangular chip that begins at zero; `x` in cycles per chip.
fn chip_transform(x: f64) -> Complex64 {
    let half_turn = std::f64::consts::PI * x;
    let sinc = if half_turn.abs() < 1e-12 {
        1.0
    } else {
        half_turn.sin() / half_turn
    };
    Complex64::from_polar(sinc, -half_turn)
}

/// Part of a signal's C/N0 that is left by a front end of amplitude response `response` (over Hz
/// from the carrier) and a replica cut to the acquisition band.
pub(super) fn band_gain(response: impl Fn(f64) -> f64) -> f64 {
    let spec = Signal::GpsL1Ca.spec();
    let line_hz = 1.0 / spec.code_period_s();
    let half = POINTS as i64 / 2;
    let (mut signal, mut noise) = (0.0, 0.0);
    for line in 1 - half..half {
        let frequency_hz = line as f64 * line_hz;
        let power = chip_transform(frequency_hz / spec.code_rate_hz).norm_sqr();
        let gain = response(frequency_hz);
        signal += gain * power;
        noise += gain * gain * power;
    }
    // All lines of a rectangular chip together have the power of one chip rate of flat lines.
    signal * signal / (noise * f64::from(spec.code_length_chips))
}
