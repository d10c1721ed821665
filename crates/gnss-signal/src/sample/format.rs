//! How samples are written in a file or stream.

use std::{fmt, str::FromStr};

use crate::SignalError;

/// Encoding of the samples of a recording.
///
/// Names are those of `SigMF` where it has one: `r` real or `c` complex (I, then Q), the component
/// type, and the byte order. For packed formats the suffix says where in a byte the first
/// component stands: `msb` in the most, `lsb` in the least significant bits.
///
/// | names | component | value |
/// |---|---|---|
/// | `ri8` `ci8` | signed byte | itself; -128 becomes -127 |
/// | `ru8` `cu8` | byte, offset 128 | minus 128; 0 becomes -127 |
/// | `ri16_le` `ci16_le` `rf32_le` `cf32_le` | little-endian integer or float | brought to 8 bits by a digital gain |
/// | `r1_msb` `r1_lsb` `c1_msb` `c1_lsb` | sign bit | 1 is +1, 0 is -1 |
/// | `r2_msb` `r2_lsb` | two's complement {-2, -1, 0, 1}, meaning value + 1/2 | twice that: -3, -1, +1, +3 |
/// | `r2sm_msb` `r2sm_lsb` | sign (the higher bit, 1 is negative), magnitude bit | magnitude 1 or 3 with the sign: 00 is +1, 01 is +3, 10 is -1, 11 is -3 |
///
/// The digital gain is a power of the fourth root of two. It is chosen from chunks of 4096 samples
/// counted from the first one, so that the rms of a component becomes about 28, and changes only
/// where it would leave 22 to 36: values depend on the samples, not on how they are read. Values
/// beyond +-127 are clipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SampleFormat {
    /// Real, signed byte.
    Ri8,
    /// Real, byte with offset 128.
    Ru8,
    /// Real, signed 16-bit integer, little-endian.
    Ri16Le,
    /// Real, 32-bit float, little-endian.
    Rf32Le,
    /// Complex, signed bytes.
    Ci8,
    /// Complex, bytes with offset 128.
    Cu8,
    /// Complex, signed 16-bit integers, little-endian.
    Ci16Le,
    /// Complex, 32-bit floats, little-endian.
    Cf32Le,
    /// Real, sign bit, most significant first.
    R1Msb,
    /// Real, sign bit, least significant first.
    R1Lsb,
    /// Complex, sign bits, most significant first.
    C1Msb,
    /// Complex, sign bits, least significant first.
    C1Lsb,
    /// Real, 2-bit two's complement, least significant pair first.
    R2Lsb,
    /// Real, 2-bit two's complement, most significant pair first.
    R2Msb,
    /// Real, sign and magnitude, least significant pair first.
    R2smLsb,
    /// Real, sign and magnitude, most significant pair first.
    R2smMsb,
}

/// What one component of a sample is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Component {
    Int8,
    Uint8,
    Int16,
    Float32,
    Sign(BitOrder),
    TwosComplement2(BitOrder),
    SignMagnitude(BitOrder),
}

/// Where in a byte the first of several packed components stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BitOrder {
    MostSignificantFirst,
    LeastSignificantFirst,
}

impl SampleFormat {
    /// Every format, in the order of the documentation.
    pub const ALL: [Self; 16] = [
        Self::Ri8,
        Self::Ru8,
        Self::Ri16Le,
        Self::Rf32Le,
        Self::Ci8,
        Self::Cu8,
        Self::Ci16Le,
        Self::Cf32Le,
        Self::R1Msb,
        Self::R1Lsb,
        Self::C1Msb,
        Self::C1Lsb,
        Self::R2Lsb,
        Self::R2Msb,
        Self::R2smLsb,
        Self::R2smMsb,
    ];

    /// The name used in configuration and `SigMF` metadata.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ri8 => "ri8",
            Self::Ru8 => "ru8",
            Self::Ri16Le => "ri16_le",
            Self::Rf32Le => "rf32_le",
            Self::Ci8 => "ci8",
            Self::Cu8 => "cu8",
            Self::Ci16Le => "ci16_le",
            Self::Cf32Le => "cf32_le",
            Self::R1Msb => "r1_msb",
            Self::R1Lsb => "r1_lsb",
            Self::C1Msb => "c1_msb",
            Self::C1Lsb => "c1_lsb",
            Self::R2Lsb => "r2_lsb",
            Self::R2Msb => "r2_msb",
            Self::R2smLsb => "r2sm_lsb",
            Self::R2smMsb => "r2sm_msb",
        }
    }

    /// Whether a sample is an I, Q pair.
    #[must_use]
    pub const fn is_complex(self) -> bool {
        matches!(
            self,
            Self::Ci8 | Self::Cu8 | Self::Ci16Le | Self::Cf32Le | Self::C1Msb | Self::C1Lsb
        )
    }

    /// Bits one sample takes in the stream (both components where complex).
    #[must_use]
    pub const fn bits_per_sample(self) -> usize {
        self.components() * self.component().bits()
    }

    /// 2 where complex, otherwise 1.
    #[must_use]
    pub const fn components(self) -> usize {
        if self.is_complex() { 2 } else { 1 }
    }

    pub(super) const fn component(self) -> Component {
        use BitOrder::{LeastSignificantFirst as Lsb, MostSignificantFirst as Msb};
        match self {
            Self::Ri8 | Self::Ci8 => Component::Int8,
            Self::Ru8 | Self::Cu8 => Component::Uint8,
            Self::Ri16Le | Self::Ci16Le => Component::Int16,
            Self::Rf32Le | Self::Cf32Le => Component::Float32,
            Self::R1Msb | Self::C1Msb => Component::Sign(Msb),
            Self::R1Lsb | Self::C1Lsb => Component::Sign(Lsb),
            Self::R2Lsb => Component::TwosComplement2(Lsb),
            Self::R2Msb => Component::TwosComplement2(Msb),
            Self::R2smLsb => Component::SignMagnitude(Lsb),
            Self::R2smMsb => Component::SignMagnitude(Msb),
        }
    }
}

impl Component {
    pub(super) const fn bits(self) -> usize {
        match self {
            Self::Sign(_) => 1,
            Self::TwosComplement2(_) | Self::SignMagnitude(_) => 2,
            Self::Int8 | Self::Uint8 => 8,
            Self::Int16 => 16,
            Self::Float32 => 32,
        }
    }
}

impl fmt::Display for SampleFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SampleFormat {
    type Err = SignalError;

    fn from_str(name: &str) -> Result<Self, SignalError> {
        let found = Self::ALL.into_iter().find(|format| format.name() == name);
        found.ok_or_else(|| SignalError::UnknownFormat {
            name: name.to_owned(),
            expected: Self::ALL.map(Self::name).join(" "),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for format in SampleFormat::ALL {
            assert_eq!(format.to_string().parse::<SampleFormat>().unwrap(), format);
            assert_eq!(format.is_complex(), format.name().starts_with('c'));
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let message = "ci4".parse::<SampleFormat>().unwrap_err().to_string();
        assert!(
            message.contains("'ci4'") && message.contains("r2sm_msb"),
            "{message}"
        );
    }
}
