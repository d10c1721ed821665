//! Page 25 of subframes 4 and 5: health and configuration of all satellites
//! (IS-GPS-200, 20.3.3.5.1.3 to 20.3.3.5.1.5).

use super::almanac::{STEP_S, reference_steps};
use super::week::unroll_week;
use crate::lnav::word::{DataWords, Run};
use crate::{GpsTime, NavError};

/// SV (page) ID of page 25 of subframe 5.
pub(in crate::lnav) const HEALTH_SV_ID: u32 = 51;

/// SV (page) ID of page 25 of subframe 4.
pub(in crate::lnav) const CONFIGURATION_SV_ID: u32 = 63;

/// Page 25 of subframe 5: health of satellites 1 to 24 and the almanac reference week.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HealthReference {
    /// Almanac reference time of week, s (a multiple of 4096).
    pub toa_s: u32,
    /// Almanac reference week, low eight bits.
    pub wna: u8,
    /// Health of satellites 1 to 24 (6 bits each; 0 = all well).
    pub health: [u8; 24],
}

/// Page 25 of subframe 4: kind of every satellite, and health of satellites 25 to 32.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Configuration {
    /// Anti-spoofing flag (most significant bit) and configuration code (3 bits) of satellites 1 to
    /// 32.
    pub configuration: [u8; 32],
    /// Health of satellites 25 to 32 (6 bits each; 0 = all well).
    pub health: [u8; 8],
}

const TOA: Run = (69, 8);
const WNA: Run = (77, 8);

/// Bit at which the health of satellite 1 + `index` starts in subframe 5.
const fn health_1_run(index: usize) -> Run {
    let index = index as u32;
    (91 + 30 * (index / 4) + 6 * (index % 4), 6)
}

/// Where the configuration of satellite 1 + `index` lies in subframe 4.
const fn configuration_run(index: usize) -> Run {
    let index = index as u32;
    // Four fit behind the SV ID in word 3, then six in each word.
    match index.checked_sub(4) {
        None => (69 + 4 * index, 4),
        Some(index) => (91 + 30 * (index / 6) + 4 * (index % 6), 4),
    }
}

/// Where the health of satellite 25 + `index` lies in subframe 4.
const fn health_25_run(index: usize) -> Run {
    let index = index as u32;
    // One fits at the end of word 8, then four in each word.
    match index.checked_sub(1) {
        None => (229, 6),
        Some(index) => (241 + 30 * (index / 4) + 6 * (index % 4), 6),
    }
}

impl HealthReference {
    /// Almanac reference time, its week taken nearest to that of `near`.
    #[must_use]
    pub fn reference_time(&self, near: GpsTime) -> GpsTime {
        let week = unroll_week(self.wna.into(), 8, near.week());
        GpsTime::from_parts(week, self.toa_s.into(), 0.0)
    }

    pub(in crate::lnav) fn read(page: &DataWords) -> Self {
        Self {
            toa_s: page.bits(TOA) * STEP_S,
            wna: page.bits(WNA) as u8,
            health: std::array::from_fn(|index| page.bits(health_1_run(index)) as u8),
        }
    }

    pub(in crate::lnav) fn write(&self, page: &mut DataWords) -> Result<(), NavError> {
        page.set_bits(TOA, reference_steps(self.toa_s)?);
        page.set_bits(WNA, self.wna.into());
        for (index, &health) in self.health.iter().enumerate() {
            page.set_bits(health_1_run(index), small("health", health, 0x3F)?);
        }
        Ok(())
    }
}

impl Configuration {
    pub(in crate::lnav) fn read(page: &DataWords) -> Self {
        Self {
            configuration: std::array::from_fn(|index| page.bits(configuration_run(index)) as u8),
            health: std::array::from_fn(|index| page.bits(health_25_run(index)) as u8),
        }
    }

    pub(in crate::lnav) fn write(&self, page: &mut DataWords) -> Result<(), NavError> {
        for (index, &configuration) in self.configuration.iter().enumerate() {
            let bits = small("configuration", configuration, 0xF)?;
            page.set_bits(configuration_run(index), bits);
        }
        for (index, &health) in self.health.iter().enumerate() {
            page.set_bits(health_25_run(index), small("health", health, 0x3F)?);
        }
        Ok(())
    }
}

fn small(name: &'static str, value: u8, largest: u8) -> Result<u32, NavError> {
    if value <= largest {
        Ok(value.into())
    } else {
        Err(NavError::Value {
            name,
            value: value.to_string(),
            expected: "a number its LNAV field can hold",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_come_back() {
        let reference = HealthReference {
            toa_s: 4096 * 147,
            wna: 0xC3,
            health: std::array::from_fn(|index| index as u8 + 1),
        };
        let mut page = DataWords::FILLER;
        reference.write(&mut page).unwrap();
        assert_eq!(HealthReference::read(&page), reference);
        let configuration = Configuration {
            configuration: std::array::from_fn(|index| index as u8 % 16),
            health: std::array::from_fn(|index| 63 - index as u8),
        };
        let mut page = DataWords::FILLER;
        configuration.write(&mut page).unwrap();
        assert_eq!(Configuration::read(&page), configuration);
    }

    /// Bit numbers of the corners of the tables in figure 20-1 (sheets 4 and 5).
    #[test]
    fn tables_lie_where_the_standard_puts_them() {
        assert_eq!(health_1_run(23), (259, 6));
        assert_eq!(
            [3, 4, 27, 28, 31].map(|i| configuration_run(i).0),
            [81, 91, 201, 211, 223]
        );
        assert_eq!(
            [0, 1, 4, 5, 7].map(|i| health_25_run(i).0),
            [229, 241, 259, 271, 283]
        );
    }
}
