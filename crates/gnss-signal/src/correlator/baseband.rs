//! What is left of the samples of a chunk once the carrier is wiped off.

use super::carrier_table::CHUNK_SAMPLES;

/// Baseband of one chunk, with zeros around it.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Baseband {
    i: [i8; PADDED],
    q: [i8; PADDED],
}

/// Zeros before and after the baseband of a chunk.
pub(super) const PAD: usize = 64;

const PADDED: usize = PAD + CHUNK_SAMPLES + PAD;

impl Baseband {
    pub(super) const fn zeroed() -> Self {
        Self {
            i: [0; PADDED],
            q: [0; PADDED],
        }
    }

    /// In-phase and quadrature part.
    #[inline(always)]
    pub(super) fn parts(&self) -> [&[i8]; 2] {
        [&self.i, &self.q].map(|part| &part[PAD..PAD + CHUNK_SAMPLES])
    }

    #[inline(always)]
    pub(super) fn parts_mut(&mut self) -> [&mut [i8]; 2] {
        [&mut self.i, &mut self.q].map(|part| &mut part[PAD..PAD + CHUNK_SAMPLES])
    }

    /// Both parts with the zeros before and after them, the chunk being `len` samples long.
    #[inline(always)]
    pub(super) fn padded(&mut self, len: usize) -> [&[i8; PADDED]; 2] {
        for part in [&mut self.i, &mut self.q] {
            part[PAD + len..][..PAD].fill(0);
        }
        [&self.i, &self.q]
    }
}
