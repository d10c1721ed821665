//! Files, good and bad.

use proptest::prelude::*;
use rinex::prelude::{Constellation, Rinex};

use super::message::is_fit_extended;
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

/// The orbit as the crate names it, in the order of [`in_file_order`] after the clock.
const NAMES: [&str; 17] = [
    "iode", "crs", "deltaN", "m0", "cuc", "e", "cus", "sqrta", "toe", "cic", "omega0", "cis", "i0",
    "crc", "omega", "omegaDot", "idot",
];

#[test]
fn the_crate_reads_the_same() {
    for name in [
        "if/simulated_static/brdc0010.22n",
        "rinex/01_sept078m_1hz/SEPT078M.21P",
        "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        "rinex/05_urbannav_tst_20190428/hksc1180.19n.gz",
    ] {
        let Some(path) = data(name) else { continue };
        let theirs = if name.ends_with("gz") {
            Rinex::from_gzip_file(&path).unwrap()
        } else {
            Rinex::from_file(&path).unwrap()
        };
        let ours = read(&path).unwrap();
        let mut count = 0;
        for (key, frame) in theirs.record.as_nav().unwrap() {
            let gps = key.sv.constellation == Constellation::GPS;
            let Some(found) = frame.as_ephemeris().filter(|_| gps) else {
                continue;
            };
            let mut values = vec![found.clock_bias, found.clock_drift, found.clock_drift_rate];
            values.extend(NAMES.map(|name| found.get_orbit_f64(name).unwrap()));
            let same = |e: &&Ephemeris| {
                e.satellite.prn == key.sv.prn && in_file_order(e)[..20] == values[..]
            };
            assert!(ours.ephemerides.iter().any(|e| same(&e)), "{name}: {key:?}");
            count += 1;
        }
        assert!(count > 20, "{name}: {count}");
    }
}

fn from_memory(text: &[u8]) -> Result<NavigationFile, String> {
    parse(Path::new("x"), text).map_err(|error| error.to_string())
}

/// A header and one message of version 3.
fn small() -> String {
    let header = |text: &str, label: &str| format!("{text:60}{label}\n");
    let mut text = header(
        "     3.04           N: GNSS NAV DATA    G",
        "RINEX VERSION / TYPE",
    );
    text += &header("    18", "LEAP SECONDS");
    text += &header("", "END OF HEADER");
    text += "R01 2023 01 08 10 15 00-6.285528361332D-04 2.273736754432D-12 0.000000000000D+00\n";
    text += "     7.400000000000D+01\n";
    text += "G02 2023 01 08 10 00 00-6.285528361332D-04 2.273736754432D-12 0.000000000000D+00\n";
    let orbit = [
        [74.0, 72.53125, 4.387_325_606_865e-9, -1.924],
        [4.1e-6, 2.0e-2, 7.4e-7, 5153.69],
        [36_000.0, 1.2e-7, -1.57, 4.1e-7],
        [0.966, 371.0, -1.34, -8.1e-9],
        [2.2e-11, 1.0, 2244.0, 0.0],
        [1.2, 0.0, 4.6e-9, 74.0],
        [36_000.0, 4.0, 0.0, 0.0],
    ];
    for line in orbit {
        text += "    ";
        for value in line {
            text += &format!("{value:19.12E}");
        }
        text += "\n";
    }
    text
}

#[test]
fn health_that_six_bits_cannot_be_is_not_good() {
    for (written, read) in [
        (" 0.000000000000E+00", 0),
        (" 6.300000000000E+01", 63),
        (" 6.400000000000E+01", 63),
        ("-1.000000000000E+00", 63),
        (" 5.000000000000E-01", 63),
    ] {
        let mut lines: Vec<String> = small().lines().map(str::to_owned).collect();
        let at = lines
            .iter()
            .position(|line| line.starts_with("G02"))
            .unwrap()
            + 6;
        lines[at].replace_range(23..42, written);
        let file = from_memory(lines.join("\n").as_bytes()).unwrap();
        assert_eq!(file.ephemerides[0].health, read, "{written}");
    }
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let good = small();
    assert_eq!(from_memory(good.as_bytes()).unwrap().leap_seconds, Some(18));
    let cut = |lines: usize| {
        let kept: Vec<&str> = good.lines().take(lines).collect();
        kept.join("\n")
    };
    for (text, expected) in [
        (
            good.replacen("3.04", "4.00", 1),
            "line 1: RINEX version '4.00': expected 2 or 3",
        ),
        (
            good.replacen("N: GNSS", "O: GNSS", 1),
            "line 1: a RINEX file of 'O: GNSS NAV DATA'",
        ),
        (
            cut(2),
            "line 2: no RINEX navigation file: the header has no end",
        ),
        (cut(5), "holds no GPS ephemeris"),
        (cut(9), "line 9: the file ends within the ephemeris of G02"),
        (
            good.replacen("G02", "G99", 1),
            "line 6: 'G99': expected a GPS satellite",
        ),
        (
            good.replacen("G02 2023 01", "G02 2023 13", 1),
            "line 6: G02 at '2023 13 08 10 00 00'",
        ),
        (
            good.replacen("E1", "X1", 1),
            "in columns 5 to 23: expected a number",
        ),
        (
            good.replace("3.600000000000E4", "             NaN"),
            "'NaN' in columns 5 to 23",
        ),
        (
            good.replacen("2.000000000000E-2", "                 ", 1),
            "G02 lacks its eccentricity",
        ),
        (
            good.replacen("2.000000000000E-2", "1.200000000000E+0", 1),
            "the ephemeris of G02: eccentricity",
        ),
        (
            cut(8) + "\nG03",
            "line 9: the ephemeris of G02 is cut short",
        ),
    ] {
        let message = from_memory(text.as_bytes()).unwrap_err();
        assert!(message.contains(expected), "{message}, not {expected}");
        assert!(!message.contains('\n'), "{message}");
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
        let result = from_memory(&text[..length]);
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
        let _ = from_memory(&text);
    }

    #[test]
    fn no_text_makes_it_panic(
        at in 0usize..1100, bytes in prop::collection::vec(any::<u8>(), 0..40), more in ".{0,200}"
    ) {
        let mut text = small().into_bytes();
        let at = at.min(text.len());
        let end = (at + bytes.len()).min(text.len());
        text.splice(at..end, bytes);
        text.extend(more.into_bytes());
        let _ = from_memory(&text);
    }

    #[test]
    fn no_number_makes_it_panic(value in any::<f64>(), line in 0usize..7, place in 0usize..4) {
        let mut lines: Vec<String> = small().lines().map(str::to_owned).collect();
        let from = 4 + 19 * place;
        lines[6 + line].replace_range(from..from + 19, &format!("{value:19.10E}"));
        let _ = from_memory(lines.join("\n").as_bytes());
    }
}
