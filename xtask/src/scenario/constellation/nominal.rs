//! The nominal constellation embedded in this tool, as broadcast ephemerides.

use std::f64::consts::{PI, TAU};

use anyhow::{Context, Result};
use gnss_nav::constants::{EARTH_RATE_RAD_S, MU_M3_PER_S2};
use gnss_nav::{Ephemeris, GpsTime, SatelliteId, lnav};
use serde::Deserialize;

use super::{TimeSpec, issue_of, nearest_reference};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Nominal {
    semi_major_axis_m: f64,
    inclination_deg: f64,
    epoch: TimeSpec,
    greenwich_deg: f64,
    satellite: Vec<Slot>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Slot {
    prn: u8,
    #[serde(rename = "slot")]
    _name: String,
    ascending_node_deg: f64,
    argument_of_latitude_deg: f64,
    clock_bias_s: f64,
}

/// Ephemerides of all satellites of the nominal constellation, valid at `time`, by PRN.
///
/// They are what LNAV can hold: a satellite that flies exactly so broadcasts its own orbit.
///
/// # Errors
/// None in practice: the embedded file is tested.
pub fn nominal(time: GpsTime) -> Result<Vec<Ephemeris>> {
    let text = include_str!("../../../../assets/constellation.toml");
    let nominal: Nominal = toml::from_str(text).context("constellation.toml")?;
    let mut ephemerides = nominal
        .satellite
        .iter()
        .map(|slot| Ok(lnav::quantise(&nominal.ephemeris(slot, time))?))
        .collect::<Result<Vec<_>>>()?;
    ephemerides.sort_by_key(|e| e.satellite);
    Ok(ephemerides)
}

impl Nominal {
    fn ephemeris(&self, slot: &Slot, time: GpsTime) -> Ephemeris {
        let toe = nearest_reference(time);
        let epoch = self.epoch.time();
        let mean_motion_rad_s = (MU_M3_PER_S2 / self.semi_major_axis_m.powi(3)).sqrt();
        let latitude_rad =
            slot.argument_of_latitude_deg.to_radians() + mean_motion_rad_s * (toe - epoch);
        // Longitude of the node at the start of the week of `toe`.
        let week_s = GpsTime::new(toe.week(), 0.0) - epoch;
        let node_rad =
            (slot.ascending_node_deg - self.greenwich_deg).to_radians() - EARTH_RATE_RAD_S * week_s;
        let issue = issue_of(toe);
        Ephemeris {
            satellite: SatelliteId::gps(slot.prn),
            iodc: issue.into(),
            iode: issue,
            toc: toe,
            af0_s: slot.clock_bias_s,
            toe,
            sqrt_a: self.semi_major_axis_m.sqrt(),
            m0_rad: wrapped(latitude_rad),
            omega0_rad: wrapped(node_rad),
            i0_rad: self.inclination_deg.to_radians(),
            ..super::blank(toe)
        }
    }
}

/// An angle as LNAV sends it, in [-pi, pi).
pub(super) fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use gnss_nav::{Geodetic, LineOfSight};

    use super::*;

    #[test]
    fn every_week_has_24_satellites_on_valid_orbits() {
        for tow_s in [0.0, 100_000.0, 604_799.0] {
            let time = GpsTime::new(2350, tow_s);
            let ephemerides = nominal(time).unwrap();
            assert!(ephemerides.is_sorted_by(|a, b| a.satellite < b.satellite));
            assert_eq!(ephemerides.len(), 24);
            assert!(ephemerides.iter().all(|e| e.is_valid_at(time)));
        }
    }

    #[test]
    fn anywhere_at_least_five_satellites_stand_above_five_degrees() {
        // What the nominal constellation of 24 promises.
        for (lat, lon, tow_s) in [(48.0, 11.0, 0.0), (0.0, -100.0, 40e3), (-80.0, 60.0, 500e3)] {
            let time = GpsTime::new(2350, tow_s);
            let place = Geodetic::from_degrees(lat, lon, 0.0);
            let ephemerides = nominal(time).unwrap();
            let up = ephemerides.iter().filter(|e| {
                let state = e.state_at(time).unwrap();
                let path = LineOfSight::new(&state, &place.to_ecef());
                place.look(&path.unit_ecef).elevation_rad > 5f64.to_radians()
            });
            let count = up.count();
            assert!((5..=13).contains(&count), "{count} at {lat}, {lon}");
        }
    }

    /// Elevations (degrees) at a place, by PRN.
    fn elevations(time: GpsTime, place: &Geodetic) -> Vec<(u8, f64)> {
        let ephemerides = nominal(time).unwrap();
        let elevation = |e: &Ephemeris| {
            let path = LineOfSight::new(&e.state_at(time).unwrap(), &place.to_ecef());
            let look = place.look(&path.unit_ecef);
            (e.satellite.prn, look.elevation_rad.to_degrees())
        };
        ephemerides.iter().map(elevation).collect()
    }

    #[test]
    fn the_papers_find_their_satellites_in_view() {
        let flight = Geodetic::from_degrees(33.1341, 118.974, 57_447.0);
        let sky = elevations(GpsTime::new(2420, 280_560.0), &flight);
        for prn in [7, 8, 24, 17, 19, 11, 20] {
            let found = sky.iter().find(|(p, _)| *p == prn).unwrap();
            assert!(found.1 > 5.0, "{found:?}");
            assert!(prn != 17 || (60.0..75.0).contains(&found.1), "{found:?}");
        }
        let shenyang = Geodetic::from_degrees(41.93, 123.41, 60.0);
        let sky = elevations(GpsTime::new(2260, 593_130.0), &shenyang);
        for prn in [1, 12, 14, 15, 17, 22, 24, 26, 28] {
            let found = sky.iter().find(|(p, _)| *p == prn).unwrap();
            assert!(found.1 > 5.0, "{found:?}");
        }
    }
}
