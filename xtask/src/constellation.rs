//! The nominal constellation embedded in this tool, as broadcast ephemerides.

use std::f64::consts::{PI, TAU};

use anyhow::{Context, Result};
use gnss_nav::constants::MU_M3_PER_S2;
use gnss_nav::{Ephemeris, GpsTime, SatelliteId, lnav};
use serde::Deserialize;

/// Reference times are sent in steps of 16 s; two hours are what operators use.
const REFERENCE_STEP_S: f64 = 7200.0;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constellation {
    semi_major_axis_m: f64,
    inclination_deg: f64,
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
    let text = include_str!("../../assets/constellation.toml");
    let constellation: Constellation = toml::from_str(text).context("constellation.toml")?;
    let mut ephemerides = constellation
        .satellite
        .iter()
        .map(|slot| Ok(lnav::quantise(&constellation.ephemeris(slot, time))?))
        .collect::<Result<Vec<_>>>()?;
    ephemerides.sort_by_key(|e| e.satellite);
    Ok(ephemerides)
}

impl Constellation {
    fn ephemeris(&self, slot: &Slot, time: GpsTime) -> Ephemeris {
        let toe_s = (time.tow_s() / REFERENCE_STEP_S).round() * REFERENCE_STEP_S;
        let toe = GpsTime::new(time.week(), toe_s);
        let mean_motion_rad_s = (MU_M3_PER_S2 / self.semi_major_axis_m.powi(3)).sqrt();
        let latitude_rad =
            slot.argument_of_latitude_deg.to_radians() + mean_motion_rad_s * toe.tow_s();
        let issue = (toe.tow_s() / REFERENCE_STEP_S) as u8;
        Ephemeris {
            satellite: SatelliteId::gps(slot.prn),
            iodc: issue.into(),
            iode: issue,
            health: 0,
            ura_index: 0,
            codes_on_l2: 1,
            l2_p_data_off: false,
            fit_interval_extended: false,
            toc: toe,
            af0_s: slot.clock_bias_s,
            af1: 0.0,
            af2_per_s: 0.0,
            tgd_s: 0.0,
            toe,
            sqrt_a: self.semi_major_axis_m.sqrt(),
            eccentricity: 0.0,
            m0_rad: wrapped(latitude_rad),
            delta_n_rad_s: 0.0,
            omega0_rad: wrapped(slot.ascending_node_deg.to_radians()),
            omega_dot_rad_s: 0.0,
            i0_rad: self.inclination_deg.to_radians(),
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
}

/// An angle as LNAV sends it, in [-pi, pi).
fn wrapped(angle_rad: f64) -> f64 {
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
            let prns: Vec<u8> = ephemerides.iter().map(|e| e.satellite.prn).collect();
            assert_eq!(prns, (1..=24).collect::<Vec<_>>());
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
}
