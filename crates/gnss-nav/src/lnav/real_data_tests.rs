//! Quantising broadcast ephemerides leaves them as they are: a check of every scale factor.

use std::path::PathBuf;

use super::quantise;
use crate::{Ephemeris, GpsTime, SatelliteId};

/// Numbers of one RINEX 2 record: eight lines, four columns of 19 characters after the third. The
/// first column of all is the date.
fn numbers(lines: &[&str]) -> Vec<f64> {
    let columns = lines
        .iter()
        .flat_map(|line| (0..4).filter_map(|column| line.get(3 + 19 * column..22 + 19 * column)));
    let number = |text: &str| text.trim().replace('D', "E").parse().unwrap_or(f64::NAN);
    columns.skip(1).map(number).collect()
}

fn ephemeris(lines: &[&str]) -> Option<Ephemeris> {
    let satellite = SatelliteId::gps(lines[0].get(..2)?.trim().parse().ok()?);
    let date: Vec<f64> = lines[0]
        .get(2..22)?
        .split_whitespace()
        .filter_map(|t| t.parse().ok())
        .collect();
    let n = numbers(lines);
    let toe = GpsTime::new(n[21] as i32, n[11]);
    let of_day = date[3] * 3600.0 + date[4] * 60.0 + date[5];
    let toc = super::nearest_time(((n[11] / 86_400.0).floor() * 86_400.0 + of_day) as u32, toe);
    Some(Ephemeris {
        satellite,
        iodc: n[26] as u16,
        iode: n[3] as u8,
        health: n[24] as u8,
        ura_index: 0,
        codes_on_l2: n[20] as u8,
        l2_p_data_off: n[22] != 0.0,
        fit_interval_extended: false,
        toc,
        af0_s: n[0],
        af1: n[1],
        af2_per_s: n[2],
        tgd_s: n[25],
        toe,
        sqrt_a: n[10],
        eccentricity: n[8],
        m0_rad: n[6],
        delta_n_rad_s: n[5],
        omega0_rad: n[13],
        omega_dot_rad_s: n[18],
        i0_rad: n[15],
        idot_rad_s: n[19],
        omega_rad: n[17],
        cuc_rad: n[7],
        cus_rad: n[9],
        crc_m: n[16],
        crs_m: n[4],
        cic_rad: n[12],
        cis_rad: n[14],
    })
}

/// Whether both agree as far as twelve printed digits tell: half a unit of the last one of 0.1.
fn agree(broadcast: &Ephemeris, quantised: &Ephemeris) -> bool {
    let members = |e: &Ephemeris| {
        [
            e.af0_s,
            e.af1,
            e.af2_per_s,
            e.tgd_s,
            e.sqrt_a,
            e.eccentricity,
            e.m0_rad,
            e.delta_n_rad_s,
            e.omega0_rad,
            e.omega_dot_rad_s,
            e.i0_rad,
            e.idot_rad_s,
            e.omega_rad,
            e.cuc_rad,
            e.cus_rad,
            e.crc_m,
            e.crs_m,
            e.cic_rad,
            e.cis_rad,
        ]
    };
    let mut pairs = members(broadcast).into_iter().zip(members(quantised));
    pairs.all(|(a, b)| (a - b).abs() <= 5.1e-12 * a.abs())
}

#[test]
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn broadcast_numbers_lie_on_the_steps_of_their_fields() {
    let shared = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let root = std::env::var_os("GNSS_TEST_DATA").map_or_else(shared, PathBuf::from);
    let Ok(text) = std::fs::read_to_string(root.join("if/simulated_static/brdc0010.22n")) else {
        eprintln!("SKIPPED: no test data");
        return;
    };
    let body = text.split_once("END OF HEADER").unwrap().1;
    let lines: Vec<&str> = body.lines().skip(1).collect();
    let (mut all, mut agreeing) = (0, 0);
    for broadcast in lines.chunks_exact(8).filter_map(ephemeris) {
        let quantised = quantise(&broadcast).unwrap();
        all += 1;
        agreeing += usize::from(agree(&broadcast, &quantised));
    }
    // Some stations in this merged file print ten digits (391 of 422 have twelve).
    assert!(
        all > 300 && agreeing * 100 > all * 90,
        "{agreeing} of {all}"
    );
}
