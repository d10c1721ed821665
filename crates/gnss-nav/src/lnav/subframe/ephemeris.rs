//! Subframes 1 to 3: clock and orbit (IS-GPS-200, 20.3.3.3 and 20.3.3.4).

use super::week::nearest_time;
use crate::lnav::field::{Field, Term};
use crate::lnav::word::{DataWords, Run};
use crate::time::SECONDS_PER_WEEK;
use crate::{Ephemeris, GpsTime, NavError, SatelliteId};

const WEEK: Run = (61, 10);
const CODES_ON_L2: Run = (71, 2);
const URA: Run = (73, 4);
const HEALTH: Run = (77, 6);
const IODC_HIGH: Run = (83, 2);
const L2_P_DATA_OFF: Run = (91, 1);
const IODC_LOW: Run = (211, 8);
const TOC: Run = (219, 16);
const IODE_2: Run = (61, 8);
const TOE: Run = (271, 16);
const FIT_INTERVAL: Run = (287, 1);
const AODO: Run = (288, 5);
const IODE_3: Run = (271, 8);

/// Age of data offset that says that no navigation message correction table is to be had.
const AODO_NONE: u32 = 31;

/// Seconds in a step of `toe` and `toc`.
const STEP_S: u32 = 16;

const CLOCK: [Term<Ephemeris>; 4] = [
    Term::new(Field::signed("tgd_s", (197, 8), -31), |e| &mut e.tgd_s),
    Term::new(Field::signed("af2_per_s", (241, 8), -55), |e| {
        &mut e.af2_per_s
    }),
    Term::new(Field::signed("af1", (249, 16), -43), |e| &mut e.af1),
    Term::new(Field::signed("af0_s", (271, 22), -31), |e| &mut e.af0_s),
];

const ORBIT_2: [Term<Ephemeris>; 7] = [
    Term::new(Field::signed("crs_m", (69, 16), -5), |e| &mut e.crs_m),
    Term::new(
        Field::signed("delta_n_rad_s", (91, 16), -43).semicircles(),
        |e| &mut e.delta_n_rad_s,
    ),
    Term::new(
        Field::turn("m0_rad", (121, 24), -31).with_high((107, 8)),
        |e| &mut e.m0_rad,
    ),
    Term::new(Field::signed("cuc_rad", (151, 16), -29), |e| &mut e.cuc_rad),
    Term::new(
        Field::unsigned("eccentricity", (181, 24), -33).with_high((167, 8)),
        |e| &mut e.eccentricity,
    ),
    Term::new(Field::signed("cus_rad", (211, 16), -29), |e| &mut e.cus_rad),
    Term::new(
        Field::unsigned("sqrt_a", (241, 24), -19).with_high((227, 8)),
        |e| &mut e.sqrt_a,
    ),
];

const ORBIT_3: [Term<Ephemeris>; 8] = [
    Term::new(Field::signed("cic_rad", (61, 16), -29), |e| &mut e.cic_rad),
    Term::new(
        Field::turn("omega0_rad", (91, 24), -31).with_high((77, 8)),
        |e| &mut e.omega0_rad,
    ),
    Term::new(Field::signed("cis_rad", (121, 16), -29), |e| &mut e.cis_rad),
    Term::new(
        Field::turn("i0_rad", (151, 24), -31).with_high((137, 8)),
        |e| &mut e.i0_rad,
    ),
    Term::new(Field::signed("crc_m", (181, 16), -5), |e| &mut e.crc_m),
    Term::new(
        Field::turn("omega_rad", (211, 24), -31).with_high((197, 8)),
        |e| &mut e.omega_rad,
    ),
    Term::new(
        Field::signed("omega_dot_rad_s", (241, 24), -43).semicircles(),
        |e| &mut e.omega_dot_rad_s,
    ),
    Term::new(
        Field::signed("idot_rad_s", (279, 14), -43).semicircles(),
        |e| &mut e.idot_rad_s,
    ),
];

/// Issue of data in subframe `id` (1: the low bits of IODC), and the index of the word it lies in.
pub(in crate::lnav) const fn issue_place(id: u8) -> (Run, usize) {
    match id {
        1 => (IODC_LOW, 7),
        2 => (IODE_2, 2),
        _ => (IODE_3, 9),
    }
}

/// Week number in subframe 1, ten bits.
pub(in crate::lnav) const fn week_number(subframe_1: &DataWords) -> u16 {
    subframe_1.bits(WEEK) as u16
}

/// Puts the week of `time` into subframe 1.
pub(in crate::lnav) const fn set_week(subframe_1: &mut DataWords, time: GpsTime) {
    subframe_1.set_bits(WEEK, time.week() as u32);
}

/// Refuses reference times more than half a week from `time`: a receiver would take them for those
/// of another week.
///
/// # Errors
/// [`NavError::Value`] names the reference time.
pub(in crate::lnav) fn check_near(ephemeris: &Ephemeris, time: GpsTime) -> Result<(), NavError> {
    for (name, reference) in [("toc", ephemeris.toc), ("toe", ephemeris.toe)] {
        if nearest_time(reference.second() as u32, time) != reference {
            return Err(value_error(
                name,
                reference.tow_s(),
                "within half a week of the time sent",
            ));
        }
    }
    Ok(())
}

/// The data of subframes 1 to 3 for `ephemeris`, words 1 and 2 and the week number left out.
///
/// # Errors
/// [`NavError::Value`] names a number that its field cannot hold or that is no GPS orbit's.
pub(in crate::lnav) fn write(ephemeris: &Ephemeris) -> Result<[DataWords; 3], NavError> {
    ephemeris.check_orbit()?;
    let mut subframes = [DataWords::FILLER; 3];
    let [one, two, three] = &mut subframes;
    write_clock(ephemeris, one)?;
    two.set_bits(IODE_2, u32::from(ephemeris.iode));
    two.set_bits(TOE, reference_steps("toe", ephemeris.toe)?);
    two.set_bits(FIT_INTERVAL, u32::from(ephemeris.fit_interval_extended));
    two.set_bits(AODO, AODO_NONE);
    ORBIT_2
        .iter()
        .try_for_each(|term| term.write(two, ephemeris))?;
    three.set_bits(IODE_3, u32::from(ephemeris.iode));
    ORBIT_3
        .iter()
        .try_for_each(|term| term.write(three, ephemeris))?;
    Ok(subframes)
}

fn write_clock(ephemeris: &Ephemeris, one: &mut DataWords) -> Result<(), NavError> {
    let iodc = whole("iodc", ephemeris.iodc, 10)?;
    if iodc & 0xFF != u32::from(ephemeris.iode) {
        return Err(value_error(
            "iodc",
            f64::from(iodc),
            "its low eight bits equal to iode",
        ));
    }
    one.set_bits(IODC_HIGH, iodc >> 8);
    one.set_bits(IODC_LOW, iodc);
    one.set_bits(CODES_ON_L2, whole("codes_on_l2", ephemeris.codes_on_l2, 2)?);
    one.set_bits(URA, whole("ura_index", ephemeris.ura_index, 4)?);
    one.set_bits(HEALTH, whole("health", ephemeris.health, 6)?);
    one.set_bits(L2_P_DATA_OFF, u32::from(ephemeris.l2_p_data_off));
    one.set_bits(TOC, reference_steps("toc", ephemeris.toc)?);
    CLOCK.iter().try_for_each(|term| term.write(one, ephemeris))
}

/// Reads the ephemeris of `satellite` from subframes 1 to 3, subframe 1 sent at `time`.
///
/// # Errors
/// [`NavError::Value`] where the issues of data differ or a number is no GPS orbit's.
pub(in crate::lnav) fn read(
    satellite: SatelliteId,
    [one, two, three]: &[DataWords; 3],
    time: GpsTime,
) -> Result<Ephemeris, NavError> {
    let issues = [one.bits(IODC_LOW), two.bits(IODE_2), three.bits(IODE_3)];
    if issues[0] != issues[1] || issues[0] != issues[2] {
        return Err(value_error(
            "iode",
            f64::from(issues[1]),
            "the same in subframes 1 to 3",
        ));
    }
    let mut ephemeris = Ephemeris {
        iodc: (one.bits(IODC_HIGH) << 8 | one.bits(IODC_LOW)) as u16,
        iode: issues[1] as u8,
        health: one.bits(HEALTH) as u8,
        ura_index: one.bits(URA) as u8,
        codes_on_l2: one.bits(CODES_ON_L2) as u8,
        l2_p_data_off: one.bits(L2_P_DATA_OFF) == 1,
        fit_interval_extended: two.bits(FIT_INTERVAL) == 1,
        ..blank(
            satellite,
            reference_time("toc", one.bits(TOC), time)?,
            reference_time("toe", two.bits(TOE), time)?,
        )
    };
    CLOCK.iter().for_each(|term| term.read(one, &mut ephemeris));
    ORBIT_2
        .iter()
        .for_each(|term| term.read(two, &mut ephemeris));
    ORBIT_3
        .iter()
        .for_each(|term| term.read(three, &mut ephemeris));
    ephemeris.check_orbit()?;
    Ok(ephemeris)
}

fn whole(name: &'static str, value: impl Into<u32>, bits: u32) -> Result<u32, NavError> {
    let value = value.into();
    if value >> bits == 0 {
        Ok(value)
    } else {
        Err(value_error(
            name,
            f64::from(value),
            "a number its LNAV field can hold",
        ))
    }
}

fn reference_steps(name: &'static str, time: GpsTime) -> Result<u32, NavError> {
    let steps = (time.tow_s() / f64::from(STEP_S)).round();
    if steps * f64::from(STEP_S) == time.tow_s() {
        Ok(steps as u32)
    } else {
        Err(value_error(name, time.tow_s(), "a multiple of 16 s"))
    }
}

fn reference_time(name: &'static str, steps: u32, near: GpsTime) -> Result<GpsTime, NavError> {
    let second = steps * STEP_S;
    if i64::from(second) < SECONDS_PER_WEEK {
        Ok(nearest_time(second, near))
    } else {
        Err(value_error(name, f64::from(second), "below 604800 s"))
    }
}

fn value_error(name: &'static str, value: f64, expected: &'static str) -> NavError {
    NavError::Value {
        name,
        value: value.to_string(),
        expected,
    }
}

/// An ephemeris with every number still to be read.
const fn blank(satellite: SatelliteId, toc: GpsTime, toe: GpsTime) -> Ephemeris {
    Ephemeris {
        satellite,
        iodc: 0,
        iode: 0,
        health: 0,
        ura_index: 0,
        codes_on_l2: 0,
        l2_p_data_off: false,
        fit_interval_extended: false,
        toc,
        af0_s: 0.0,
        af1: 0.0,
        af2_per_s: 0.0,
        tgd_s: 0.0,
        toe,
        sqrt_a: 0.0,
        eccentricity: 0.0,
        m0_rad: 0.0,
        delta_n_rad_s: 0.0,
        omega0_rad: 0.0,
        omega_dot_rad_s: 0.0,
        i0_rad: 0.0,
        idot_rad_s: 0.0,
        omega_rad: 0.0,
        cuc_rad: 0.0,
        cus_rad: 0.0,
        crc_m: 0.0,
        crs_m: 0.0,
        cic_rad: 0.0,
        cis_rad: 0.0,
    }
}
