//! Broadcast ephemerides and ionosphere parameters from RINEX navigation files (versions 2 and 3,
//! plain or gzip).

use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use gnss_nav::{Ephemeris, GpsTime, Klobuchar, SatelliteId};
use rinex::navigation::{Ephemeris as RinexEphemeris, IonosphereModel, NavMessageType};
use rinex::prelude::{Constellation, Rinex};

use crate::ReceiverError;

/// What a RINEX navigation file says about GPS.
#[derive(Debug, Clone, PartialEq)]
pub struct NavigationFile {
    /// Every GPS LNAV ephemeris, by reference time of the clock and then by satellite.
    pub ephemerides: Vec<Ephemeris>,
    /// Klobuchar parameters, where the file has them.
    pub ionosphere: Option<Klobuchar>,
    /// Leap seconds, GPS minus UTC, where the file has them.
    pub leap_seconds: Option<i32>,
}

impl NavigationFile {
    /// Satellites with an ephemeris, in order and once each.
    #[must_use]
    pub fn satellites(&self) -> Vec<SatelliteId> {
        let mut all: Vec<_> = self.ephemerides.iter().map(|e| e.satellite).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// Reads the file at `path`.
///
/// # Errors
/// [`ReceiverError::File`] where it cannot be opened; [`ReceiverError::Content`] where it is no
/// RINEX navigation file, holds no GPS ephemeris, or one of them lacks a value.
pub fn read(path: &Path) -> Result<NavigationFile, ReceiverError> {
    let bytes = std::fs::read(path).map_err(|source| ReceiverError::File {
        path: path.to_owned(),
        source,
    })?;
    let file = if bytes.starts_with(&[0x1f, 0x8b]) {
        guarded(|| Rinex::from_gzip_file(path)).and_then(|rinex| extract(&rinex))
    } else {
        parse(&bytes)
    };
    file.map_err(|what| ReceiverError::Content {
        path: path.to_owned(),
        what,
    })
}

/// Reads uncompressed RINEX navigation text from memory.
///
/// # Errors
/// As [`read`], without the path.
pub fn parse(text: &[u8]) -> Result<NavigationFile, String> {
    let mut text = text.to_vec();
    accept_older_title(&mut text);
    for byte in &mut text {
        // Comments in national characters are common, and the parser wants ASCII.
        if !byte.is_ascii() {
            *byte = b'?';
        }
    }
    let mut reader = BufReader::new(&text[..]);
    guarded(|| Rinex::parse(&mut reader)).and_then(|rinex| extract(&rinex))
}

/// Some writers of version 3 call the file `N: NAVIGATION DATA`, which the parser does not know.
fn accept_older_title(text: &mut [u8]) {
    const TITLE: &[u8; 20] = b"N: GNSS NAV DATA    ";
    if let Some(title) = text.get_mut(20..40)
        && title.starts_with(b"N: NAVIGATION DATA")
    {
        title.copy_from_slice(TITLE);
    }
}

/// Runs the parser, which is not ours: it may slice a line inside a character or count past its
/// end in a damaged file, and that has to stay an error of the file.
fn guarded<E: std::fmt::Display>(
    parse: impl FnOnce() -> Result<Rinex, E>,
) -> Result<Rinex, String> {
    match catch_unwind(AssertUnwindSafe(parse)) {
        Ok(Ok(rinex)) => Ok(rinex),
        Ok(Err(error)) => Err(format!(
            "no RINEX navigation file ({error}): expected version 2 or 3"
        )),
        Err(_) => Err("no valid RINEX navigation file: damaged".to_owned()),
    }
}

fn extract(rinex: &Rinex) -> Result<NavigationFile, String> {
    let Some(record) = rinex.record.as_nav() else {
        return Err("RINEX, but not a navigation file".to_owned());
    };
    let mut ephemerides = Vec::new();
    for (key, frame) in record {
        let gps = key.sv.constellation == Constellation::GPS;
        let (true, NavMessageType::LNAV, Some(found)) = (gps, key.msgtype, frame.as_ephemeris())
        else {
            continue;
        };
        let (week, nanoseconds) = key.epoch.to_time_of_week();
        // Reference times are whole seconds in LNAV, so nothing is lost.
        let toc = GpsTime::new(week.cast_signed(), (nanoseconds as f64 * 1e-9).round());
        ephemerides.push(ephemeris(SatelliteId::gps(key.sv.prn), toc, found)?);
    }
    if ephemerides.is_empty() {
        return Err("holds no GPS ephemeris".to_owned());
    }
    Ok(NavigationFile {
        ephemerides,
        ionosphere: klobuchar(rinex),
        leap_seconds: rinex.header.leap.and_then(|l| i32::try_from(l.leap).ok()),
    })
}

fn ephemeris(
    satellite: SatelliteId,
    toc: GpsTime,
    from: &RinexEphemeris,
) -> Result<Ephemeris, String> {
    let value = |name: &str| match from.get_orbit_f64(name) {
        Some(value) if value.is_finite() => Ok(value),
        _ => Err(format!("the ephemeris of {satellite} lacks '{name}'")),
    };
    let optional = |name: &str| from.get_orbit_f64(name).unwrap_or(0.0);
    Ok(Ephemeris {
        satellite,
        // Simulators count past the bits that are broadcast: keep those.
        iodc: value("iodc")? as u16 & 0x3ff,
        iode: (value("iode")? as u16 & 0xff) as u8,
        health: (value("health")? as u16 & 0x3f) as u8,
        ura_index: ura_index(value("accuracy")?),
        codes_on_l2: optional("l2Codes") as u8,
        l2_p_data_off: optional("l2p") != 0.0,
        fit_interval_extended: is_fit_extended(optional("fitInt")),
        toc,
        af0_s: from.clock_bias,
        af1: from.clock_drift,
        af2_per_s: from.clock_drift_rate,
        tgd_s: value("tgd")?,
        toe: toe(toc, value("toe")?),
        sqrt_a: value("sqrta")?,
        eccentricity: value("e")?,
        m0_rad: value("m0")?,
        delta_n_rad_s: value("deltaN")?,
        omega0_rad: value("omega0")?,
        omega_dot_rad_s: value("omegaDot")?,
        i0_rad: value("i0")?,
        idot_rad_s: value("idot")?,
        omega_rad: value("omega")?,
        cuc_rad: value("cuc")?,
        cus_rad: value("cus")?,
        crc_m: value("crc")?,
        crs_m: value("crs")?,
        cic_rad: value("cic")?,
        cis_rad: value("cis")?,
    })
}

/// `toe` from its time of week, in the week that brings it nearest to `toc`: the week printed
/// beside it is that of transmission in some files and modulo 1024 in others.
fn toe(toc: GpsTime, toe_tow_s: f64) -> GpsTime {
    let same_week = GpsTime::new(toc.week(), toe_tow_s);
    let weeks_off = ((same_week - toc) / 604_800.0).round();
    same_week - weeks_off * 604_800.0
}

/// URA index of an accuracy in metres (IS-GPS-200, 20.3.3.3.1.3): the first whose bound holds it.
fn ura_index(accuracy_m: f64) -> u8 {
    const BOUNDS_M: [f64; 15] = [
        2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24.0, 48.0, 96.0, 192.0, 384.0, 768.0, 1536.0, 3072.0,
        6144.0,
    ];
    BOUNDS_M.iter().filter(|bound| accuracy_m > **bound).count() as u8
}

/// Files hold the fit interval in hours (4 is the normal one) or the broadcast flag.
fn is_fit_extended(field: f64) -> bool {
    field == 1.0 || field > 4.0
}

fn klobuchar(rinex: &Rinex) -> Option<Klobuchar> {
    let header = rinex.header.ionod_corrections.get(&Constellation::GPS)?;
    let IonosphereModel::Klobuchar(model) = header else {
        return None;
    };
    Some(Klobuchar {
        alpha: model.alpha.into(),
        beta: model.beta.into(),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sink::navigation::accuracy_m;
    use crate::test_data::data;

    /// The numbers of every GPS entry of an uncompressed file, read by column, without the crate:
    /// satellite and 29 to 31 values of 19 characters.
    fn raw(text: &str) -> Vec<(u8, Vec<f64>)> {
        let version_3 = text.starts_with("     3");
        let body = text.split_once("END OF HEADER").unwrap().1;
        let lines: Vec<&str> = body.lines().skip(1).collect();
        let (prn_columns, margin) = if version_3 { (1..3, 4) } else { (0..2, 3) };
        let number = |line: &str, from: usize| {
            let end = (from + 19).min(line.len());
            let field = line.get(from..end).unwrap_or("").trim().replace('D', "E");
            field.parse().unwrap_or(0.0)
        };
        let mut found = Vec::new();
        for (i, line) in lines.iter().enumerate() {
            let starts = line.get(..margin - 1).is_some_and(|s| !s.trim().is_empty());
            if !starts || (version_3 && !line.starts_with('G')) {
                continue;
            }
            let clock = (0..3).map(|k| number(line, margin + 19 * (k + 1)));
            let orbit = lines[i + 1..i + 8]
                .iter()
                .flat_map(|line| (0..4).map(move |k| number(line, margin + 19 * k)));
            let prn = line[prn_columns.clone()].trim().parse().unwrap();
            let mut values: Vec<f64> = clock.chain(orbit).collect();
            // A simulator's IODE of 400 is broadcast in 8 bits.
            values[3] %= 256.0;
            found.push((prn, values));
        }
        found
    }

    /// Our fields in the order of the file.
    fn in_file_order(e: &Ephemeris) -> Vec<f64> {
        vec![
            e.af0_s,
            e.af1,
            e.af2_per_s,
            f64::from(e.iode),
            e.crs_m,
            e.delta_n_rad_s,
            e.m0_rad,
            e.cuc_rad,
            e.eccentricity,
            e.cus_rad,
            e.sqrt_a,
            e.toe.tow_s(),
            e.cic_rad,
            e.omega0_rad,
            e.cis_rad,
            e.i0_rad,
            e.crc_m,
            e.omega_rad,
            e.omega_dot_rad_s,
            e.idot_rad_s,
            f64::from(e.codes_on_l2),
            f64::from(e.toe.week()),
            f64::from(u8::from(e.l2_p_data_off)),
        ]
    }

    #[test]
    fn every_field_equals_the_text() {
        for name in [
            "if/braunschweig_flight/sxnsr_test_data_flight.12n",
            "if/simulated_static/brdc0010.22n",
            "rinex/03_spirent_4h_5min/Spirent_RINEX_GN.23N",
            "rinex/01_sept078m_1hz/SEPT078M.21P",
            "rinex/11_f9p_spirent_15min_1hz/f9p.nav",
        ] {
            let Some(path) = data(name) else { continue };
            let file = read(&path).unwrap();
            let text = std::fs::read_to_string(&path).unwrap();
            let mut expected = raw(&text);
            for ephemeris in &file.ephemerides {
                let ours = in_file_order(ephemeris);
                let prn = ephemeris.satellite.prn;
                let same = |(p, v): &(u8, Vec<f64>)| *p == prn && v[..ours.len()] == ours[..];
                let at = expected.iter().position(same);
                let Some(at) = at else {
                    let near: Vec<_> = expected.iter().filter(|(p, _)| *p == prn).collect();
                    panic!("{name}: {ephemeris:?} is not in the text: {near:?}");
                };
                let values = expected.remove(at).1;
                assert_eq!(
                    f64::from(ephemeris.health),
                    values[24],
                    "{name} G{prn:02} health"
                );
                assert_eq!(ephemeris.tgd_s, values[25]);
                assert_eq!(f64::from(ephemeris.iodc), values[26]);
                assert_eq!(ephemeris.fit_interval_extended, is_fit_extended(values[28]));
                let accuracy_m = accuracy_m(ephemeris.ura_index);
                // Files print 2^1.5 m as 2.8 or 2.9; below 2 m there is only index 0.
                let printed_m = values[23].max(2.0);
                assert!(
                    (accuracy_m - printed_m).abs() < 0.11,
                    "{name}: URA {printed_m} m"
                );
            }
            // What is left are repeated entries, which the crate drops.
            let repeated = expected.iter().filter(|(prn, values)| {
                !file
                    .ephemerides
                    .iter()
                    .any(|e| e.satellite.prn == *prn && e.toe.tow_s() == values[11])
            });
            assert_eq!(repeated.count(), 0, "{name}");
        }
    }

    #[test]
    fn header_values_and_compressed_files_are_read() {
        if let Some(path) = data("if/braunschweig_flight/sxnsr_test_data_flight.12n") {
            let file = read(&path).unwrap();
            let klobuchar = file.ionosphere.unwrap();
            assert_eq!(
                klobuchar.alpha,
                [0.1770e-07, -0.7451e-08, -0.5960e-07, 0.1192e-06]
            );
            assert_eq!(
                klobuchar.beta,
                [0.1311e+06, -0.1311e+06, 0.6554e+05, -0.2621e+06]
            );
            assert_eq!(file.leap_seconds, Some(15));
            assert_eq!(file.ephemerides[0].toc.week(), 1672);
        }
        for name in [
            "rinex/05_urbannav_tst_20190428/hksc1180.19n.gz",
            "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        ] {
            let Some(path) = data(name) else { continue };
            let file = read(&path).unwrap();
            assert!(file.satellites().len() > 20, "{name}");
            assert!(file.ionosphere.is_some(), "{name}");
        }
    }

    #[test]
    fn foreign_and_truncated_files_are_one_clear_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.nav");
        for text in [&b""[..], b"\x00\x01\x02", b"time_s,x\n1,2\n", b"\x1f\x8bxx"] {
            std::fs::write(&path, text).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(
                message.contains("x.nav: ") && !message.contains('\n'),
                "{message}"
            );
        }
        let missing = read(&folder.path().join("none")).unwrap_err().to_string();
        assert!(missing.contains("none: No such file"), "{missing}");
        let Some(original) = data("if/simulated_static/brdc0010.22n") else {
            return;
        };
        let text = std::fs::read(original).unwrap();
        for length in [60, 500, 650, 700, 760, 1000] {
            let result = parse(&text[..length]);
            if let Err(what) = result {
                assert!(!what.contains('\n'), "{what}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn damage_anywhere_never_panics(at in 0usize..6000, byte in any::<u8>(), cut in 0usize..6000) {
            let Some(original) = data("if/simulated_static/brdc0010.22n") else { return Ok(()) };
            let mut text = std::fs::read(original).unwrap();
            text.truncate(6000);
            text[at] = byte;
            text.truncate(cut.max(at + 1));
            let _ = parse(&text);
        }
    }
}
