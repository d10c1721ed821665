//! `receiver solve` on recorded observations, against known positions and the figures of RTKLIB.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use end_to_end_tests::{announce_skip, number, test_data};
use gnss_nav::Geodetic;
use nalgebra::Vector3;
use serde_json::Value;

/// Observations of a receiver at rest.
struct Site {
    folder: &'static str,
    obs: &'static str,
    nav: &'static str,
    position_ecef_m: [f64; 3],
    /// RTKLIB's horizontal and vertical rms, m, and its epochs: single point, mask 10 degrees.
    rtklib: ([f64; 2], usize),
}

const SITES: [Site; 4] = [
    Site {
        folder: "rinex/01_sept078m_1hz",
        obs: "SEPT078M.21O.gz",
        nav: "SEPT078M.21P",
        position_ecef_m: [-3_962_108.673, 3_381_309.574, 3_668_678.638],
        rtklib: ([0.94, 1.37], 900),
    },
    Site {
        folder: "rinex/02_esbc_2020177_30s",
        obs: "ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
        nav: "ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        position_ecef_m: [3_582_105.291, 532_589.731_3, 5_232_754.805_4],
        rtklib: ([1.36, 1.29], 2880),
    },
    Site {
        folder: "rinex/04_spirent_10min_1hz",
        obs: "Base-static_MO_Spirent.obs.gz",
        nav: "RINEX_GN_Spirent.23N",
        position_ecef_m: [
            4_157_177.065_801_87,
            671_230.476_590_636,
            4_774_767.031_055_44,
        ],
        rtklib: ([0.07, 0.22], 601),
    },
    OUTLIERS,
];

/// A receiver whose signals were simulated, with its own genuine outliers.
const OUTLIERS: Site = Site {
    folder: "rinex/11_f9p_spirent_15min_1hz",
    obs: "f9p.obs.gz",
    nav: "f9p.nav",
    position_ecef_m: [
        -481_819.313_497_24,
        5_507_219.953_754_01,
        3_170_373.735_383_64,
    ],
    rtklib: ([0.40, 0.67], 927),
};

struct Solved {
    folder: tempfile::TempDir,
}

impl Solved {
    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    fn summary(&self) -> Value {
        serde_json::from_str(&self.text("summary.json")).unwrap()
    }

    /// Events of one kind.
    fn events(&self, kind: &str) -> Vec<Value> {
        let text = self.text("events.jsonl");
        let all = text
            .lines()
            .map(|l| serde_json::from_str::<Value>(l).unwrap());
        all.filter(|event| event["kind"] == kind).collect()
    }
}

/// Folder of the data set; none, aloud, where it is absent.
fn folder(name: &str) -> Option<PathBuf> {
    let folder = test_data()?.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    announce_skip(name);
    None
}

fn solve(obs: &Path, nav: &Path, truth: &str, more: &[&str]) -> Result<Solved, String> {
    let folder = tempfile::tempdir().unwrap();
    let truth_path = folder.path().join("truth.csv");
    let header = "time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps";
    std::fs::write(&truth_path, format!("{header}\n{truth}\n")).unwrap();
    let mut arguments: Vec<OsString> = ["receiver", "solve", "--obs"].map(OsString::from).to_vec();
    arguments.extend([obs.into(), "--nav".into(), nav.into()]);
    arguments.extend(["--truth".into(), truth_path.into()]);
    arguments.extend(["--out".into(), folder.path().into()]);
    arguments.extend(more.iter().map(OsString::from));
    receiver::cli::execute(arguments, &mut Vec::new()).map_err(|error| error.to_string())?;
    Ok(Solved { folder })
}

fn solve_site(site: &Site, more: &[&str]) -> Option<Solved> {
    let folder = folder(site.folder)?;
    let [x, y, z] = site.position_ecef_m;
    let truth = format!("0,{x},{y},{z},0,0,0");
    Some(solve(&folder.join(site.obs), &folder.join(site.nav), &truth, more).unwrap())
}

#[test]
fn positions_are_as_good_as_those_of_rtklib() {
    for site in &SITES {
        let Some(solved) = solve_site(site, &[]) else {
            return;
        };
        let summary = solved.summary();
        let ([horizontal_m, vertical_m], epochs) = site.rtklib;
        let error = &summary["error"];
        // RTKLIB's figures are printed to a centimetre; another weighting may take a twentieth more.
        let within = |key: &str, theirs: f64| error[key].as_f64().unwrap() <= 1.05 * theirs;
        assert!(within("horizontal_rms_m", horizontal_m), "{error}");
        assert!(within("vertical_rms_m", vertical_m), "{error}");
        assert!(summary["fixes"].as_u64().unwrap() >= epochs as u64);
        let rows = solved.text("track.pos");
        let rows = rows.lines().filter(|line| !line.starts_with('%')).count();
        assert!(rows >= epochs, "{rows} rows in track.pos");
        for name in ["report.html", "track.kml", "track.nmea", "observations.rnx"] {
            assert!(solved.text(name).len() > 1000, "{name}");
        }
    }
}

#[test]
fn genuine_outliers_are_named_and_do_no_harm() {
    let Some(solved) = solve_site(&OUTLIERS, &[]) else {
        return;
    };
    // Seconds after the first epoch, satellite, error against the simulation in m.
    for (time_s, sat, error_m) in [
        (559.0, "G13", -6841.7),
        (626.0, "G08", 6509.8),
        (659.0, "G08", 4979.5),
        (701.0, "G01", 151.9),
    ] {
        let named = solved.events("excluded").into_iter().any(|event| {
            let apart_s = event["time_s"].as_f64().unwrap() - time_s;
            let off_m = event["residual_m"].as_f64().unwrap() - error_m;
            // The solution itself is off by up to 4 m.
            event["sat"] == sat && apart_s.abs() < 0.1 && off_m.abs() < 5.0
        });
        assert!(named, "{sat} at {time_s} s");
    }
    let summary = solved.summary();
    // 931 epochs; the last holds two GPS satellites.
    assert_eq!(summary["fixes"], 930);
    assert!(summary["error"]["position_3d_max_m"].as_f64().unwrap() < 5.0);
    let excluded = solved.events("excluded").len();
    // Two more of G13, 7.1 and 7.2 km off below 5 degrees.
    assert!(excluded <= 6, "{excluded} exclusions");
}

#[test]
fn without_the_test_an_outlier_spoils_a_fix() {
    let more = ["--raim", "none", "--cn0-mask", "0"];
    let Some(solved) = solve_site(&OUTLIERS, &more) else {
        return;
    };
    assert!(solved.events("excluded").is_empty());
    let worst = &solved.summary()["error"]["position_3d_max_m"];
    assert!(worst.as_f64().unwrap() > 100.0, "{worst}");
}

#[test]
fn an_injected_step_is_excluded_where_it_began() {
    let Some(solved) = solve_site(&SITES[0], &["--inject", "G09:60@500"]) else {
        return;
    };
    let excluded = solved.events("excluded");
    assert_eq!(excluded.len(), 1, "{excluded:?}");
    assert_eq!(excluded[0]["sat"], "G09");
    assert_eq!(excluded[0]["time_s"], 500.0);
    assert!(solved.events("readmitted").is_empty());
    let error = &solved.summary()["error"];
    // Without one of ten satellites the receiver is still within a few metres.
    assert!(
        error["position_3d_max_m"].as_f64().unwrap() < 5.0,
        "{error}"
    );
}

#[test]
fn an_error_of_thousands_of_kilometres_costs_no_epoch() {
    for (raim, inject) in [("ls", "G09:6e6@300"), ("pf", "G03:-6e6@300")] {
        let more = ["--raim", raim, "--inject", inject];
        let Some(solved) = solve_site(&SITES[0], &more) else {
            return;
        };
        let excluded = solved.events("excluded");
        assert_eq!(excluded.len(), 1, "{excluded:?}");
        assert_eq!(excluded[0]["sat"], inject[..3]);
        assert_eq!(excluded[0]["time_s"], 300.0);
        // A pseudorange that is 20 ms too long finds its satellite 20 ms earlier: up to 16 m of range.
        let off_m = excluded[0]["residual_m"].as_f64().unwrap().abs() - 6e6;
        assert!(off_m.abs() < 20.0, "{off_m} m");
        let summary = solved.summary();
        assert_eq!(summary["fixes"], 900);
        let worst_m = summary["error"]["position_3d_max_m"].as_f64().unwrap();
        assert!(worst_m < 5.0, "{worst_m} m");
    }
}

#[test]
fn protection_levels_hold_and_false_alarms_are_rare() {
    for site in &SITES {
        let Some(solved) = solve_site(site, &[]) else {
            return;
        };
        let truth = Vector3::from(site.position_ecef_m);
        let enu = Geodetic::from_ecef(&truth).enu_from_ecef();
        let (mut rows, mut stated) = (0, 0);
        for row in end_to_end_tests::table(&solved.text("pvt.csv")) {
            rows += 1;
            if row["hpl_m"].is_empty() {
                continue;
            }
            stated += 1;
            let position = ["x_m", "y_m", "z_m"].map(|name| number(&row, name));
            let error = enu * (Vector3::from(position) - truth);
            assert!(error.xy().norm() < number(&row, "hpl_m"), "{row:?}");
            assert!(error.z.abs() < number(&row, "vpl_m"), "{row:?}");
        }
        assert!(stated * 100 >= rows * 98, "{stated} of {rows}");
        // The stated rate is 1e-5 an epoch; the 5312 epochs here have no fault but the outliers.
        let alarms = solved.events("excluded");
        let genuine = ["G13", "G08", "G01"];
        let is_false = |e: &&Value| !genuine.contains(&e["sat"].as_str().unwrap());
        assert_eq!(alarms.iter().filter(is_false).count(), 0, "{alarms:?}");
    }
}

#[test]
fn noise_free_positions_are_exact() {
    let Some(folder) = folder("rinex/03_spirent_4h_5min") else {
        return;
    };
    let [x, y, z] = OUTLIERS.position_ecef_m;
    let (obs, nav) = (
        folder.join("none_MO.obs.gz"),
        folder.join("Spirent_RINEX_GN.23N"),
    );
    let none = ["--ionosphere", "none", "--troposphere", "none"];
    let solved = solve(&obs, &nav, &format!("0,{x},{y},{z},0,0,0"), &none).unwrap();
    let summary = solved.summary();
    // RTKLIB solves 40 of the 49 epochs: six announce more satellites than they hold.
    assert_eq!(summary["fixes"], 49);
    assert_eq!(solved.events("epoch_short").len(), 6);
    let worst_m = summary["error"]["position_3d_max_m"].as_f64().unwrap();
    assert!(worst_m < 0.01, "{worst_m} m");
}

#[test]
fn the_kinematic_filter_goes_through_all_of_the_city() {
    let Some(solved) = solve_urban(&["--elevation-mask", "5", "--filter", "ekf"]) else {
        return;
    };
    let (epochs, horizontal_rms_m) = urban_errors(&solved);
    assert_eq!(epochs, URBAN_EPOCHS);
    assert!(horizontal_rms_m < 30.0, "{horizontal_rms_m} m");
    let folder = folder("rinex/05_urbannav_tst_20190428").unwrap();
    let truth = urban_points(&folder);
    let (mut beyond, mut stated, mut unprotected) = (0, 0, 0);
    for row in end_to_end_tests::table(&solved.text("pvt.csv")) {
        let time_s = number(&row, "time_s");
        let near = truth.iter().find(|(t, _)| (t - time_s).abs() < 0.1);
        let Some((_, place)) = near else { continue };
        let enu = Geodetic::from_ecef(place).enu_from_ecef();
        let position = Vector3::from(["x_m", "y_m", "z_m"].map(|name| number(&row, name)));
        let error = enu * (position - place);
        let [e, n, u] = ["sigma_e_m", "sigma_n_m", "sigma_u_m"].map(|name| number(&row, name));
        let normalised = (error.x / e).powi(2) + (error.y / n).powi(2) + (error.z / u).powi(2);
        // Exceeded once in a hundred times by a chi-square variable of three degrees of freedom.
        beyond += usize::from(normalised > 11.34);
        if !row["hpl_m"].is_empty() {
            stated += 1;
            let is_beyond =
                error.xy().norm() > number(&row, "hpl_m") || error.z.abs() > number(&row, "vpl_m");
            unprotected += usize::from(is_beyond);
        }
    }
    // Errors last for minutes here, so that the count scatters: five times the expectation.
    assert!(beyond * 20 <= URBAN_EPOCHS, "{beyond}");
    assert!(
        stated > 100 && unprotected == 0,
        "{unprotected} of {stated}"
    );
}

#[test]
fn what_has_a_memory_names_the_satellite_of_a_small_step() {
    for (raim, inject, sat) in [
        ("pf", "G09:15@300", "G09"),
        ("pso-pf", "G03:15@300", "G03"),
        ("glr", "G28:-15@300", "G28"),
    ] {
        let more = ["--raim", raim, "--inject", inject];
        let Some(solved) = solve_site(&SITES[0], &more) else {
            return;
        };
        let excluded = solved.events("excluded");
        assert_eq!(excluded.len(), 1, "{excluded:?}");
        assert_eq!(excluded[0]["sat"], sat);
        assert_eq!(excluded[0]["monitor"], raim);
        let delay_s = excluded[0]["time_s"].as_f64().unwrap() - 300.0;
        assert!((0.0..15.0).contains(&delay_s), "{delay_s} s");
    }
}

#[test]
fn what_has_a_memory_is_silent_where_nothing_is_wrong() {
    // One receiver in the open, one on simulated signals; a day of the first one's kind is in
    // `cargo xtask reproduce wang2016`.
    for site in [&SITES[0], &SITES[2]] {
        for raim in ["glr", "pf", "pso-pf"] {
            let Some(solved) = solve_site(site, &["--raim", raim]) else {
                return;
            };
            let excluded = solved.events("excluded");
            assert_eq!(excluded.len(), 0, "{raim}: {excluded:?}");
        }
    }
}

#[test]
fn the_kinematic_filter_gives_all_epochs_of_a_record_that_ends_with_two_satellites() {
    let Some(solved) = solve_site(&OUTLIERS, &["--filter", "ekf"]) else {
        return;
    };
    let rows = end_to_end_tests::table(&solved.text("pvt.csv"));
    assert_eq!(rows.len(), 931);
    // The last epoch holds two pseudoranges of GPS, which make no position by themselves.
    assert_eq!(rows[930]["status"], "predicted");
    let error = &solved.summary()["error"];
    assert!(
        error["position_3d_max_m"].as_f64().unwrap() < 5.0,
        "{error}"
    );
}

/// Positions of a car among tall buildings, ECEF, by seconds after the first epoch.
fn urban_points(folder: &Path) -> Vec<(f64, Vector3<f64>)> {
    /// Time of week of the first epoch, s: 12:44:33.997 on a Sunday.
    const FIRST_S: f64 = 45_873.997;
    let text = std::fs::read_to_string(folder.join("groundTruth_TST.csv")).unwrap();
    text.lines()
        .filter(|line| !line.trim().is_empty())
        .map(|line| {
            let v: Vec<f64> = line.split(',').map(|n| n.trim().parse().unwrap()).collect();
            let place = Geodetic::from_degrees(v[2], v[3], v[4]);
            (v[1] - FIRST_S, place.to_ecef())
        })
        .collect()
}

/// The same as a truth file, with velocities by differences.
fn urban_truth(folder: &Path) -> String {
    let points = urban_points(folder);
    let mut truth = String::new();
    for (i, (time_s, p)) in points.iter().enumerate() {
        let (before, after) = (
            &points[i.saturating_sub(1)],
            &points[(i + 1).min(points.len() - 1)],
        );
        let v = (after.1 - before.1) / (after.0 - before.0);
        let _ = writeln!(
            truth,
            "{time_s:.3},{},{},{},{},{},{}",
            p.x, p.y, p.z, v.x, v.y, v.z
        );
    }
    truth
}

/// Epochs with a truth.
const URBAN_EPOCHS: usize = 485;

fn solve_urban(more: &[&str]) -> Option<Solved> {
    let folder = folder("rinex/05_urbannav_tst_20190428")?;
    let truth = urban_truth(&folder);
    let obs = folder.join("COM3_190428_124409.obs.gz");
    let nav = folder.join("hksc1180.19n.gz");
    Some(solve(&obs, &nav, &truth, more).unwrap())
}

/// Epochs with a reliable position, and the horizontal rms error of these, m.
fn urban_errors(solved: &Solved) -> (usize, f64) {
    let error = &solved.summary()["error"];
    let rows = end_to_end_tests::table(&solved.text("pvt.csv"));
    // The truth runs from 46701 to 47185 s of the week.
    let with_truth = rows.iter().filter(|row| {
        let tow_s = number(row, "tow_s");
        row["status"] != "unreliable" && (46_700.9..47_185.1).contains(&tow_s)
    });
    let solved = with_truth.count();
    (solved, error["horizontal_rms_m"].as_f64().unwrap())
}

#[test]
fn among_tall_buildings_single_points_beat_rtklib() {
    let Some(solved) = solve_urban(&["--elevation-mask", "5"]) else {
        return;
    };
    let (epochs, horizontal_rms_m) = urban_errors(&solved);
    // RTKLIB with its fault exclusion: 290 epochs, 30.0 m.
    assert!((290..=URBAN_EPOCHS).contains(&epochs), "{epochs}");
    assert!(horizontal_rms_m < 30.0, "{horizontal_rms_m} m");
}

#[test]
fn what_cannot_be_is_one_line() {
    let site = &SITES[0];
    let Some(folder) = folder(site.folder) else {
        return;
    };
    let (obs, nav) = (folder.join(site.obs), folder.join(site.nav));
    let message = |obs: &Path, nav: &Path, more: &[&str]| {
        solve(obs, nav, "0,0,0,0,0,0,0", more).err().unwrap()
    };
    for (text, expected) in [
        (
            message(&obs, &nav, &["--inject", "G31:15@500"]),
            "--inject is 'G31:15@500': expected a satellite that is observed",
        ),
        (
            message(&obs, &nav, &["--inject", "G31"]),
            "--inject is 'G31': expected SAT:METRES@SECONDS",
        ),
        (message(&nav, &nav, &[]), "expected observation data"),
        (message(&obs, &obs, &[]), "SEPT078M.21O.gz: "),
        (
            message(&obs, &nav, &["--raim", "x"]),
            "--raim is 'x': expected one of",
        ),
    ] {
        assert!(text.contains(expected), "{text}");
        assert!(!text.contains('\n'), "{text}");
    }
}
