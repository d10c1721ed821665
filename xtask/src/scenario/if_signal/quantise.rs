//! From numbers to the bytes of a sample format.

use anyhow::{Result, ensure};
use gnss_signal::sample::SampleFormat;

use super::lanes::{self, Floats, Kernel};

/// Rms of a component in 8-bit units: clipping lies at 4.5 standard deviations, rounding costs
/// 0.0005 dB.
pub(in crate::scenario) const RMS_8_BIT: f32 = 28.0;
/// Rms of a component in 16-bit units: 16 standard deviations, for what comes on top of noise.
const RMS_16_BIT: f32 = 2000.0;
/// Steps of uniform quantisers of 2 to 7 bits over the rms, best for Gaussian noise (`Max1960`;
/// 2 bits: a loss of 0.55 dB).
pub(in crate::scenario) const STEPS: [f32; 6] = [0.996, 0.586, 0.335, 0.188, 0.104, 0.0569];

/// Turns components into bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quantiser {
    levels: Levels,
    layout: Layout,
}

/// How a number becomes a level.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Levels {
    /// The number.
    Float,
    /// The nearest integer to so many times the number, at most a largest one.
    Integers { per_rms: f32, largest: f32 },
    /// An odd integer: as far from 0 as so many steps of the number, and one.
    Odd { per_rms: f32, largest: f32 },
}

/// How a level is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Float32,
    Int16,
    /// A byte, with an offset.
    Byte(i8),
    Sign(Order),
    TwosComplement2(Order),
    SignMagnitude(Order),
}

/// Where in a byte the first of several components stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    MostSignificantFirst,
    LeastSignificantFirst,
}

impl Quantiser {
    /// A quantiser for `format`, of `bits` bits where that has room for more.
    ///
    /// # Errors
    /// Where a format cannot hold these bits.
    pub(super) fn new(format: SampleFormat, bits: Option<u8>) -> Result<Self> {
        use Order::{LeastSignificantFirst as Lsb, MostSignificantFirst as Msb};
        use SampleFormat as F;
        let (layout, room) = match format {
            F::Rf32Le | F::Cf32Le => (Layout::Float32, 32),
            F::Ri16Le | F::Ci16Le => (Layout::Int16, 16),
            F::Ri8 | F::Ci8 => (Layout::Byte(0), 8),
            F::Ru8 | F::Cu8 => (Layout::Byte(-128), 8),
            F::R1Msb | F::C1Msb => (Layout::Sign(Msb), 1),
            F::R1Lsb | F::C1Lsb => (Layout::Sign(Lsb), 1),
            F::R2Msb => (Layout::TwosComplement2(Msb), 2),
            F::R2Lsb => (Layout::TwosComplement2(Lsb), 2),
            F::R2smMsb => (Layout::SignMagnitude(Msb), 2),
            F::R2smLsb => (Layout::SignMagnitude(Lsb), 2),
            other => anyhow::bail!("samples cannot be made as {other}"),
        };
        let depth = bits.unwrap_or(room);
        let fits = depth == room || (matches!(room, 8 | 16) && matches!(depth, 1..=8));
        ensure!(
            fits,
            "quantiser of {depth} bits for {format}: expected {room}, or 1 to 8 where that is more"
        );
        let levels = match depth {
            32 => Levels::Float,
            16 => Levels::Integers {
                per_rms: RMS_16_BIT,
                largest: 32_767.0,
            },
            8 => Levels::Integers {
                per_rms: RMS_8_BIT,
                largest: 127.0,
            },
            1 => Levels::Odd {
                per_rms: 1.0,
                largest: 1.0,
            },
            _ => Levels::Odd {
                per_rms: 1.0 / STEPS[usize::from(depth) - 2],
                largest: ((1 << depth) - 1) as f32,
            },
        };
        Ok(Self { levels, layout })
    }

    /// Appends components in units of their rms. What does not fill a byte is padded with zeros:
    /// only the last call may end so.
    pub(super) fn append(&self, components: &[f32], out: &mut Vec<u8>) {
        lanes::run(Append {
            quantiser: self,
            components,
            out,
        });
    }
}

struct Append<'a> {
    quantiser: &'a Quantiser,
    components: &'a [f32],
    out: &'a mut Vec<u8>,
}

impl Kernel for Append<'_> {
    #[inline(always)]
    fn run<F: Floats>(self) {
        let Self {
            quantiser,
            components,
            out,
        } = self;
        let levels = quantiser.levels;
        match quantiser.layout {
            Layout::Float32 => out.extend(components.iter().flat_map(|x| x.to_le_bytes())),
            Layout::Int16 => levels.each::<2>(components, out, |level| {
                (low_bits(level) as u16).to_le_bytes()
            }),
            Layout::Byte(offset) => levels.each::<1>(components, out, |level| {
                [(low_bits(level) as u8).wrapping_add(offset as u8)]
            }),
            Layout::Sign(order) => packed::<8>(components, out, order, |x| u8::from(x >= 0.0)),
            // -3, -1, 1, 3 are -2, -1, 0, 1.
            Layout::TwosComplement2(order) => levels.pack(components, out, order, |level| {
                (low_bits(level) as u8 >> 1) & 3
            }),
            Layout::SignMagnitude(order) => levels.pack(components, out, order, |level| {
                u8::from(level < 0.0) << 1 | u8::from(level.abs() > 1.0)
            }),
        }
    }
}

impl Levels {
    /// Appends `N` bytes for every level.
    #[inline(always)]
    fn each<const N: usize>(
        self,
        components: &[f32],
        out: &mut Vec<u8>,
        write: impl Fn(f32) -> [u8; N],
    ) {
        let start = out.len();
        out.resize(start + N * components.len(), 0);
        let (places, _) = out[start..].as_chunks_mut::<N>();
        let pairs = places.iter_mut().zip(components);
        match self {
            Self::Float => pairs.for_each(|(place, x)| *place = write(*x)),
            Self::Integers { per_rms, largest } => {
                pairs.for_each(|(place, x)| *place = write(integer(*x, per_rms, largest)));
            }
            Self::Odd { per_rms, largest } => {
                pairs.for_each(|(place, x)| *place = write(odd(*x, per_rms, largest)));
            }
        }
    }

    /// Appends levels of two bits, four to a byte.
    #[inline(always)]
    fn pack(self, components: &[f32], out: &mut Vec<u8>, order: Order, code: impl Fn(f32) -> u8) {
        // Two bits have odd levels.
        if let Self::Odd { per_rms, largest } = self {
            packed::<4>(components, out, order, |x| code(odd(x, per_rms, largest)));
        }
    }
}

/// Appends codes of `8 / N` bits, `N` to a byte.
#[inline(always)]
fn packed<const N: usize>(
    components: &[f32],
    out: &mut Vec<u8>,
    order: Order,
    code: impl Fn(f32) -> u8,
) {
    /// Bytes made together: their codes stay in the nearest cache.
    const TOGETHER: usize = 128;
    let bits = 8 / N;
    let mut codes = [[0_u8; N]; TOGETHER];
    for components in components.chunks(N * TOGETHER) {
        let bytes = components.len().div_ceil(N);
        let flat = codes.as_flattened_mut();
        for (code_at, x) in flat.iter_mut().zip(components) {
            *code_at = code(*x);
        }
        flat[components.len()..].fill(0);
        out.extend(codes[..bytes].iter().map(|codes| {
            let places = codes.iter().enumerate();
            places.fold(0, |byte, (k, code)| {
                byte | match order {
                    Order::LeastSignificantFirst => code << (bits * k),
                    Order::MostSignificantFirst => code << (8 - bits * (k + 1)),
                }
            })
        }));
    }
}

/// The nearest integer to a number times `per_rms`, at most `largest`.
#[inline(always)]
fn integer(x: f32, per_rms: f32, largest: f32) -> f32 {
    nearest((x * per_rms).clamp(-largest, largest))
}

/// The odd integer as far from 0 as a number in steps, at most `largest`.
#[inline(always)]
fn odd(x: f32, per_rms: f32, largest: f32) -> f32 {
    (2.0 * (x * per_rms).floor() + 1.0).clamp(-largest, largest)
}

/// What added to a number below 2^22 leaves its nearest integer in the lowest bits.
const HOLDS_INTEGERS: f32 = 12_582_912.0;

/// The nearest integer (an even one half way) to a number below 2^22: what adding and taking off
/// 3 2^22 leaves, on every processor in two instructions.
#[inline(always)]
fn nearest(x: f32) -> f32 {
    x + HOLDS_INTEGERS - HOLDS_INTEGERS
}

/// The lowest bits of an integer below 2^22 in two's complement (more cheaply than by `as`, which
/// looks for numbers too large).
#[inline(always)]
fn low_bits(integer: f32) -> u32 {
    (integer + HOLDS_INTEGERS).to_bits()
}

#[cfg(test)]
mod tests {
    use gnss_signal::sample::{ReaderSource, SampleDescription, SampleRing};

    use super::*;

    fn bytes(format: SampleFormat, bits: Option<u8>, values: &[f32]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let quantiser = Quantiser::new(format, bits).unwrap();
        quantiser.append(values, &mut bytes);
        bytes
    }

    /// What the receiver makes of the bytes.
    fn read_back(format: SampleFormat, bits: Option<u8>, values: &[f32]) -> Vec<i8> {
        let bytes = bytes(format, bits, values);
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

    const VALUES: [f32; 8] = [0.1, -0.2, 1.5, -9.0, 9.0, -1.2, 0.5, -0.5];

    #[test]
    fn the_receiver_reads_what_was_meant() {
        use SampleFormat::*;
        for format in [Ri8, Ci8, Ru8, Cu8] {
            let read = read_back(format, None, &VALUES);
            assert_eq!(read, [3, -6, 42, -127, 127, -34, 14, -14]);
        }
        for format in [R1Msb, R1Lsb, C1Msb, C1Lsb] {
            let read = read_back(format, None, &VALUES);
            assert_eq!(read, [1, -1, 1, -1, 1, -1, 1, -1]);
        }
        for format in [R2Msb, R2Lsb, R2smMsb, R2smLsb] {
            let read = read_back(format, None, &VALUES);
            assert_eq!(read, [1, -1, 3, -3, 3, -3, 1, -1]);
        }
    }

    #[test]
    fn wide_formats_keep_the_numbers() {
        let words = bytes(SampleFormat::Ci16Le, None, &VALUES);
        let words = words
            .chunks_exact(2)
            .map(|b| i16::from_le_bytes([b[0], b[1]]));
        let expected = [200, -400, 3000, -18_000, 18_000, -2400, 1000, -1000];
        assert_eq!(words.collect::<Vec<_>>(), expected);
        let floats = bytes(SampleFormat::Rf32Le, None, &VALUES);
        let floats = floats
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        assert_eq!(floats.collect::<Vec<_>>(), VALUES);
    }

    #[test]
    fn fewer_bits_than_a_byte_are_odd_levels() {
        // Steps of 0.335 from 0 up to 7 of them.
        let read = read_back(SampleFormat::Ri8, Some(4), &VALUES);
        assert_eq!(read, [1, -1, 9, -15, 15, -7, 3, -3]);
        let read = read_back(SampleFormat::Cu8, Some(2), &VALUES);
        assert_eq!(read, [1, -1, 3, -3, 3, -3, 1, -1]);
    }

    #[test]
    fn an_unfinished_byte_is_padded() {
        assert_eq!(bytes(SampleFormat::R1Lsb, None, &[1.0, -1.0, 1.0]), [0b101]);
        assert_eq!(
            bytes(SampleFormat::R1Msb, None, &[1.0, -1.0, 1.0]),
            [0b1010_0000]
        );
        assert_eq!(bytes(SampleFormat::R2Msb, None, &[9.0]), [0b0100_0000]);
    }

    #[test]
    fn depths_a_format_cannot_hold_are_refused() {
        for (format, bits) in [
            (SampleFormat::R2Lsb, 1),
            (SampleFormat::Ri8, 0),
            (SampleFormat::Ci8, 9),
            (SampleFormat::Cf32Le, 8),
        ] {
            assert!(Quantiser::new(format, Some(bits)).is_err(), "{format}");
        }
    }

    #[test]
    fn low_bits_are_those_of_the_integer() {
        for integer in [-32_767_i16, -128, -3, -1, 0, 1, 5, 127, 32_767] {
            assert_eq!(low_bits(f32::from(integer)) as u16 as i16, integer);
        }
    }

    #[test]
    fn integers_are_the_nearest() {
        for (x, expected) in [(2.4, 2.0), (-2.6, -3.0), (2.5, 2.0), (-32_767.0, -32_767.0)] {
            assert_eq!(nearest(x), expected);
        }
    }
}
