//! The data of a subframe: ten words of 24 bits, addressed as IS-GPS-200 numbers them.

/// Data words of a subframe, each in the low 24 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct DataWords(pub(super) [u32; 10]);

/// A run of bits in a subframe: number of the first one (1 to 300, parity bits counted) and length;
/// it must not reach into the parity bits.
pub(super) type Run = (u32, u32);

impl DataWords {
    /// Words 3 to 10 filled with ones and zeros in turn, as unused data bits are sent.
    pub(super) const FILLER: Self = Self([
        0, 0, 0xAA_AAAA, 0xAA_AAAA, 0xAA_AAAA, 0xAA_AAAA, 0xAA_AAAA, 0xAA_AAAA, 0xAA_AAAA,
        0xAA_AAAA,
    ]);

    /// The bits of a run, the first one most significant.
    pub(super) const fn bits(&self, (first, length): Run) -> u32 {
        let (word, shift) = place((first, length));
        self.0[word] >> shift & ((1 << length) - 1)
    }

    /// Writes the low bits of `value` into a run.
    pub(super) const fn set_bits(&mut self, (first, length): Run, value: u32) {
        let (word, shift) = place((first, length));
        let mask = ((1 << length) - 1) << shift;
        self.0[word] = self.0[word] & !mask | value << shift & mask;
    }
}

/// Index of the word a run lies in, and the shift that brings its last bit down.
const fn place((first, length): Run) -> (usize, u32) {
    let in_word = (first - 1) % 30;
    (((first - 1) / 30) as usize, 24 - in_word - length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_numbered_as_in_the_standard() {
        let mut words = DataWords::default();
        words.set_bits((61, 10), 0x3FF);
        assert_eq!(words.0[2], 0xFF_C000);
        words.set_bits((107, 8), 0xA5);
        assert_eq!(words.0[3], 0x00_00A5);
        assert_eq!(words.bits((107, 8)), 0xA5);
        words.set_bits((107, 8), 0);
        assert_eq!(words.0[3], 0);
    }
}
