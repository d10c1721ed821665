//! Interference as correlators meet it: power at the quantiser, density at the code.
//!
//! Its correlator sums are drawn as Gaussian noise of their mean power over an interval: the
//! overlap of its spectrum with the code's at the replica's Doppler, lines of the code blurred.
//! That holds for broadband noise at least as wide as the code; a tone meets single lines of
//! the code (1 kHz apart) in truth, and a sum over an interval then keeps its phase, so that
//! single satellites see up to some 10 dB more or less than drawn here, and steadily. Taps
//! correlate as in white noise. The quantiser takes it for Gaussian, which underrates its harm to
//! one bit where it exceeds the noise.

use super::front_end::{FrontEndModel, code_spectrum_s};
use crate::scenario::antenna::{Interference, Waveform};

/// Steps of a mean over frequency.
const STEPS: usize = 200;

/// An [`Interference`] behind a front end.
#[derive(Debug, Clone)]
pub(super) struct Interferer {
    source: Interference,
    /// Part of its power that the filter passes.
    passed: f64,
    overlap: Overlap,
}

/// Overlap with the spectrum of the code, s.
#[derive(Debug, Clone, Copy)]
enum Overlap {
    /// A tone: offset, Hz, and the filter's power gain.
    Line(f64, f64),
    /// The same at every Doppler.
    Even(f64),
}

/// What interferes over an interval, in units of the thermal noise density, Hz.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Heard {
    /// Mean power behind the filter.
    pub(super) power_hz: f64,
    /// Mean density at the code, weighted by its spectrum (no unit).
    pub(super) density: f64,
}

impl Interferer {
    pub(super) fn new(source: Interference, front_end: &FrontEndModel) -> Self {
        let (passed, overlap) = match source.waveform {
            Waveform::Tone { offset_hz } => {
                let gain = front_end.filter_gain(offset_hz).powi(2);
                (gain, Overlap::Line(offset_hz, gain))
            }
            Waveform::Chirp { from_hz, to_hz, .. } => spread(front_end, from_hz, to_hz),
            Waveform::Broadband { width_hz } => {
                // The band whose noise is that of the samples.
                let band_hz = front_end.noise_power / front_end.power_scale;
                if width_hz < band_hz {
                    spread(front_end, -0.5 * width_hz, 0.5 * width_hz)
                } else {
                    let overlap_s = front_end.thermal_density / width_hz;
                    (band_hz / width_hz, Overlap::Even(overlap_s))
                }
            }
        };
        Self {
            source,
            passed,
            overlap,
        }
    }

    /// What is heard from `begin_s` to `end_s` at a Doppler.
    pub(super) fn over(&self, begin_s: f64, end_s: f64, doppler_hz: f64) -> Heard {
        let on = self.on_part(begin_s, end_s);
        if on == 0.0 {
            return Heard::default();
        }
        let (first, last) = self.source.level_dbhz.span_s();
        let middle_s = 0.5 * (begin_s.max(first) + end_s.min(last));
        let power_hz = on * 10f64.powf(self.source.level_dbhz.at(middle_s) / 10.0);
        let overlap_s = match self.overlap {
            Overlap::Line(offset_hz, gain) => gain * code_spectrum_s(offset_hz - doppler_hz),
            Overlap::Even(overlap_s) => overlap_s,
        };
        Heard {
            power_hz: power_hz * self.passed,
            density: power_hz * overlap_s,
        }
    }

    /// Part of the time from `begin_s` to `end_s` for which it is on.
    fn on_part(&self, begin_s: f64, end_s: f64) -> f64 {
        let (first, last) = self.source.level_dbhz.span_s();
        let (from, to) = (begin_s.max(first), end_s.min(last));
        if to <= from {
            return 0.0;
        }
        let on_s = self.source.pulses.map_or(to - from, |pulses| {
            let until = |t: f64| {
                let turns = (t - first) / pulses.period_s;
                pulses.period_s * (turns.floor() * pulses.duty + turns.fract().min(pulses.duty))
            };
            until(to) - until(from)
        });
        on_s / (end_s - begin_s)
    }
}

/// Power spread evenly over frequencies: the part passed, and the overlap.
fn spread(front_end: &FrontEndModel, from_hz: f64, to_hz: f64) -> (f64, Overlap) {
    let (mut passed, mut overlap_s) = (0.0, 0.0);
    for k in 0..STEPS {
        let f_hz = from_hz + (to_hz - from_hz) * (k as f64 + 0.5) / STEPS as f64;
        let gain = front_end.filter_gain(f_hz).powi(2) / STEPS as f64;
        passed += gain;
        overlap_s += gain * code_spectrum_s(f_hz);
    }
    (passed, Overlap::Even(overlap_s))
}

#[cfg(test)]
mod tests {
    use gnss_signal::sample::{SampleDescription, SampleFormat};

    use super::*;
    use crate::scenario::antenna::{Gain, Pulses, Reception};
    use crate::scenario::profile::Profile;

    fn interferer(waveform: Waveform, pulses: Option<Pulses>) -> Interferer {
        let reception = Reception {
            samples: SampleDescription {
                format: SampleFormat::Ci8,
                sample_rate_hz: 4e6,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            bandwidth_hz: None,
            bits: None,
            gain: Gain::Fixed,
        };
        let source = Interference {
            waveform,
            level_dbhz: Profile::new(vec![(1.0, 60.0), (2.0, 60.0)]).unwrap(),
            pulses,
        };
        Interferer::new(source, &FrontEndModel::new(&reception, 0.0).unwrap())
    }

    #[test]
    fn pulses_are_on_for_their_part_of_the_time() {
        let pulses = Pulses {
            period_s: 1e-3,
            duty: 0.25,
        };
        let tone = interferer(Waveform::Tone { offset_hz: 0.0 }, Some(pulses));
        for (begin, end, part) in [
            (0.0, 1.0, 0.0),
            (1.0, 1.1, 0.25),
            (1.000_1, 1.000_3, 0.75),
            (0.999, 1.001, 0.125),
            (2.0, 2.5, 0.0),
        ] {
            // Rounding of instants over a microsecond.
            assert!((tone.on_part(begin, end) - part).abs() < 1e-9);
        }
    }

    #[test]
    fn densities_are_power_times_overlap() {
        let tone = interferer(Waveform::Tone { offset_hz: 2e3 }, None).over(1.2, 1.21, 2e3);
        // On the carrier: one over the chip rate.
        assert!((tone.density - 1e6 / 1.023e6).abs() < 1e-9);
        assert!((tone.power_hz - 1e6).abs() < 1e-3);
        let noise = interferer(Waveform::Broadband { width_hz: 8e6 }, None);
        let noise = noise.over(1.2, 1.21, 0.0);
        assert!((noise.density - 1e6 / 8e6).abs() < 1e-12);
        // Half of its band is sampled.
        assert!((noise.power_hz - 0.5e6).abs() < 1e-3);
        let null = interferer(Waveform::Tone { offset_hz: 1.023e6 }, None);
        assert!(null.over(1.2, 1.21, 0.0).density < 1e-9);
    }
}
