//! Stored bytes to 8-bit sample values.

use super::format::{BitOrder, Component, SampleFormat};

/// Turns the bytes a [`SampleRing`](super::SampleRing) stores into 8-bit values, I and Q
/// interleaved where complex.
#[derive(Debug, Clone)]
pub(super) enum Unpacker {
    /// One byte a component.
    Bytes { zero: u8, swap_iq: bool },
    /// Several components a byte: the values of each byte in order.
    Packed(Box<[[i8; 8]; 256]>, usize),
}

impl Unpacker {
    /// Unpacker for `format` as it is stored: wide formats are already reduced to signed bytes.
    pub(super) fn new(format: SampleFormat, swap_iq: bool) -> Self {
        let swap_iq = swap_iq && format.is_complex();
        match format.component() {
            Component::Int8 | Component::Int16 | Component::Float32 => {
                Self::Bytes { zero: 0, swap_iq }
            }
            Component::Uint8 => Self::Bytes { zero: 128, swap_iq },
            Component::Sign(order) => {
                Self::packed(1, order, swap_iq, |bit| if bit == 1 { 1 } else { -1 })
            }
            Component::TwosComplement2(order) => {
                Self::packed(2, order, swap_iq, |pair| [1, 3, -3, -1][pair])
            }
            Component::SignMagnitude(order) => {
                Self::packed(2, order, swap_iq, |pair| [1, 3, -1, -3][pair])
            }
        }
    }

    fn packed(bits: usize, order: BitOrder, swap_iq: bool, value: fn(usize) -> i8) -> Self {
        let per_byte = 8 / bits;
        let mut table = Box::new([[0; 8]; 256]);
        for (byte, values) in table.iter_mut().enumerate() {
            for (k, out) in values.iter_mut().take(per_byte).enumerate() {
                let k = k ^ usize::from(swap_iq);
                let shift = match order {
                    BitOrder::LeastSignificantFirst => k * bits,
                    BitOrder::MostSignificantFirst => 8 - bits - k * bits,
                };
                *out = value(byte >> shift & ((1 << bits) - 1));
            }
        }
        Self::Packed(table, per_byte)
    }

    /// Values in one stored byte.
    pub(super) const fn values_per_byte(&self) -> usize {
        match self {
            Self::Bytes { .. } => 1,
            Self::Packed(_, per_byte) => *per_byte,
        }
    }

    /// Appends the values of `bytes`; where complex, `bytes` holds whole samples.
    pub(super) fn append(&self, bytes: &[u8], out: &mut Vec<i8>) {
        match self {
            Self::Bytes {
                zero,
                swap_iq: false,
            } => {
                out.extend(bytes.iter().map(|&byte| signed(byte, *zero)));
            }
            Self::Bytes {
                zero,
                swap_iq: true,
            } => {
                out.extend(
                    bytes
                        .chunks_exact(2)
                        .flat_map(|iq| [signed(iq[1], *zero), signed(iq[0], *zero)]),
                );
            }
            Self::Packed(table, 8) => append_packed::<8>(table, bytes, out),
            Self::Packed(table, _) => append_packed::<4>(table, bytes, out),
        }
    }
}

/// The value of a byte whose zero stands at `zero`, kept within -127 to 127: kernels negate values.
fn signed(byte: u8, zero: u8) -> i8 {
    (byte.wrapping_sub(zero) as i8).max(-127)
}

fn append_packed<const N: usize>(table: &[[i8; 8]; 256], bytes: &[u8], out: &mut Vec<i8>) {
    let start = out.len();
    out.resize(start + bytes.len() * N, 0);
    for (values, &byte) in out[start..].chunks_exact_mut(N).zip(bytes) {
        values.copy_from_slice(&table[usize::from(byte)][..N]);
    }
}
