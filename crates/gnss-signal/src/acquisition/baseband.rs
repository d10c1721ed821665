//! Reduces samples of any rate, kind and intermediate frequency to complex baseband at the
//! acquisition rate.
//!
//! Every output is one dot product of raw samples with a low-pass whose taps carry the carrier
//! wipe-off, taken from the phase of a polyphase table nearest to the output's instant. So rates
//! that share no small ratio with the acquisition rate need no special case.

use num_complex::{Complex32, Complex64};

use crate::FrontEnd;

/// Sub-sample positions of the low-pass: 1/32 input sample of timing rounds to -37 dB of noise at
/// the worst (2 Msps, band edge).
const PHASES: usize = 32;
/// Half length of the low-pass, periods of its cut-off rate. The code has next to no power near
/// the band edge (its spectrum ends in a null there), so a wide transition costs nothing.
const HALF_LENGTH_PERIODS: f64 = 2.0;
/// Products summed side by side; also the unit to which the taps are padded.
const LANES: usize = 16;

/// Carrier wipe-off, low-pass and rate change in one step.
#[derive(Debug, Clone)]
pub(super) struct Baseband {
    front_end: FrontEnd,
    output_rate_hz: f64,
    taps: usize,
    /// Coefficients of the real and of the imaginary part for every value of the window.
    phases: Vec<(Vec<f32>, Vec<f32>)>,
    /// Low-pass of the zeroth phase without carrier, for [`Self::response`].
    prototype: Vec<f64>,
}

impl Baseband {
    pub(super) fn new(front_end: FrontEnd, output_rate_hz: f64) -> Self {
        let cut_off_rate_hz = output_rate_hz.min(front_end.sample_rate_hz);
        let periods = front_end.sample_rate_hz / cut_off_rate_hz;
        let taps = (2.0 * HALF_LENGTH_PERIODS * periods).ceil() as usize + 1;
        let phases = (0..PHASES)
            .map(|phase| {
                let offset = phase as f64 / PHASES as f64;
                coefficients(&low_pass(taps, periods, offset), front_end)
            })
            .collect();
        Self {
            front_end,
            output_rate_hz,
            taps,
            phases,
            prototype: low_pass(taps, periods, 0.0),
        }
    }

    /// Amplitude response at `frequency_hz` from the centre of the band.
    pub(super) fn response(&self, frequency_hz: f64) -> f64 {
        let cycles_per_sample = frequency_hz / self.front_end.sample_rate_hz;
        self.prototype
            .iter()
            .enumerate()
            .map(|(k, h)| {
                let samples = k as f64 - (self.taps / 2) as f64;
                h * (std::f64::consts::TAU * cycles_per_sample * samples).cos()
            })
            .sum()
    }

    /// The first `outputs` samples at the acquisition rate; zero is put where `raw` has no samples.
    pub(super) fn reduce(&self, raw: &[i8], outputs: usize) -> Vec<Complex32> {
        let values_per_sample = if self.front_end.complex { 2 } else { 1 };
        let step = self.front_end.sample_rate_hz / self.output_rate_hz;
        let cycles_per_sample =
            self.front_end.intermediate_frequency_hz / self.front_end.sample_rate_hz;
        let window = self.phases[0].0.len();
        let mut edge = vec![0_i8; window];
        (0..outputs)
            .map(|n| {
                let (whole, phase) = nearest_phase(n as f64 * step);
                let first = (whole - (self.taps / 2) as i64) * values_per_sample;
                let values = match usize::try_from(first) {
                    Ok(start) if start + window <= raw.len() => &raw[start..start + window],
                    _ => {
                        copy_with_zeros(raw, first, &mut edge);
                        &edge[..]
                    }
                };
                let (re, im) = &self.phases[phase];
                let sum = dot(values, re, im);
                let cycles = (cycles_per_sample * whole as f64).fract();
                let carrier = Complex64::from_polar(1.0, -std::f64::consts::TAU * cycles);
                sum * Complex32::new(carrier.re as f32, carrier.im as f32)
            })
            .collect()
    }
}

/// Whole sample and polyphase index nearest to `position`, samples.
fn nearest_phase(position: f64) -> (i64, usize) {
    let steps = (position * PHASES as f64).round() as i64;
    let phases = PHASES as i64;
    (steps.div_euclid(phases), steps.rem_euclid(phases) as usize)
}

/// Hann-windowed sinc of unit gain, delayed by `offset` samples from its middle tap; `periods` is
/// the length of one cut-off period in samples.
fn low_pass(taps: usize, periods: f64, offset: f64) -> Vec<f64> {
    let half_length = HALF_LENGTH_PERIODS * periods + 1.0;
    let shape: Vec<f64> = (0..taps)
        .map(|k| {
            let samples = k as f64 - (taps / 2) as f64 - offset;
            let x = std::f64::consts::PI * samples / periods;
            let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
            let window = (std::f64::consts::FRAC_PI_2 * (samples / half_length).clamp(-1.0, 1.0))
                .cos()
                .powi(2);
            sinc * window
        })
        .collect();
    let gain: f64 = shape.iter().sum();
    shape.iter().map(|h| h / gain).collect()
}

/// Coefficients that multiply the raw values (I, Q, I, Q, .. where complex) of one window.
fn coefficients(low_pass: &[f64], front_end: FrontEnd) -> (Vec<f32>, Vec<f32>) {
    let cycles_per_sample = front_end.intermediate_frequency_hz / front_end.sample_rate_hz;
    let middle = (low_pass.len() / 2) as f64;
    let (mut re, mut im) = (Vec::new(), Vec::new());
    for (k, h) in low_pass.iter().enumerate() {
        let cycles = cycles_per_sample * (k as f64 - middle);
        let tap = Complex64::from_polar(*h, -std::f64::consts::TAU * cycles);
        re.push(tap.re as f32);
        im.push(tap.im as f32);
        if front_end.complex {
            re.push(-tap.im as f32);
            im.push(tap.re as f32);
        }
    }
    let padded = re.len().next_multiple_of(LANES);
    re.resize(padded, 0.0);
    im.resize(padded, 0.0);
    (re, im)
}

fn copy_with_zeros(raw: &[i8], first: i64, window: &mut [i8]) {
    for (value, index) in window.iter_mut().zip(first..) {
        *value = usize::try_from(index)
            .ok()
            .and_then(|index| raw.get(index).copied())
            .unwrap_or(0);
    }
}

fn dot(values: &[i8], re: &[f32], im: &[f32]) -> Complex32 {
    let (mut sum_re, mut sum_im) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    let coefficients = re.chunks_exact(LANES).zip(im.chunks_exact(LANES));
    for (values, (re, im)) in values.chunks_exact(LANES).zip(coefficients) {
        for lane in 0..LANES {
            let value = f32::from(values[lane]);
            sum_re[lane] += value * re[lane];
            sum_im[lane] += value * im[lane];
        }
    }
    Complex32::new(sum_re.iter().sum(), sum_im.iter().sum())
}
