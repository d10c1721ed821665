//! GPS C/A ranging codes (IS-GPS-200, section 3.3.2.3).

use std::sync::LazyLock;

use crate::{Signal, SignalId};

/// Chips in one period of the C/A code.
pub const CA_CODE_LENGTH_CHIPS: usize = 1023;

/// Delay of the G2 sequence for PRN 1 to 37, chips (IS-GPS-200, table 3-Ia).
const G2_DELAY_CHIPS: [usize; 37] = [
    5, 6, 7, 8, 17, 18, 139, 140, 141, 251, 252, 254, 255, 256, 257, 258, 469, 470, 471, 472, 473,
    474, 509, 512, 513, 514, 515, 516, 859, 860, 861, 862, 863, 950, 947, 948, 950,
];

static CA_CODES: LazyLock<Vec<[i8; CA_CODE_LENGTH_CHIPS]>> = LazyLock::new(|| {
    G2_DELAY_CHIPS
        .iter()
        .map(|&delay| generate(delay))
        .collect()
});

/// One period of the ranging code of `signal`, one entry a chip: logic 0 is +1, logic 1 is -1.
///
/// A C/A code has 512 ones and 511 zeros in a period, so that its chips add up to -1.
#[must_use]
pub fn ranging_code(signal: SignalId) -> &'static [i8; CA_CODE_LENGTH_CHIPS] {
    match signal.signal() {
        // `SignalId` holds no PRN outside the table.
        Signal::GpsL1Ca => &CA_CODES[usize::from(signal.prn()) - 1],
    }
}

/// The Gold code G1(t) xor G2(t - delay) as signs.
fn generate(g2_delay_chips: usize) -> [i8; CA_CODE_LENGTH_CHIPS] {
    const G1_TAPS: u16 = stages(&[3, 10]);
    const G2_TAPS: u16 = stages(&[2, 3, 6, 8, 9, 10]);
    let g1 = maximal_length_sequence(G1_TAPS);
    let g2 = maximal_length_sequence(G2_TAPS);
    std::array::from_fn(|chip| {
        let delayed = (chip + CA_CODE_LENGTH_CHIPS - g2_delay_chips) % CA_CODE_LENGTH_CHIPS;
        if g1[chip] ^ g2[delayed] { -1 } else { 1 }
    })
}

/// Register mask of shift register stages counted from 1, as IS-GPS-200 does.
const fn stages(numbers: &[u16]) -> u16 {
    let mut mask = 0;
    let mut i = 0;
    while i < numbers.len() {
        mask |= 1 << (numbers[i] - 1);
        i += 1;
    }
    mask
}

/// Output of stage 10 of a register that starts with all ones and feeds back the parity of `taps`.
fn maximal_length_sequence(taps: u16) -> [bool; CA_CODE_LENGTH_CHIPS] {
    let mut register: u16 = 0x3ff;
    std::array::from_fn(|_| {
        let output = register >> 9 & 1 == 1;
        let feedback = (register & taps).count_ones() & 1;
        register = (register << 1 | feedback as u16) & 0x3ff;
        output
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(prn: u8) -> &'static [i8; CA_CODE_LENGTH_CHIPS] {
        ranging_code(SignalId::gps_l1_ca(prn).unwrap())
    }

    #[test]
    fn first_ten_chips_are_those_of_is_gps_200() {
        // IS-GPS-200, table 3-Ia, column "first 10 chips octal".
        const FIRST_TEN_CHIPS: [u16; 37] = [
            0o1440, 0o1620, 0o1710, 0o1744, 0o1133, 0o1455, 0o1131, 0o1454, 0o1626, 0o1504, 0o1642,
            0o1750, 0o1764, 0o1772, 0o1775, 0o1776, 0o1156, 0o1467, 0o1633, 0o1715, 0o1746, 0o1763,
            0o1063, 0o1706, 0o1743, 0o1761, 0o1770, 0o1774, 0o1127, 0o1453, 0o1625, 0o1712, 0o1745,
            0o1713, 0o1134, 0o1456, 0o1713,
        ];
        for (prn, &expected) in (1..=37).zip(&FIRST_TEN_CHIPS) {
            let chips = code(prn)[..10]
                .iter()
                .fold(0, |word, &chip| word << 1 | u16::from(chip < 0));
            assert_eq!(
                chips, expected,
                "PRN {prn}: {chips:o} instead of {expected:o}"
            );
        }
    }

    #[test]
    fn codes_are_balanced() {
        for prn in 1..=37 {
            let sum: i32 = code(prn).iter().map(|&chip| i32::from(chip)).sum();
            assert_eq!(sum, -1, "PRN {prn}");
        }
    }

    #[test]
    fn correlations_take_the_gold_code_values() {
        for (a, b) in [(1, 1), (1, 2), (7, 30), (32, 33), (17, 37)] {
            let (code_a, code_b) = (code(a), code(b));
            for shift in 0..CA_CODE_LENGTH_CHIPS {
                let sum: i32 = (0..CA_CODE_LENGTH_CHIPS)
                    .map(|i| {
                        let shifted = code_b[(i + shift) % CA_CODE_LENGTH_CHIPS];
                        i32::from(code_a[i]) * i32::from(shifted)
                    })
                    .sum();
                if a == b && shift == 0 {
                    assert_eq!(sum, 1023);
                } else {
                    assert!(
                        [-65, -1, 63].contains(&sum),
                        "PRN {a}, {b} at {shift}: {sum}"
                    );
                }
            }
        }
    }

    #[test]
    fn prn_34_and_37_share_their_code() {
        assert_eq!(code(34), code(37));
    }
}
