//! Satellites by system and number.

use std::fmt;
use std::str::FromStr;

use crate::NavError;

/// A satellite navigation system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum System {
    /// GPS.
    Gps,
}

/// A satellite; displays as RINEX writes it, for instance `G07`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SatelliteId {
    /// Its system.
    pub system: System,
    /// Its number in the system, from 1.
    pub prn: u8,
}

impl SatelliteId {
    /// The GPS satellite `prn`.
    #[must_use]
    pub const fn gps(prn: u8) -> Self {
        Self {
            system: System::Gps,
            prn,
        }
    }
}

impl fmt::Display for SatelliteId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.system {
            System::Gps => write!(f, "G{:02}", self.prn),
        }
    }
}

impl FromStr for SatelliteId {
    type Err = NavError;

    /// Reads `G07`, `G7` or, for GPS, `7`.
    fn from_str(text: &str) -> Result<Self, NavError> {
        let number = text.strip_prefix('G').unwrap_or(text);
        match number.parse::<u8>() {
            Ok(prn @ 1..=63) => Ok(Self::gps(prn)),
            _ => Err(NavError::Satellite {
                text: text.to_owned(),
            }),
        }
    }
}
