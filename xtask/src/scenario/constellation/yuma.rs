//! YUMA almanacs, read as ephemerides.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail, ensure};
use gnss_nav::constants::{EARTH_RATE_RAD_S, MU_M3_PER_S2};
use gnss_nav::{Ephemeris, GpsTime, SatelliteId, lnav};

use super::nominal::wrapped;
use super::{blank, issue_of, nearest_reference};

/// Almanac weeks are counted modulo this, or in full.
const WEEK_CYCLE: i32 = 1024;

/// Ephemerides of the healthy satellites of an almanac, brought to `start`, by PRN.
///
/// Node, mean anomaly and clock are carried from the almanac's time of applicability to a
/// reference time near `start`, so that the satellite flies on where the almanac says.
pub(super) fn ephemerides(text: &str, start: GpsTime) -> Result<Vec<Ephemeris>> {
    let mut all = Vec::new();
    for (number, record) in records(text)? {
        let record = Record {
            line: number,
            fields: record,
        };
        if record.number("health")? == 0.0 {
            let sent = lnav::quantise(&record.ephemeris(start)?);
            all.push(sent.with_context(|| format!("line {number}"))?);
        }
    }
    ensure!(
        !all.is_empty(),
        "no healthy satellite: expected a YUMA almanac"
    );
    all.sort_by_key(|e| e.satellite);
    Ok(all)
}

type Fields = BTreeMap<String, f64>;

/// The `name: value` lines of each satellite, with the number of the first of them.
fn records(text: &str) -> Result<Vec<(usize, Fields)>> {
    let mut records: Vec<(usize, Fields)> = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        let Some((name, value)) = line.split_once(':') else {
            continue;
        };
        let key = key_of(name);
        if key == "id" {
            records.push((number, Fields::new()));
        }
        let Some((_, fields)) = records.last_mut() else {
            continue;
        };
        let Ok(value) = value.trim().parse() else {
            bail!(
                "line {number}: {} is {:?}: expected a number",
                name.trim(),
                value.trim()
            );
        };
        fields.insert(key, value);
    }
    Ok(records)
}

/// Writers differ in blanks, case and units in brackets.
fn key_of(name: &str) -> String {
    let bare = name.split('(').next().unwrap_or_default();
    let kept = bare.chars().filter(|c| c.is_ascii_alphanumeric());
    kept.collect::<String>().to_ascii_lowercase()
}

struct Record {
    line: usize,
    fields: Fields,
}

impl Record {
    fn number(&self, key: &str) -> Result<f64> {
        let value = self.fields.get(key).copied();
        value.with_context(|| format!("line {}: the satellite has no {key}", self.line))
    }

    fn ephemeris(&self, start: GpsTime) -> Result<Ephemeris> {
        let prn = self.number("id")?;
        ensure!(
            (1.0..=32.0).contains(&prn),
            "line {}: ID is {prn}: expected 1 to 32",
            self.line
        );
        let applicable = self.time_of_applicability(start)?;
        let toe = nearest_reference(start);
        let sqrt_a = self.number("sqrt")?;
        let mean_motion_rad_s = (MU_M3_PER_S2 / sqrt_a.powi(6)).sqrt();
        let node_rate_rad_s = self.number("rateofrightascen")?;
        let later_s = toe - applicable;
        let node_rad = self.number("rightascenatweek")?
            + (node_rate_rad_s - EARTH_RATE_RAD_S) * later_s
            + EARTH_RATE_RAD_S * (toe.tow_s() - applicable.tow_s());
        let issue = issue_of(toe);
        Ok(Ephemeris {
            satellite: SatelliteId::gps(prn as u8),
            iodc: issue.into(),
            iode: issue,
            af0_s: self.number("af0")? + self.number("af1")? * later_s,
            af1: self.number("af1")?,
            sqrt_a,
            eccentricity: self.number("eccentricity")?,
            m0_rad: wrapped(self.number("meananom")? + mean_motion_rad_s * later_s),
            omega0_rad: wrapped(node_rad),
            omega_dot_rad_s: node_rate_rad_s,
            i0_rad: self.number("orbitalinclination")?,
            omega_rad: wrapped(self.number("argumentofperigee")?),
            ..blank(toe)
        })
    }

    fn time_of_applicability(&self, start: GpsTime) -> Result<GpsTime> {
        let week = self.number("week")? as i32;
        let cycles = f64::from(start.week() - week) / f64::from(WEEK_CYCLE);
        let unrolled = if week < WEEK_CYCLE {
            week + WEEK_CYCLE * cycles.round() as i32
        } else {
            week
        };
        Ok(GpsTime::new(unrolled, self.number("timeofapplicability")?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALMANAC: &str = "******** Week 100 almanac for PRN-05 ********
ID:                         05
Health:                     000
Eccentricity:               0.5000000000E-002
Time of Applicability(s):  147456.0000
Orbital Inclination(rad):   0.9600000000
Rate of Right Ascen(r/s):  -0.8000000000E-008
SQRT(A)  (m 1/2):           5153.600000
Right Ascen at Week(rad):   0.1200000000E+001
Argument of Perigee(rad):   0.700000000
Mean Anom(rad):            -0.2000000000E+001
Af0(s):                     0.1000000000E-004
Af1(s/s):                   0.0000000000E+000
week:                        100
";

    #[test]
    fn the_satellite_flies_on_where_the_almanac_says() {
        // Near its own time and a day later the orbit is the same one.
        let applicable = GpsTime::new(2148, 147_456.0);
        let near = ephemerides(ALMANAC, applicable).unwrap()[0];
        let later = ephemerides(ALMANAC, applicable + 86_400.0).unwrap()[0];
        assert_eq!(near.satellite.prn, 5);
        let at = applicable + 40_000.0;
        let (a, b) = (near.state_at(at).unwrap(), later.state_at(at).unwrap());
        // The node rate of LNAV resolves 3.6e-13 rad/s: 0.5 m in half a day.
        assert!((a.position_ecef_m - b.position_ecef_m).norm() < 1.0);
        // At its time of applicability: node longitude as given, minus the earth's turn.
        let mut plain = near;
        (plain.toe, plain.toc) = (applicable, applicable);
        (plain.m0_rad, plain.omega0_rad) = (-2.0, 1.2);
        let (a, b) = (
            near.state_at(applicable).unwrap(),
            plain.state_at(applicable).unwrap(),
        );
        assert!((a.position_ecef_m - b.position_ecef_m).norm() < 1.0);
    }

    #[test]
    fn what_is_missing_is_named() {
        let message = |text: &str| {
            let error = ephemerides(text, GpsTime::new(2148, 0.0)).unwrap_err();
            format!("{error:#}")
        };
        assert_eq!(
            message(&ALMANAC.replace("Mean", "Meen")),
            "line 2: the satellite has no meananom"
        );
        assert!(message(&ALMANAC.replace("0.96", "x")).starts_with("line 6: Orbital"));
        assert!(message("").contains("no healthy satellite"));
    }
}
