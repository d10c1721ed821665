//! Files, good and bad.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use rinex::prelude::{Constellation, Rinex};

use super::*;
use crate::test_data::data;

fn header_line(text: &str, label: &str) -> String {
    format!("{text:60}{label}\n")
}

/// Version 3: two epochs of two GPS satellites, a Galileo one between them.
fn version_3() -> String {
    [
        header_line(
            "     3.04           OBSERVATION DATA    M",
            "RINEX VERSION / TYPE",
        ),
        header_line(
            "  4157177.0658   671230.4766  4774767.0311",
            "APPROX POSITION XYZ",
        ),
        header_line("G    4 C1C L1C D1C S1C", "SYS / # / OBS TYPES"),
        header_line("E    1 C1C", "SYS / # / OBS TYPES"),
        header_line("     1.000", "INTERVAL"),
        header_line(
            "  2023     1     8    10     0    0.0000000     GPS",
            "TIME OF FIRST OBS",
        ),
        header_line("", "END OF HEADER"),
        "> 2023 01 08 10 00  0.0000000  0  3\n".to_owned(),
        "G08  25065224.554 9 131718593.47119     -1476.856 9        54.233\n".to_owned(),
        "E05  23314820.121\n".to_owned(),
        "G 7  24589966.356\n".to_owned(),
        "> 2023 01 08 10 00  1.0000000  4  1\n".to_owned(),
        header_line("A COMMENT", "COMMENT"),
        "> 2023 01 08 10 00  1.9970000  0  1\n".to_owned(),
        "G08  25065505.601                       -1477.001           0.000\n".to_owned(),
    ]
    .concat()
}

/// Version 2: thirteen satellites, so that the list takes two lines, and six observables.
fn version_2() -> String {
    let mut text = [
        header_line(
            "     2.11           OBSERVATION DATA    G (GPS)",
            "RINEX VERSION / TYPE",
        ),
        header_line(
            "     6    L1    L2    C1    P2    D1    S1",
            "# / TYPES OF OBSERV",
        ),
        header_line("", "END OF HEADER"),
    ]
    .concat();
    let list: String = (1..=12).map(|prn| format!("G{prn:2}")).collect();
    text += &format!(" 12  1 26 12 45 58.1000000  0 13{list}\n");
    text += &format!("{:32}R03\n", "");
    for prn in 1..=13 {
        let code = 2.0e7 + f64::from(prn) * 1000.125;
        text += &format!(
            "{:14.3}17{:16}{:14.3}  {:16}{:14.3}\n",
            1.05e8, "", code, "", -1234.5
        );
        text += &format!("{:14.3}\n", 45.25);
    }
    text
}

fn read(text: impl Into<Vec<u8>>) -> Result<Vec<ObservedEpoch>, String> {
    let reader = ObservationReader::new(Path::new("x.obs"), Box::new(Cursor::new(text.into())));
    reader
        .and_then(Iterator::collect)
        .map_err(|error| error.to_string())
}

#[test]
fn version_3_by_hand() {
    let epochs = read(version_3()).unwrap();
    assert_eq!(epochs.len(), 2);
    let g08 = ObservedSatellite {
        satellite: SatelliteId::gps(8),
        pseudorange_m: 25_065_224.554,
        phase_cycles: Some(131_718_593.471),
        loss_of_lock: 1,
        doppler_hz: Some(-1476.856),
        cn0_dbhz: Some(54.233),
    };
    assert_eq!(epochs[0].satellites[1], g08);
    assert_eq!(epochs[0].satellites[0].satellite, SatelliteId::gps(7));
    assert_eq!(epochs[0].satellites[0].doppler_hz, None);
    assert_eq!((epochs[0].line, epochs[1].line), (8, 14));
    // 2023-01-08 was a Sunday, the first day of week 2244.
    assert_eq!(epochs[0].time, GpsTime::from_parts(2244, 36_000, 0.0));
    assert_eq!(epochs[1].time, GpsTime::from_parts(2244, 36_001, 0.997));
    // Zero means no observation.
    assert_eq!(epochs[1].satellites[0].cn0_dbhz, None);
}

#[test]
fn version_2_by_hand() {
    let epochs = read(version_2()).unwrap();
    assert_eq!(epochs.len(), 1);
    let satellites = &epochs[0].satellites;
    assert_eq!(satellites.len(), 12);
    assert_eq!(satellites[11].pseudorange_m, 20_012_001.5);
    assert_eq!(satellites[0].doppler_hz, Some(-1234.5));
    assert_eq!(satellites[0].cn0_dbhz, Some(45.25));
    assert_eq!(satellites[0].loss_of_lock, 1);
    // The flight recording's week.
    assert_eq!(epochs[0].time, GpsTime::from_parts(1672, 391_558, 0.1));
}

#[test]
fn compressed_by_gzip_and_by_hatanaka() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.obs.gz");
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(version_3().as_bytes()).unwrap();
    std::fs::write(&path, encoder.finish().unwrap()).unwrap();
    let epochs: Vec<_> = ObservationReader::open(&path)
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap();
    assert_eq!(epochs, read(version_3()).unwrap());
    // The same observations, written as differences; the comment is left out.
    let header = version_3();
    let header = header.split_once("> 2023").unwrap().0;
    let compact = [
        &header_line(
            "3.0                 COMPACT RINEX FORMAT",
            "CRINEX VERS   / TYPE",
        ),
        &header_line("by hand", "CRINEX PROG / DATE"),
        header,
        "> 2023 01 08 10 00  0.0000000  0  3      G08E05G 7\n",
        "\n",
        "3&25065224554 3&131718593471 3&-1476856 3&54233 &9195&9&&\n",
        "3&23314820121\n",
        "3&24589966356\n",
        &format!("{:20}1 997{:9}1{:9}&&&&&&\n", "", "", ""),
        "\n",
        "281047  -145  &&&&\n",
    ]
    .concat();
    let epochs = read(compact).unwrap();
    let plain = read(version_3()).unwrap();
    assert_eq!(epochs[0].satellites, plain[0].satellites);
    assert_eq!(epochs[1].satellites, plain[1].satellites);
    assert_eq!(epochs[1].time, plain[1].time);
}

#[test]
fn malformed_files_are_one_line_that_names_the_place() {
    let good = version_3();
    let cases: [(&str, &str, &str); 12] = [
        (
            "3.04",
            "4.00",
            "line 1: RINEX version '4.00': expected 2 or 3",
        ),
        (
            "OBSERVATION DATA",
            "NAVIGATION DATA ",
            "expected observation data",
        ),
        (
            "C1C L1C D1C S1C",
            "C1X L1X D1X S1X",
            "no observable C1C of GPS",
        ),
        (
            "     GPS     ",
            "     GLO     ",
            "time system 'GLO': expected GPS",
        ),
        (
            "10 00  1.9970000  0  1",
            "10 00 61.9970000  0  1",
            "line 14: an epoch at",
        ),
        (
            "10 00  1.9970000  0  1",
            "10 00  1.9970000  9  1",
            "epoch flag '9'",
        ),
        (
            "10 00  1.9970000  0  1",
            "10 00  1.9970000  0  x",
            "an epoch of 'x'",
        ),
        (
            "> 2023 01 08 10 00  1.99",
            "  2023 01 08 10 00  1.99",
            "begins with >",
        ),
        (
            "25065505.601  ",
            " 25065505.601 ",
            "line 15: '   25065505.60' in columns 4 to 17",
        ),
        (
            "25065505.601",
            "         NaN",
            "expected a number with three decimals",
        ),
        (
            "G08  25065505",
            "?08  25065505",
            "'?08': expected a satellite",
        ),
        ("G 7", "G 8", "G08 twice in one epoch"),
    ];
    for (from, to, expected) in cases {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let message = read(text).unwrap_err();
        assert!(message.starts_with("x.obs: "), "{message}");
        assert!(message.contains(expected), "{message}: {expected}");
        assert!(!message.contains('\n'), "{message}");
    }
    let more = good.replacen("1.9970000  0  1", "1.9970000  0  2", 1);
    assert_eq!(read(more).unwrap()[1].missing, 1);
    let more = good.replacen("0.0000000  0  3", "0.0000000  0  5", 1);
    let epochs = read(more).unwrap();
    assert_eq!((epochs[0].missing, epochs[0].satellites.len()), (2, 2));
    assert_eq!(epochs[1], read(good.clone()).unwrap()[1]);
    let two = version_2();
    let cut = &two[..two.len() - 17];
    assert!(
        read(cut)
            .unwrap_err()
            .contains("the file ends within an epoch")
    );
    for text in ["", "\n\n", "time_s,x\n1,2\n", "\u{0}\u{1}"] {
        assert!(read(text).unwrap_err().contains("no RINEX"));
    }
    // Systems nobody has heard of are passed over.
    assert_eq!(
        read(good.replace("E05", "Y05")).unwrap()[0],
        read(good.clone()).unwrap()[0]
    );
    let long = "x".repeat(100_000);
    assert!(read(long).unwrap_err().contains("longer than"));
}

#[test]
fn a_file_cut_anywhere_gives_an_error_or_whole_epochs() {
    let whole = read(version_3()).unwrap();
    let text = version_3();
    for length in 0..text.len() {
        if let Ok(epochs) = read(&text.as_bytes()[..length]) {
            // Whatever optional columns of the last line are cut off, no number is half.
            assert!(epochs.len() <= whole.len(), "{length}");
            for (cut, full) in epochs.iter().zip(&whole) {
                for c in &cut.satellites {
                    let mut all = full.satellites.iter();
                    let f = all.find(|f| f.satellite == c.satellite).unwrap();
                    assert_eq!(c.pseudorange_m, f.pseudorange_m, "{length}");
                    assert!(c.doppler_hz.is_none() || c.doppler_hz == f.doppler_hz);
                }
            }
        }
    }
}

/// Pseudorange, phase, Doppler, strength.
type Values = [Option<f64>; 4];

/// All GPS L1 C/A observations by the `rinex` crate: week, nanosecond and PRN to values.
fn by_the_crate(rinex: &Rinex) -> BTreeMap<(i32, u64, u8), Values> {
    let mut found: BTreeMap<_, Values> = BTreeMap::new();
    for (key, epoch) in rinex.record.as_obs().unwrap() {
        let (week, nanoseconds) = key.epoch.to_time_of_week();
        for signal in &epoch.signals {
            if signal.sv.constellation != Constellation::GPS || signal.value == 0.0 {
                continue;
            }
            let names = ["C1C", "L1C", "D1C", "S1C"];
            let name = signal.observable.to_string();
            if let Some(which) = names.iter().position(|n| *n == name) {
                let id = (week.cast_signed(), nanoseconds, signal.sv.prn);
                found.entry(id).or_default()[which] = Some(signal.value);
            }
        }
    }
    found.retain(|_, values| values[0].is_some());
    found
}

#[test]
fn every_value_is_that_of_the_rinex_crate() {
    for (name, least) in [
        (
            "rinex/02_esbc_2020177_30s/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
            33_000,
        ),
        ("rinex/11_f9p_spirent_15min_1hz/f9p.obs.gz", 7_000),
    ] {
        let Some(path) = data(name) else { continue };
        let mut expected = by_the_crate(&Rinex::from_gzip_file(&path).unwrap());
        let mut count = 0;
        for epoch in ObservationReader::open(&path).unwrap() {
            let epoch = epoch.unwrap();
            for satellite in epoch.satellites {
                let nanoseconds = (epoch.time.fraction_s() * 1e9).round() as u64
                    + u64::from(epoch.time.second().unsigned_abs()) * 1_000_000_000;
                let id = (epoch.time.week(), nanoseconds, satellite.satellite.prn);
                let values = expected.remove(&id);
                let ours = [
                    Some(satellite.pseudorange_m),
                    satellite.phase_cycles,
                    satellite.doppler_hz,
                    satellite.cn0_dbhz,
                ];
                for (k, (ours, theirs)) in ours.iter().zip(values.unwrap()).enumerate() {
                    let (Some(ours), Some(theirs)) = (ours, theirs) else {
                        assert_eq!(*ours, theirs, "{name} {id:?} {k}");
                        continue;
                    };
                    // Both are the f64 nearest to the same decimals, or a last place from it.
                    assert!((ours - theirs).abs() <= ours.abs() * 3e-16, "{id:?} {k}");
                }
                count += 1;
            }
        }
        assert!(expected.is_empty(), "{name}: {} left", expected.len());
        assert!(count > least, "{name}: {count}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let _ = read(bytes);
    }

    #[test]
    fn damage_never_panics_and_is_one_line(
        compact in any::<bool>(),
        two in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut text = if two { version_2() } else { version_3() }.into_bytes();
        if compact {
            let mut with = header_line("3.0", "CRINEX VERS   / TYPE").into_bytes();
            with.extend(header_line("", "CRINEX PROG / DATE").into_bytes());
            with.extend(text);
            text = with;
        }
        for (at, byte) in changes {
            let at = at.index(text.len());
            text[at] = byte;
        }
        text.truncate(cut.index(text.len()) + 1);
        if let Err(message) = read(text) {
            prop_assert!(!message.contains('\n'), "{message}");
        }
    }
}
