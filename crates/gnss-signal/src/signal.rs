//! What is transmitted and how it is sampled: signals, their constants, and the front end.

use std::fmt;

use crate::SignalError;

/// A ranging signal this crate can generate replicas of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Signal {
    /// GPS L1 C/A (IS-GPS-200, section 3).
    GpsL1Ca,
}

/// Constants of a [`Signal`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignalSpec {
    /// Carrier frequency, Hz.
    pub carrier_hz: f64,
    /// Nominal code rate, chips/s.
    pub code_rate_hz: f64,
    /// Code length, chips.
    pub code_length_chips: u32,
    /// Code periods in one navigation data bit.
    pub code_periods_per_bit: u32,
    /// First pseudo-random number in use.
    pub first_prn: u8,
    /// Last pseudo-random number in use.
    pub last_prn: u8,
}

impl SignalSpec {
    /// Duration of one code period, s.
    #[must_use]
    pub fn code_period_s(&self) -> f64 {
        f64::from(self.code_length_chips) / self.code_rate_hz
    }
}

const GPS_L1_CA: SignalSpec = SignalSpec {
    carrier_hz: 1_575.42e6,
    code_rate_hz: 1.023e6,
    code_length_chips: 1023,
    code_periods_per_bit: 20,
    first_prn: 1,
    last_prn: 37,
};

impl Signal {
    /// Constants of this signal.
    #[must_use]
    pub const fn spec(self) -> &'static SignalSpec {
        match self {
            Self::GpsL1Ca => &GPS_L1_CA,
        }
    }
}

/// One ranging code: a [`Signal`] and a valid pseudo-random number of it.
///
/// Displays as RINEX writes the satellite, for instance `G07`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SignalId {
    signal: Signal,
    prn: u8,
}

impl SignalId {
    /// The GPS L1 C/A signal of `prn`.
    ///
    /// # Errors
    /// [`SignalError::UnknownPrn`] unless `prn` is in 1 to 37.
    pub fn gps_l1_ca(prn: u8) -> Result<Self, SignalError> {
        Self::new(Signal::GpsL1Ca, prn)
    }

    /// The ranging code `prn` of `signal`.
    ///
    /// # Errors
    /// [`SignalError::UnknownPrn`] where `signal` has no such code.
    pub fn new(signal: Signal, prn: u8) -> Result<Self, SignalError> {
        let spec = signal.spec();
        if (spec.first_prn..=spec.last_prn).contains(&prn) {
            Ok(Self { signal, prn })
        } else {
            Err(SignalError::UnknownPrn {
                prn,
                first: spec.first_prn,
                last: spec.last_prn,
            })
        }
    }

    /// The signal.
    #[must_use]
    pub const fn signal(self) -> Signal {
        self.signal
    }

    /// The pseudo-random number.
    #[must_use]
    pub const fn prn(self) -> u8 {
        self.prn
    }

    /// Constants of the signal.
    #[must_use]
    pub const fn spec(self) -> &'static SignalSpec {
        self.signal.spec()
    }
}

impl fmt::Display for SignalId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.signal {
            Signal::GpsL1Ca => write!(f, "G{:02}", self.prn),
        }
    }
}

/// What the analog and sampling part of a receiver delivers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontEnd {
    /// Samples per second (complex samples where `complex`).
    pub sample_rate_hz: f64,
    /// Frequency at which a signal without Doppler appears, Hz; may be negative.
    pub intermediate_frequency_hz: f64,
    /// Whether a sample is an I, Q pair.
    pub complex: bool,
}
