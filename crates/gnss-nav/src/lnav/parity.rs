//! Word parity, a (32, 26) extended Hamming code over a word and the two bits before it
//! (IS-GPS-200, 20.3.5.2 and table 20-XIV).
//!
//! Any three wrong bits are found. Inverting a word together with the two bits before it changes
//! neither the data nor the check, so the polarity of the carrier cancels out.

/// All 24 data bits of a word.
const DATA_MASK: u32 = 0x00FF_FFFF;

/// Source bits d1 to d24 in each of D25 to D30, as table 20-XIV lists them.
const EQUATIONS: [u32; 6] = [
    mask(&[1, 2, 3, 5, 6, 10, 11, 12, 13, 14, 17, 18, 20, 23]),
    mask(&[2, 3, 4, 6, 7, 11, 12, 13, 14, 15, 18, 19, 21, 24]),
    mask(&[1, 3, 4, 5, 7, 8, 12, 13, 14, 15, 16, 19, 20, 22]),
    mask(&[2, 4, 5, 6, 8, 9, 13, 14, 15, 16, 17, 20, 21, 23]),
    mask(&[1, 3, 5, 6, 7, 9, 10, 14, 15, 16, 17, 18, 21, 22, 24]),
    mask(&[3, 5, 6, 8, 9, 10, 11, 13, 15, 19, 22, 23, 24]),
];

/// Parity bits with D29* in D25, D27, D30 (the others take D30*), as a six-bit pattern.
const WITH_D29_STAR: u32 = 0b10_1001;

const fn mask(bits: &[u32]) -> u32 {
    let mut mask = 0;
    let mut index = 0;
    while index < bits.len() {
        mask |= 1 << (24 - bits[index]);
        index += 1;
    }
    mask
}

/// The last two bits of a word as transmitted, D29 and D30: the next word's parity starts from
/// them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tail {
    /// Bit 29.
    pub d29: bool,
    /// Bit 30; it inverts the data of the next word.
    pub d30: bool,
}

impl Tail {
    /// Both zero, as after words 2 and 10.
    pub const ZERO: Self = Self {
        d29: false,
        d30: false,
    };

    /// The tail of `word` (30 bits, the first bit most significant).
    #[must_use]
    pub const fn of(word: u32) -> Self {
        Self {
            d29: word & 2 != 0,
            d30: word & 1 != 0,
        }
    }
}

/// Parity bits D25 to D30 (D25 most significant of six) of 24 source bits after a word that ended
/// in `before`.
#[must_use]
pub fn parity(data: u32, before: Tail) -> u32 {
    let sums = EQUATIONS.iter().fold(0, |sums, equation| {
        sums << 1 | (data & equation).count_ones() & 1
    });
    let stars = if before.d29 { WITH_D29_STAR } else { 0 };
    let d30_star = if before.d30 { !WITH_D29_STAR & 0x3F } else { 0 };
    sums ^ stars ^ d30_star
}

/// The 30 transmitted bits of 24 source bits (anything above them is ignored) after `before`.
#[must_use]
pub fn encode_word(data: u32, before: Tail) -> u32 {
    let data = data & DATA_MASK;
    let sent = if before.d30 { data ^ DATA_MASK } else { data };
    sent << 6 | parity(data, before)
}

/// As [`encode_word`], with source bits 23 and 24 chosen such that the word ends in two zeros:
/// the rule for words 2 and 10 (IS-GPS-200, 20.3.3.2).
#[must_use]
pub fn encode_word_ending_in_zeros(data: u32, before: Tail) -> u32 {
    let data = data & DATA_MASK & !3;
    // D29 contains d24 but not d23, D30 both: d24 settles D29, then d23 settles D30.
    let with_d24 = data | parity(data, before) >> 1 & 1;
    encode_word(with_d24 | (parity(with_d24, before) & 1) << 1, before)
}

/// The 24 source bits of the 30 received bits of `word` after `before`, or `None` where the
/// parity does not fit.
#[must_use]
pub fn check_word(word: u32, before: Tail) -> Option<u32> {
    let sent = word >> 6 & DATA_MASK;
    let data = if before.d30 { sent ^ DATA_MASK } else { sent };
    (parity(data, before) == word & 0x3F).then_some(data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tails() -> impl Strategy<Value = Tail> {
        any::<(bool, bool)>().prop_map(|(d29, d30)| Tail { d29, d30 })
    }

    /// d1, d5, d7, d8 are one: D25 = d1+d5 = 0, D26 = d7 = 1, D27 = d1+d5+d7+d8 = 0,
    /// D28 = d5+d8 = 0, D29 = d1+d5+d7 = 1, D30 = d5+d8 = 0.
    #[test]
    fn preamble_alone_has_the_parity_found_by_hand() {
        assert_eq!(parity(0x8B_0000, Tail::ZERO), 0b01_0010);
        assert_eq!(
            encode_word(0x8B_0000, Tail::ZERO),
            0x8B_0000 << 6 | 0b01_0010
        );
    }

    /// As above with d23 and d24: D25, D28, D30 gain d23; D26, D29, D30 gain d24.
    #[test]
    fn last_data_bits_enter_as_found_by_hand() {
        assert_eq!(parity(0x8B_0003, Tail::ZERO), 0b10_0100);
    }

    /// D30* = 1 inverts the data sent and D26, D28, D29; D29* = 1 inverts D25, D27, D30.
    #[test]
    fn bits_of_the_word_before_enter_as_found_by_hand() {
        let d30 = Tail {
            d29: false,
            d30: true,
        };
        let d29 = Tail {
            d29: true,
            d30: false,
        };
        assert_eq!(encode_word(0x8B_0000, d30), 0x74_FFFF << 6 | 0b00_0100);
        assert_eq!(encode_word(0x8B_0000, d29), 0x8B_0000 << 6 | 0b11_1011);
    }

    proptest! {
        #[test]
        fn encoded_words_check(data in 0_u32..1 << 24, before in tails()) {
            prop_assert_eq!(check_word(encode_word(data, before), before), Some(data));
        }

        #[test]
        fn one_to_three_wrong_bits_are_found(
            data in 0_u32..1 << 24,
            before in tails(),
            wrong in proptest::collection::btree_set(0_u32..30, 1..=3),
        ) {
            let errors = wrong.iter().fold(0, |errors, bit| errors | 1 << bit);
            prop_assert_eq!(check_word(encode_word(data, before) ^ errors, before), None);
        }

        #[test]
        fn polarity_cancels_out(data in 0_u32..1 << 24, before in tails()) {
            let word = encode_word(data, before) ^ 0x3FFF_FFFF;
            let before = Tail { d29: !before.d29, d30: !before.d30 };
            prop_assert_eq!(check_word(word, before), Some(data));
        }

        #[test]
        fn words_two_and_ten_end_in_zeros(data in 0_u32..1 << 24, before in tails()) {
            let word = encode_word_ending_in_zeros(data, before);
            prop_assert_eq!(Tail::of(word), Tail::ZERO);
            prop_assert_eq!(check_word(word, before).map(|found| found >> 2), Some(data >> 2));
        }
    }
}
