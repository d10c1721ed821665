//! GPS ephemerides from RINEX 2 and 3 navigation files: just enough for these tests.

use gnss_nav::{Calendar, Ephemeris, EphemerisStore, GpsTime, Klobuchar, SatelliteId};

/// Ephemerides and ionosphere of a navigation file.
pub(crate) struct Navigation {
    pub(crate) store: EphemerisStore,
    pub(crate) klobuchar: Option<Klobuchar>,
}

/// Reads the GPS records of `text`.
pub(crate) fn read(text: &str) -> Navigation {
    let version_2 = text.trim_start().starts_with('2');
    let (header, body): (Vec<&str>, Vec<&str>) = {
        let end = text
            .lines()
            .position(|l| l.contains("END OF HEADER"))
            .unwrap();
        (
            text.lines().take(end).collect(),
            text.lines().skip(end + 1).collect(),
        )
    };
    let mut store = EphemerisStore::new();
    let mut lines = body.into_iter().peekable();
    while let Some(first) = lines.next() {
        if !version_2 && !first.starts_with('G') {
            continue;
        }
        let rest: Vec<&str> = lines.by_ref().take(7).collect();
        store.insert(record(first, &rest, version_2));
    }
    Navigation {
        store,
        klobuchar: klobuchar(&header),
    }
}

fn klobuchar(header: &[&str]) -> Option<Klobuchar> {
    let four = |label: &str, start: usize| {
        let line = header.iter().find(|line| line.contains(label))?;
        let value = |k: usize| field(line, start + 12 * k, 12);
        Some([value(0), value(1), value(2), value(3)])
    };
    Some(Klobuchar {
        alpha: four("ION ALPHA", 2).or_else(|| four("GPSA", 5))?,
        beta: four("ION BETA", 2).or_else(|| four("GPSB", 5))?,
    })
}

fn record(first: &str, rest: &[&str], version_2: bool) -> Ephemeris {
    let margin = if version_2 { 3 } else { 4 };
    let value = |line: usize, k: usize| match line {
        0 => field(first, margin + 19 * (k + 1), 19),
        _ => field(rest[line - 1], margin + 19 * k, 19),
    };
    let prn = first[..margin - 1]
        .trim_start_matches('G')
        .trim()
        .parse()
        .unwrap();
    Ephemeris {
        satellite: SatelliteId::gps(prn),
        iodc: value(6, 3) as u16,
        iode: value(1, 0) as u8,
        health: value(6, 1) as u8,
        ura_index: ura_index(value(6, 0)),
        codes_on_l2: value(5, 1) as u8,
        l2_p_data_off: value(5, 3) != 0.0,
        fit_interval_extended: value(7, 1) > 4.0,
        toc: epoch(&first[margin - 1..margin + 19]),
        af0_s: value(0, 0),
        af1: value(0, 1),
        af2_per_s: value(0, 2),
        tgd_s: value(6, 2),
        toe: GpsTime::new(value(5, 2) as i32, value(3, 0)),
        sqrt_a: value(2, 3),
        eccentricity: value(2, 1),
        m0_rad: value(1, 3),
        delta_n_rad_s: value(1, 2),
        omega0_rad: value(3, 2),
        omega_dot_rad_s: value(4, 3),
        i0_rad: value(4, 0),
        idot_rad_s: value(5, 0),
        omega_rad: value(4, 2),
        cuc_rad: value(2, 0),
        cus_rad: value(2, 2),
        crc_m: value(4, 1),
        crs_m: value(1, 1),
        cic_rad: value(3, 1),
        cis_rad: value(3, 3),
    }
}

fn epoch(text: &str) -> GpsTime {
    let numbers: Vec<f64> = text
        .split_whitespace()
        .map(|n| n.parse().unwrap())
        .collect();
    let year = numbers[0] as i32;
    let date = Calendar {
        year: if year < 100 { year + 2000 } else { year },
        month: numbers[1] as u8,
        day: numbers[2] as u8,
        hour: numbers[3] as u8,
        minute: numbers[4] as u8,
        second: numbers[5] as u8,
        fraction_s: 0.0,
    };
    date.try_into().unwrap()
}

/// Index of an accuracy in metres: the limits between indices of IS-GPS-200 20.3.3.3.1.3.
fn ura_index(accuracy_m: f64) -> u8 {
    let limits_m = [2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24.0, 48.0, 96.0];
    limits_m.iter().filter(|&&limit| accuracy_m > limit).count() as u8
}

fn field(line: &str, start: usize, width: usize) -> f64 {
    let end = (start + width).min(line.len());
    let text = line
        .get(start..end)
        .unwrap_or("")
        .trim()
        .replace(['D', 'd'], "E");
    if text.is_empty() {
        0.0
    } else {
        text.parse().unwrap()
    }
}
