//! The 25 pages of subframes 4 and 5 (IS-GPS-200, 20.3.3.5.1 and table 20-V).

use super::almanac::Almanac;
use super::health::{CONFIGURATION_SV_ID, Configuration, HEALTH_SV_ID, HealthReference};
use super::ionosphere_utc::{IonosphereUtc, SV_ID as IONOSPHERE_UTC_SV_ID};
use crate::lnav::word::{DataWords, Run};

const DATA_ID: Run = (61, 2);
const PAGE_SV_ID: Run = (63, 6);

/// Data ID of the message as it is since Block II.
const DATA_ID_LNAV: u32 = 1;

/// What a page of subframe 4 or 5 holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::lnav) enum Page {
    Almanac(Almanac),
    IonosphereUtc(IonosphereUtc),
    HealthReference(HealthReference),
    Configuration(Configuration),
}

impl Page {
    /// Reads words 3 to 10 of subframe `id`; `None` for pages without content of use here
    /// (reserved, special messages, empty almanac pages, orbits no GPS satellite flies).
    pub(in crate::lnav) fn read(id: u8, page: &DataWords) -> Option<Self> {
        if page.bits(DATA_ID) != DATA_ID_LNAV {
            return None;
        }
        match (id, page.bits(PAGE_SV_ID)) {
            (4, IONOSPHERE_UTC_SV_ID) => Some(Self::IonosphereUtc(IonosphereUtc::read(page))),
            (4, CONFIGURATION_SV_ID) => Some(Self::Configuration(Configuration::read(page))),
            (5, HEALTH_SV_ID) => Some(Self::HealthReference(HealthReference::read(page))),
            (4, prn @ 25..=32) | (5, prn @ 1..=24) => {
                let almanac = Almanac::read(prn as u8, page);
                almanac.is_orbit().then_some(Self::Almanac(almanac))
            }
            _ => None,
        }
    }
}

/// Marks `page` with the SV ID it is sent under.
pub(in crate::lnav) const fn label(page: &mut DataWords, sv_id: u32) {
    page.set_bits(DATA_ID, DATA_ID_LNAV);
    page.set_bits(PAGE_SV_ID, sv_id);
}

/// SV ID of `page` (1 to 25) of subframe 4 (table 20-V).
pub(in crate::lnav) const fn subframe_4_sv_id(page: u32) -> u32 {
    match page {
        2..=5 => 23 + page,
        7..=10 => 22 + page,
        12 | 24 => 62,
        13..=15 => 39 + page,
        17 => 55,
        18 => IONOSPHERE_UTC_SV_ID,
        19 => 58,
        20 => 59,
        22 => 60,
        23 => 61,
        25 => CONFIGURATION_SV_ID,
        _ => 57,
    }
}

/// SV ID of `page` (1 to 25) of subframe 5.
pub(in crate::lnav) const fn subframe_5_sv_id(page: u32) -> u32 {
    if page == 25 { HEALTH_SV_ID } else { page }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_satellite_has_its_page() {
        let in_4 = (1..=25)
            .map(subframe_4_sv_id)
            .filter(|id| (25..=32).contains(id));
        let in_5 = (1..=25)
            .map(subframe_5_sv_id)
            .filter(|id| (1..=24).contains(id));
        assert!(in_5.chain(in_4).eq(1..=32));
    }

    #[test]
    fn filler_is_no_page() {
        let mut page = DataWords::FILLER;
        assert_eq!(Page::read(4, &page), None);
        label(&mut page, 0);
        assert_eq!(Page::read(5, &page), None);
        label(&mut page, 57);
        assert_eq!(Page::read(4, &page), None);
    }
}
