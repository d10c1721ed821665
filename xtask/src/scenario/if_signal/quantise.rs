//! From numbers to the bytes of a sample format.

use anyhow::{Result, bail};
use gnss_signal::sample::SampleFormat;

/// Rms of a component in 8-bit units: clipping lies at 4.5 standard deviations, rounding costs
/// 0.0005 dB.
pub(in crate::scenario) const RMS_8_BIT: f64 = 28.0;
/// Step of a 2-bit quantiser over the rms: the best for Gaussian noise (loss 0.55 dB).
pub(in crate::scenario) const STEP_2_BIT: f64 = 0.996;

/// Turns components into bytes; keeps the bits of an unfinished byte.
#[derive(Debug, Clone)]
pub(super) struct Quantiser {
    scale: f32,
    code: fn(f32) -> u8,
    bits: u32,
    most_significant_first: bool,
    partial: u8,
    filled: u32,
}

impl Quantiser {
    /// A quantiser for `format` of components with root mean square `rms`.
    pub(super) fn new(format: SampleFormat, rms: f64) -> Result<Self> {
        type Code = fn(f32) -> u8;
        let (code, bits, most_significant_first): (Code, u32, bool) = match format {
            SampleFormat::Ri8 | SampleFormat::Ci8 => (signed_byte, 8, true),
            SampleFormat::Ru8 | SampleFormat::Cu8 => (offset_byte, 8, true),
            SampleFormat::R1Msb | SampleFormat::C1Msb => (sign, 1, true),
            SampleFormat::R1Lsb | SampleFormat::C1Lsb => (sign, 1, false),
            SampleFormat::R2Msb => (twos_complement, 2, true),
            SampleFormat::R2Lsb => (twos_complement, 2, false),
            SampleFormat::R2smMsb => (sign_magnitude, 2, true),
            SampleFormat::R2smLsb => (sign_magnitude, 2, false),
            other => bail!("samples are made with 1, 2 or 8 bits a component, not as {other}"),
        };
        let scale = match bits {
            8 => RMS_8_BIT / rms,
            _ => 1.0 / (STEP_2_BIT * rms),
        };
        Ok(Self {
            scale: scale as f32,
            code,
            bits,
            most_significant_first,
            partial: 0,
            filled: 0,
        })
    }

    /// Appends one component.
    pub(super) fn push(&mut self, value: f32, out: &mut Vec<u8>) {
        let code = (self.code)(value * self.scale);
        if self.bits == 8 {
            out.push(code);
            return;
        }
        let shift = if self.most_significant_first {
            8 - self.bits - self.filled
        } else {
            self.filled
        };
        self.partial |= code << shift;
        self.filled += self.bits;
        if self.filled == 8 {
            self.finish(out);
        }
    }

    /// Appends the unfinished byte, if there is one, padded with zeros.
    pub(super) fn finish(&mut self, out: &mut Vec<u8>) {
        if self.filled > 0 {
            out.push(self.partial);
        }
        (self.partial, self.filled) = (0, 0);
    }
}

fn signed_byte(x: f32) -> u8 {
    x.round().clamp(-127.0, 127.0) as i8 as u8
}

fn offset_byte(x: f32) -> u8 {
    signed_byte(x).wrapping_add(128)
}

fn sign(x: f32) -> u8 {
    u8::from(x >= 0.0)
}

fn twos_complement(x: f32) -> u8 {
    x.floor().clamp(-2.0, 1.0) as i8 as u8 & 3
}

fn sign_magnitude(x: f32) -> u8 {
    u8::from(x < 0.0) << 1 | u8::from(x.abs() >= 1.0)
}

#[cfg(test)]
mod tests {
    use gnss_signal::sample::{ReaderSource, SampleDescription, SampleRing};

    use super::*;

    /// What the receiver makes of the bytes.
    fn read_back(format: SampleFormat, values: &[f32]) -> Vec<i8> {
        let mut quantiser = Quantiser::new(format, 1.0).unwrap();
        let mut bytes = Vec::new();
        values.iter().for_each(|v| quantiser.push(*v, &mut bytes));
        quantiser.finish(&mut bytes);
        let description = SampleDescription {
            format,
            sample_rate_hz: 1e6,
            intermediate_frequency_hz: 0.0,
            swap_iq: false,
        };
        let source = ReaderSource::new(bytes.as_slice(), description);
        let mut ring = SampleRing::new(source, 0.1).unwrap();
        let end = ring
            .advance_to((values.len() / format.components()) as u64)
            .unwrap();
        let mut out = Vec::new();
        ring.unpack(0, end, &mut out).unwrap();
        out.truncate(values.len());
        out
    }

    #[test]
    fn the_receiver_reads_what_was_meant() {
        let values = [0.1, -0.2, 1.5, -9.0, 9.0, -1.2, 0.5, -0.5];
        for format in [
            SampleFormat::Ri8,
            SampleFormat::Ci8,
            SampleFormat::Ru8,
            SampleFormat::Cu8,
        ] {
            assert_eq!(
                read_back(format, &values),
                [3, -6, 42, -127, 127, -34, 14, -14]
            );
        }
        use SampleFormat::{C1Lsb, C1Msb, R1Lsb, R1Msb, R2Lsb, R2Msb, R2smLsb, R2smMsb};
        for format in [R1Msb, R1Lsb, C1Msb, C1Lsb] {
            assert_eq!(read_back(format, &values), [1, -1, 1, -1, 1, -1, 1, -1]);
        }
        for format in [R2Msb, R2Lsb, R2smMsb, R2smLsb] {
            assert_eq!(read_back(format, &values), [1, -1, 3, -3, 3, -3, 1, -1]);
        }
    }

    #[test]
    fn wide_formats_are_refused() {
        assert!(Quantiser::new(SampleFormat::Cf32Le, 1.0).is_err());
    }
}
