//! The satellites: where their orbits come from and which of them are heard.

mod nominal;
mod yuma;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use gnss_nav::{Ephemeris, GpsTime, Klobuchar, SatelliteId};
use receiver::rinex_nav;
use serde::Deserialize;

pub use nominal::nominal;

/// Reference times of made-up ephemerides: every two hours, as operators do.
const REFERENCE_STEP_S: f64 = 7200.0;

/// An instant of GPS time in a file.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeSpec {
    /// Week since 1980-01-06, unrolled.
    pub week: i32,
    /// Second of the week.
    pub tow_s: f64,
}

impl TimeSpec {
    /// The instant.
    #[must_use]
    pub fn time(&self) -> GpsTime {
        GpsTime::new(self.week, self.tow_s)
    }
}

/// Constellation of a scenario file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstellationSpec {
    /// Where the orbits come from.
    #[serde(default)]
    source: Source,
    /// The file of orbits, relative to the scenario file.
    file: Option<PathBuf>,
    /// PRNs of the satellites that are heard, exactly these; without it all above the mask.
    satellites: Option<Vec<u8>>,
    /// Elevation above which satellites are heard where they are not named, degrees.
    #[serde(default = "default_mask_deg")]
    elevation_mask_deg: f64,
}

const fn default_mask_deg() -> f64 {
    5.0
}

impl Default for ConstellationSpec {
    fn default() -> Self {
        Self {
            source: Source::Nominal,
            file: None,
            satellites: None,
            elevation_mask_deg: default_mask_deg(),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Source {
    /// The 24 slots of the GPS SPS Performance Standard.
    #[default]
    Nominal,
    /// A RINEX navigation file.
    Rinex,
    /// A YUMA almanac.
    Yuma,
}

/// Which satellites are heard.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// Exactly these, healthy or not.
    Named(Vec<SatelliteId>),
    /// All healthy ones that stand above this elevation, rad.
    Above(f64),
}

/// Orbits of a scenario.
#[derive(Debug, Clone)]
pub struct Constellation {
    /// One for each satellite, valid at the start, by PRN; each is what LNAV can hold.
    pub ephemerides: Vec<Ephemeris>,
    /// Ionosphere parameters that came with the orbits.
    pub ionosphere: Option<Klobuchar>,
    /// Which are heard.
    pub choice: Choice,
}

impl ConstellationSpec {
    /// The orbits at `start`; files are looked for in `folder`.
    ///
    /// # Errors
    /// Names a file that cannot be read, or a value that is impossible.
    pub fn constellation(&self, start: GpsTime, folder: &Path) -> Result<Constellation> {
        let (ephemerides, ionosphere) = match (self.source, &self.file) {
            (Source::Nominal, None) => (nominal(start)?, None),
            (Source::Nominal, Some(_)) => bail!("file: expected none with source \"nominal\""),
            (_, None) => bail!("file: expected one with source \"rinex\" or \"yuma\""),
            (Source::Rinex, Some(file)) => from_rinex(&folder.join(file), start)?,
            (Source::Yuma, Some(file)) => (from_yuma(&folder.join(file), start)?, None),
        };
        let mask_deg = self.elevation_mask_deg;
        ensure!(
            (-10.0..=90.0).contains(&mask_deg),
            "elevation_mask_deg is {mask_deg}: expected -10 to 90"
        );
        let choice = match &self.satellites {
            None => Choice::Above(mask_deg.to_radians()),
            Some(prns) => Choice::Named(named(prns, &ephemerides)?),
        };
        Ok(Constellation {
            ephemerides,
            ionosphere,
            choice,
        })
    }
}

fn named(prns: &[u8], ephemerides: &[Ephemeris]) -> Result<Vec<SatelliteId>> {
    ensure!(!prns.is_empty(), "satellites: expected at least one PRN");
    let mut satellites = Vec::new();
    for &prn in prns {
        let satellite = SatelliteId::gps(prn);
        ensure!(
            ephemerides.iter().any(|e| e.satellite == satellite),
            "satellites: {satellite} has no orbit at the start"
        );
        ensure!(
            !satellites.contains(&satellite),
            "satellites: {satellite} is named twice"
        );
        satellites.push(satellite);
    }
    Ok(satellites)
}

fn from_rinex(path: &Path, start: GpsTime) -> Result<(Vec<Ephemeris>, Option<Klobuchar>)> {
    let file = rinex_nav::read(path)?;
    let mut chosen = Vec::new();
    for satellite in file.satellites() {
        let own = file.ephemerides.iter().filter(|e| e.satellite == satellite);
        let valid = own.filter(|e| e.is_valid_at(start));
        let nearest = valid.min_by(|a, b| {
            let age_s = |e: &Ephemeris| (e.toe - start).abs();
            age_s(a).total_cmp(&age_s(b))
        });
        if let Some(ephemeris) = nearest {
            let sent = gnss_nav::lnav::quantise(ephemeris);
            chosen.push(sent.with_context(|| format!("{}: {satellite}", path.display()))?);
        }
    }
    ensure!(
        !chosen.is_empty(),
        "{}: no satellite has an ephemeris that is valid at the start, week {} {} s",
        path.display(),
        start.week(),
        start.tow_s()
    );
    Ok((chosen, file.ionosphere))
}

fn from_yuma(path: &Path, start: GpsTime) -> Result<Vec<Ephemeris>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
    yuma::ephemerides(&text, start).with_context(|| format!("{}", path.display()))
}

/// The reference time nearest to `time`.
fn nearest_reference(time: GpsTime) -> GpsTime {
    let steps = (time.tow_s() / REFERENCE_STEP_S).round();
    GpsTime::new(time.week(), steps * REFERENCE_STEP_S)
}

/// Issue of data of a made-up ephemeris.
fn issue_of(toe: GpsTime) -> u8 {
    (toe.tow_s() / REFERENCE_STEP_S) as u8
}

/// An ephemeris without any orbit or clock.
fn blank(toe: GpsTime) -> Ephemeris {
    Ephemeris {
        satellite: SatelliteId::gps(1),
        iodc: 0,
        iode: 0,
        health: 0,
        ura_index: 0,
        codes_on_l2: 1,
        l2_p_data_off: false,
        fit_interval_extended: false,
        toc: toe,
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
