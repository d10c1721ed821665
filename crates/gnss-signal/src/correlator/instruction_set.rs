//! The instruction sets a correlator can run on.

use std::{fmt, str::FromStr};

use crate::SignalError;

/// Which code computes the correlator sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum InstructionSet {
    /// `f64`, sample by sample: slow, and what the others are held against.
    Reference,
    /// Fixed point on any processor.
    Portable,
    /// Fixed point on x86-64 with AVX2 and FMA.
    Avx2,
    /// Fixed point on x86-64 with AVX-512 F, BW, VBMI and VNNI.
    Avx512,
}

impl InstructionSet {
    const ALL: [Self; 4] = [Self::Reference, Self::Portable, Self::Avx2, Self::Avx512];

    /// The fastest one this processor has.
    #[must_use]
    pub fn detect() -> Self {
        let fastest_first = [Self::Avx512, Self::Avx2];
        let found = fastest_first.into_iter().find(|set| set.is_supported());
        found.unwrap_or(Self::Portable)
    }

    /// Whether this processor has it.
    #[must_use]
    pub fn is_supported(self) -> bool {
        match self {
            Self::Reference | Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => super::avx2::is_supported(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => super::avx512::is_supported(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The name used in configuration.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The error of asking a processor for what it lacks.
    pub(super) fn unsupported(self) -> SignalError {
        SignalError::Parameter {
            name: "instruction set",
            value: self.name().to_owned(),
            expected: "one that this processor has",
        }
    }
}

impl fmt::Display for InstructionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for InstructionSet {
    type Err = SignalError;

    fn from_str(name: &str) -> Result<Self, SignalError> {
        let found = Self::ALL.into_iter().find(|set| set.name() == name);
        found.ok_or_else(|| SignalError::Parameter {
            name: "instruction set",
            value: name.to_owned(),
            expected: "reference, portable, avx2 or avx512",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for set in InstructionSet::ALL {
            assert_eq!(set.to_string().parse::<InstructionSet>().unwrap(), set);
        }
        assert!("sse9".parse::<InstructionSet>().is_err());
    }

    #[test]
    fn what_is_detected_is_supported() {
        assert!(InstructionSet::detect().is_supported());
    }
}
