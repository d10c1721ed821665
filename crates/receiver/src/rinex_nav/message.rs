//! One LNAV message of eight lines.

use gnss_nav::{Ephemeris, GpsTime, SatelliteId};

use crate::lines::Lines;
use crate::rinex_text::{Failure, Stamp, columns, number, shown};

/// Lines after the first, of four numbers each.
const ORBIT_LINES: usize = 7;
/// Columns of a number.
const WIDTH: usize = 19;

/// Where things stand, by version.
struct Layout {
    /// Columns of the satellite's number.
    prn: (usize, usize),
    toc: Stamp,
    /// Column of the clock's numbers in the first line, and of the orbit's in the others.
    clock: usize,
    orbit: usize,
}

const LAYOUT_2: Layout = Layout {
    prn: (0, 2),
    toc: Stamp {
        date: [(3, 5), (6, 8), (9, 11), (12, 14), (15, 17)],
        second: (17, 22),
    },
    clock: 22,
    orbit: 3,
};

const LAYOUT_3: Layout = Layout {
    prn: (1, 3),
    toc: Stamp {
        date: [(4, 8), (9, 11), (12, 14), (15, 17), (18, 20)],
        second: (21, 23),
    },
    clock: 23,
    orbit: 4,
};

/// The next message of a GPS satellite; none at the end of the file.
pub(super) fn next(lines: &mut Lines, version: u8) -> Result<Option<Ephemeris>, Failure> {
    while lines.advance()? {
        // Messages of other systems, and their lines, which begin with blanks.
        let is_gps = match version {
            2 => lines.current().iter().any(|c| !c.is_ascii_whitespace()),
            _ => lines.current().first() == Some(&b'G'),
        };
        if is_gps {
            return message(lines, version).map(Some);
        }
    }
    Ok(None)
}

fn message(lines: &mut Lines, version: u8) -> Result<Ephemeris, Failure> {
    let layout = if version == 2 { LAYOUT_2 } else { LAYOUT_3 };
    let line = lines.current();
    let (from, to) = layout.prn;
    let Some(prn @ 1..=63) = number(line, from, to) else {
        let found = shown(line.get(..3).unwrap_or(line));
        let what = format!("'{found}': expected a GPS satellite");
        return Err(Failure::at(lines, what));
    };
    let satellite = SatelliteId::gps(prn);
    let Some(toc) = layout.toc.read(line) else {
        let found = shown(columns(line, layout.toc.date[0].0, layout.toc.second.1));
        let what = format!("{satellite} at '{found}': expected year month day hour minute second");
        return Err(Failure::at(lines, what));
    };
    let mut clock = [0.0; 3];
    for (k, value) in clock.iter_mut().enumerate() {
        let from = layout.clock + WIDTH * k;
        *value = real(lines, from, from + WIDTH)?.unwrap_or(0.0);
    }
    let mut orbit = [None; 4 * ORBIT_LINES];
    for four in orbit.chunks_exact_mut(4) {
        if !lines.advance()? {
            let what = format!("the file ends within the ephemeris of {satellite}");
            return Err(Failure::at(lines, what));
        }
        if !columns(lines.current(), 0, layout.orbit).is_empty() {
            let what = format!("the ephemeris of {satellite} is cut short: expected 8 lines");
            return Err(Failure::at(lines, what));
        }
        for (k, value) in four.iter_mut().enumerate() {
            let from = layout.orbit + WIDTH * k;
            *value = real(lines, from, from + WIDTH)?;
        }
    }
    ephemeris(satellite, toc, clock, &orbit).map_err(|what| Failure::at(lines, what))
}

/// The number in columns `from..to` of the current line, none where they are blank; exponents as
/// Fortran writes them.
pub(super) fn real(lines: &Lines, from: usize, to: usize) -> Result<Option<f64>, Failure> {
    let field = columns(lines.current(), from, to);
    if field.is_empty() {
        return Ok(None);
    }
    let text: String = field
        .iter()
        .map(|c| {
            if matches!(c, b'D' | b'd') {
                'E'
            } else {
                char::from(*c)
            }
        })
        .collect();
    let value = text.parse().ok().filter(|v: &f64| v.is_finite());
    value.map(Some).ok_or_else(|| {
        let what = format!(
            "'{}' in columns {} to {to}: expected a number",
            shown(field),
            from + 1
        );
        Failure::at(lines, what)
    })
}

/// The ephemeris; `orbit` in the order of the file.
fn ephemeris(
    satellite: SatelliteId,
    toc: GpsTime,
    [af0_s, af1, af2_per_s]: [f64; 3],
    orbit: &[Option<f64>; 4 * ORBIT_LINES],
) -> Result<Ephemeris, String> {
    let value = |at: usize, name: &str| {
        orbit[at].ok_or_else(|| format!("the ephemeris of {satellite} lacks its {name}"))
    };
    let optional = |at: usize| orbit[at].unwrap_or(0.0);
    let ephemeris = Ephemeris {
        satellite,
        af0_s,
        af1,
        af2_per_s,
        // Simulators count past the bits that are broadcast: keep those.
        iode: (value(0, "IODE")? as u16 & 0xff) as u8,
        crs_m: value(1, "Crs")?,
        delta_n_rad_s: value(2, "Delta n")?,
        m0_rad: value(3, "M0")?,
        cuc_rad: value(4, "Cuc")?,
        eccentricity: value(5, "eccentricity")?,
        cus_rad: value(6, "Cus")?,
        sqrt_a: value(7, "sqrt(A)")?,
        toe: toe(toc, value(8, "Toe")?),
        cic_rad: value(9, "Cic")?,
        omega0_rad: value(10, "OMEGA0")?,
        cis_rad: value(11, "Cis")?,
        i0_rad: value(12, "i0")?,
        crc_m: value(13, "Crc")?,
        omega_rad: value(14, "omega")?,
        omega_dot_rad_s: value(15, "OMEGA DOT")?,
        idot_rad_s: value(16, "IDOT")?,
        codes_on_l2: optional(17) as u8,
        l2_p_data_off: optional(19) != 0.0,
        ura_index: ura_index(value(20, "accuracy")?),
        health: health(value(21, "health")?),
        tgd_s: value(22, "TGD")?,
        iodc: value(23, "IODC")? as u16 & 0x3ff,
        fit_interval_extended: is_fit_extended(optional(25)),
        toc,
    };
    let flies = ephemeris.check_orbit();
    flies.map_err(|error| format!("the ephemeris of {satellite}: {error}"))?;
    Ok(ephemeris)
}

/// The six bits of health; what six bits cannot be is not healthy.
fn health(field: f64) -> u8 {
    let whole = field as u8;
    if f64::from(whole) == field && whole < 64 {
        whole
    } else {
        63
    }
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
pub(super) fn is_fit_extended(field: f64) -> bool {
    field == 1.0 || field > 4.0
}
