//! Reduction of 16-bit and float samples to 8 bits.

use super::{SampleSource, format::Component};
use crate::SignalError;

/// Samples over which the gain is chosen.
pub(super) const GAIN_CHUNK_SAMPLES: usize = 4096;

/// Rms of a component after reduction that a new gain aims at: quantisation costs 0.0005 dB, and
/// 127 lies at 4.5 standard deviations of Gaussian noise.
const TARGET_RMS: f64 = 28.0;

/// The gain stays while the rms is within this range.
const HELD_RMS: std::ops::RangeInclusive<f64> = 22.0..=36.0;

/// Reads wide samples a gain chunk at a time.
#[derive(Debug)]
pub(super) struct WideReader {
    component: Component,
    components: usize,
    raw: Box<[u8]>,
    values: Vec<f32>,
    reduced: Vec<u8>,
    gain: GainControl,
}

impl WideReader {
    /// A reader for samples of `components` components, or none where those have at most 8 bits.
    pub(super) fn new(component: Component, components: usize) -> Option<Self> {
        let bytes = component.bits() / 8 * components;
        matches!(component, Component::Int16 | Component::Float32).then(|| Self {
            component,
            components,
            raw: vec![0; bytes * GAIN_CHUNK_SAMPLES].into_boxed_slice(),
            values: Vec::with_capacity(components * GAIN_CHUNK_SAMPLES),
            reduced: Vec::with_capacity(components * GAIN_CHUNK_SAMPLES),
            gain: GainControl::default(),
        })
    }

    /// The next chunk of samples, which starts at `start_tick`, as signed bytes; shorter than a
    /// whole chunk only at the end of the source.
    pub(super) fn next_chunk(
        &mut self,
        source: &mut impl SampleSource,
        start_tick: u64,
    ) -> Result<&[u8], SignalError> {
        let mut filled = 0;
        while filled < self.raw.len() {
            match source.read(&mut self.raw[filled..])? {
                0 => break,
                read => filled += read,
            }
        }
        let sample_bytes = self.raw.len() / GAIN_CHUNK_SAMPLES;
        let raw = &self.raw[..filled / sample_bytes * sample_bytes];
        self.values.clear();
        if self.component == Component::Int16 {
            let (pairs, _) = raw.as_chunks();
            self.values
                .extend(pairs.iter().map(|&b| f32::from(i16::from_le_bytes(b))));
        } else {
            let (words, _) = raw.as_chunks();
            self.values
                .extend(words.iter().map(|&b| f32::from_le_bytes(b)));
        }
        if let Some(bad) = self.values.iter().position(|value| !value.is_finite()) {
            let tick = start_tick + (bad / self.components) as u64;
            return Err(SignalError::NotFinite { tick });
        }
        self.gain.reduce(&self.values, &mut self.reduced);
        Ok(&self.reduced)
    }
}

/// Automatic gain control in steps of the fourth root of two, with hysteresis.
#[derive(Debug, Default)]
struct GainControl {
    gain: Option<f64>,
}

impl GainControl {
    /// Replaces `out` by the values of one chunk as signed bytes, -127 to 127.
    fn reduce(&mut self, values: &[f32], out: &mut Vec<u8>) {
        let gain = self.follow(values);
        out.clear();
        out.extend(values.iter().map(|&value| {
            let scaled = (f64::from(value) * gain).round().clamp(-127.0, 127.0);
            scaled as i8 as u8
        }));
    }

    fn follow(&mut self, values: &[f32]) -> f64 {
        let square_sum: f64 = values.iter().map(|&v| f64::from(v) * f64::from(v)).sum();
        let rms = (square_sum / values.len().max(1) as f64).sqrt();
        match self.gain.filter(|gain| HELD_RMS.contains(&(rms * gain))) {
            Some(gain) => gain,
            // Silence says nothing about the level.
            None if rms == 0.0 => self.gain.unwrap_or(1.0),
            None => {
                let quarter_octaves = ((TARGET_RMS / rms).log2() * 4.0).round();
                *self.gain.insert((quarter_octaves / 4.0).exp2())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rms(bytes: &[u8]) -> f64 {
        let sum: i64 = bytes.iter().map(|&b| i64::from(b as i8).pow(2)).sum();
        (sum as f64 / bytes.len() as f64).sqrt()
    }

    #[test]
    fn any_level_is_brought_into_range() {
        for level in [1e-44_f32, 1e-3, 1.0, 900.0, 2e38] {
            let values: Vec<f32> = (0..4096)
                .map(|i| level * ((i * 37 % 101) as f32 / 50.0 - 1.0))
                .collect();
            let mut out = Vec::new();
            GainControl::default().reduce(&values, &mut out);
            // Half a gain step of 2^(1/8) about the target, and the rounding of 1e-44 to a
            // multiple of the smallest float.
            assert!((25.0..=31.5).contains(&rms(&out)), "{level}: {}", rms(&out));
        }
    }

    #[test]
    fn the_gain_holds_while_the_level_changes_little() {
        let mut control = GainControl::default();
        let gains = [100.0, 115.0, 90.0, 200.0, 0.0].map(|level| control.follow(&[level; 64]));
        assert_eq!(gains[0], gains[1]);
        assert_eq!(gains[0], gains[2]);
        assert!(gains[3] < 0.6 * gains[0]);
        assert_eq!(gains[3], gains[4]);
    }

    #[test]
    fn outliers_are_clipped_symmetrically() {
        let mut values = [1.0_f32; 4096];
        (values[0], values[1]) = (-50.0, 50.0);
        let mut out = Vec::new();
        GainControl::default().reduce(&values, &mut out);
        assert_eq!((out[0] as i8, out[1] as i8), (-127, 127));
    }
}
