//! The LNAV encoder: the bits a satellite sends at a given time.

use std::collections::BTreeMap;

use super::parity::{Tail, encode_word, encode_word_ending_in_zeros};
use super::subframe::almanac::Almanac;
use super::subframe::ephemeris;
use super::subframe::hand_over::HandOver;
use super::subframe::health::{CONFIGURATION_SV_ID, Configuration, HEALTH_SV_ID, HealthReference};
use super::subframe::ionosphere_utc::{IonosphereUtc, SV_ID as IONOSPHERE_UTC_SV_ID};
use super::subframe::page::{label, subframe_4_sv_id, subframe_5_sv_id};
use super::word::DataWords;
use super::{SUBFRAME_BITS, SUBFRAME_S, WORD_BITS};
use crate::{Ephemeris, GpsTime, NavError};

/// Bits sent per second.
const BITS_PER_SECOND: f64 = 50.0;

/// Pages a subframe 4 or 5 runs through.
const PAGES: u32 = 25;

/// SV ID of a page without content.
const EMPTY_SV_ID: u32 = 0;

/// `ephemeris` with every number rounded to what LNAV can hold, angles within one turn.
///
/// `decode(encode(e)) == quantise(e)` exactly.
///
/// # Errors
/// [`NavError::Value`] names what LNAV cannot hold, or what no GPS satellite flies. Reference times
/// must be multiples of 16 s: moving one would move the satellite.
pub fn quantise(ephemeris: &Ephemeris) -> Result<Ephemeris, NavError> {
    let subframes = ephemeris::write(ephemeris)?;
    ephemeris::check_near(ephemeris, ephemeris.toe)?;
    ephemeris::read(ephemeris.satellite, &subframes, ephemeris.toe)
}

/// Encodes the navigation message of one satellite.
///
/// Subframes 4 and 5 run through their 25 pages with the time of week; pages without content are
/// sent empty.
#[derive(Debug, Clone)]
pub struct LnavEncoder {
    ephemeris: Ephemeris,
    subframes: [DataWords; 3],
    pages: BTreeMap<u32, DataWords>,
    alert: bool,
    anti_spoof: bool,
}

impl LnavEncoder {
    /// An encoder that sends `ephemeris` and empty pages, flags off.
    ///
    /// # Errors
    /// As [`quantise`].
    pub fn new(ephemeris: &Ephemeris) -> Result<Self, NavError> {
        let ephemeris = quantise(ephemeris)?;
        Ok(Self {
            ephemeris,
            subframes: ephemeris::write(&ephemeris)?,
            pages: BTreeMap::new(),
            alert: false,
            anti_spoof: false,
        })
    }

    /// The same with page 18 of subframe 4.
    ///
    /// # Errors
    /// [`NavError::Value`] names what LNAV cannot hold; so for the other pages.
    pub fn with_ionosphere_utc(self, parameters: &IonosphereUtc) -> Result<Self, NavError> {
        self.with_page(IONOSPHERE_UTC_SV_ID, |page| parameters.write(page))
    }

    /// The same with page 25 of subframe 5.
    ///
    /// # Errors
    /// As [`Self::with_ionosphere_utc`].
    pub fn with_health_reference(self, reference: &HealthReference) -> Result<Self, NavError> {
        self.with_page(HEALTH_SV_ID, |page| reference.write(page))
    }

    /// The same with page 25 of subframe 4.
    ///
    /// # Errors
    /// As [`Self::with_ionosphere_utc`].
    pub fn with_configuration(self, configuration: &Configuration) -> Result<Self, NavError> {
        self.with_page(CONFIGURATION_SV_ID, |page| configuration.write(page))
    }

    /// The same with the almanac page of one satellite.
    ///
    /// # Errors
    /// As [`Self::with_ionosphere_utc`]; also for a satellite that has no page, or that does not
    /// fly a GPS orbit.
    pub fn with_almanac(self, almanac: &Almanac) -> Result<Self, NavError> {
        let prn = almanac.satellite.prn;
        if !(1..=32).contains(&prn) {
            return Err(almanac_error("prn", prn.to_string(), "1 to 32"));
        }
        if !almanac.is_orbit() {
            return Err(almanac_error(
                "almanac",
                format!("{almanac:?}"),
                "a GPS orbit",
            ));
        }
        self.with_page(prn.into(), |page| almanac.write(page))
    }

    /// The same with the alert flag of the hand-over words raised.
    #[must_use]
    pub fn with_alert(self) -> Self {
        Self {
            alert: true,
            ..self
        }
    }

    /// The same with the anti-spoof flag of the hand-over words raised.
    #[must_use]
    pub fn with_anti_spoof(self) -> Self {
        Self {
            anti_spoof: true,
            ..self
        }
    }

    fn with_page(
        mut self,
        sv_id: u32,
        write: impl FnOnce(&mut DataWords) -> Result<(), NavError>,
    ) -> Result<Self, NavError> {
        let mut page = DataWords::FILLER;
        write(&mut page)?;
        label(&mut page, sv_id);
        self.pages.insert(sv_id, page);
        Ok(self)
    }

    /// The ephemeris as sent.
    #[must_use]
    pub const fn ephemeris(&self) -> &Ephemeris {
        &self.ephemeris
    }

    /// The 300 bits of the subframe that is being sent at `time`, first bit first.
    ///
    /// # Errors
    /// [`NavError::Value`] where `time` is more than half a week from the reference times of the
    /// ephemeris.
    pub fn subframe(&self, time: GpsTime) -> Result<[bool; SUBFRAME_BITS], NavError> {
        let hand_over = HandOver {
            alert: self.alert,
            anti_spoof: self.anti_spoof,
            ..HandOver::at(time.second() as u32 / SUBFRAME_S)
        };
        let page = hand_over.subframe_count / 5 % PAGES + 1;
        let mut words = match hand_over.id {
            4 => self.page(subframe_4_sv_id(page)),
            5 => self.page(subframe_5_sv_id(page)),
            id => self.subframes[usize::from(id) - 1],
        };
        ephemeris::check_near(&self.ephemeris, time)?;
        if hand_over.id == 1 {
            ephemeris::set_week(&mut words, time);
        }
        hand_over.write(&mut words);
        Ok(transmit(&words))
    }

    /// The bit that is being sent at `time`.
    ///
    /// # Errors
    /// As [`Self::subframe`], which is the cheaper way to many bits.
    pub fn bit_at(&self, time: GpsTime) -> Result<bool, NavError> {
        let second = f64::from(time.second().rem_euclid(SUBFRAME_S as i32));
        let index = ((second + time.fraction_s()) * BITS_PER_SECOND) as usize;
        Ok(self.subframe(time)?[index.min(SUBFRAME_BITS - 1)])
    }

    fn page(&self, sv_id: u32) -> DataWords {
        self.pages.get(&sv_id).copied().unwrap_or_else(|| {
            let mut page = DataWords::FILLER;
            let is_reserved = matches!(sv_id, 52..=55 | 57..=62);
            label(&mut page, if is_reserved { sv_id } else { EMPTY_SV_ID });
            page
        })
    }
}

/// The bits of a subframe with its parity.
pub(super) fn transmit(words: &DataWords) -> [bool; SUBFRAME_BITS] {
    let mut bits = [false; SUBFRAME_BITS];
    let mut tail = Tail::ZERO;
    for (index, (&data, bits)) in words
        .0
        .iter()
        .zip(bits.chunks_exact_mut(WORD_BITS))
        .enumerate()
    {
        let word = match index {
            1 | 9 => encode_word_ending_in_zeros(data, tail),
            _ => encode_word(data, tail),
        };
        tail = Tail::of(word);
        for (place, bit) in bits.iter_mut().enumerate() {
            *bit = word >> (WORD_BITS - 1 - place) & 1 == 1;
        }
    }
    bits
}

fn almanac_error(name: &'static str, value: String, expected: &'static str) -> NavError {
    NavError::Value {
        name,
        value,
        expected,
    }
}
