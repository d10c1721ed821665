//! How strong the satellites are.

use std::collections::BTreeMap;

use anyhow::{Result, ensure};
use gnss_nav::SatelliteId;
use serde::Deserialize;

use super::profile::Profile;

/// C/N0 of a scenario file: carrier power over noise density before the front end.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PowerSpec {
    /// The same for all satellites, dB-Hz.
    fixed_dbhz: Option<f64>,
    /// At the zenith, dB-Hz; lower down it falls with the sine of the elevation. Default 50.
    zenith_dbhz: Option<f64>,
    /// At the horizon, dB-Hz. Default 38.
    horizon_dbhz: Option<f64>,
    /// Of single satellites, dB-Hz, in place of the above.
    #[serde(default)]
    satellite: BTreeMap<String, f64>,
    /// Added to all: points (elapsed s, dB), straight between them.
    schedule: Option<Vec<(f64, f64)>>,
}

const ZENITH_DBHZ: f64 = 50.0;
const HORIZON_DBHZ: f64 = 38.0;

/// C/N0 of one satellite.
#[derive(Debug, Clone, PartialEq)]
pub struct Power {
    horizon_dbhz: f64,
    zenith_dbhz: f64,
    schedule: Option<Profile>,
}

impl PowerSpec {
    /// C/N0 of `satellite`.
    ///
    /// # Errors
    /// Names a value that is impossible.
    pub fn power(&self, satellite: SatelliteId) -> Result<Power> {
        let elevation_model = self.zenith_dbhz.is_some() || self.horizon_dbhz.is_some();
        ensure!(
            !(self.fixed_dbhz.is_some() && elevation_model),
            "fixed_dbhz: expected none beside zenith_dbhz and horizon_dbhz"
        );
        let own = self.satellite.get(&satellite.to_string()).copied();
        let (horizon_dbhz, zenith_dbhz) = match own.or(self.fixed_dbhz) {
            Some(level) => (level, level),
            None => (
                self.horizon_dbhz.unwrap_or(HORIZON_DBHZ),
                self.zenith_dbhz.unwrap_or(ZENITH_DBHZ),
            ),
        };
        for level in [horizon_dbhz, zenith_dbhz] {
            ensure!(
                (0.0..=100.0).contains(&level),
                "C/N0 of {satellite} is {level} dB-Hz: expected 0 to 100"
            );
        }
        let schedule = self.schedule.clone().map(Profile::new).transpose()?;
        Ok(Power {
            horizon_dbhz,
            zenith_dbhz,
            schedule,
        })
    }

    /// Checks that only satellites that are heard are named.
    ///
    /// # Errors
    /// Names one that is not.
    pub fn check(&self, heard: &[SatelliteId]) -> Result<()> {
        for name in self.satellite.keys() {
            ensure!(
                heard.iter().any(|s| s.to_string() == *name),
                "satellite: {name} is not heard in this scenario"
            );
        }
        Ok(())
    }
}

impl Power {
    /// Amplitude, square root of C/N0 in Hz.
    #[must_use]
    pub fn amplitude(&self, elapsed_s: f64, elevation_rad: f64) -> f64 {
        10f64.powf(self.dbhz(elapsed_s, elevation_rad) / 20.0)
    }

    /// C/N0, dB-Hz.
    #[must_use]
    pub fn dbhz(&self, elapsed_s: f64, elevation_rad: f64) -> f64 {
        let height = elevation_rad.sin().max(0.0);
        let added = self.schedule.as_ref().map_or(0.0, |s| s.at(elapsed_s));
        self.horizon_dbhz + (self.zenith_dbhz - self.horizon_dbhz) * height + added
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn power(text: &str) -> Result<Power> {
        let spec: PowerSpec = toml::from_str(text)?;
        spec.power(SatelliteId::gps(7))
    }

    #[test]
    fn levels_follow_elevation_schedule_and_name() {
        let plain = power("").unwrap();
        assert_eq!(plain.dbhz(0.0, std::f64::consts::FRAC_PI_2), 50.0);
        assert_eq!(plain.dbhz(0.0, -0.1), 38.0);
        let falling = power("fixed_dbhz = 45\nschedule = [[50, 0], [90, -10]]").unwrap();
        assert_eq!(
            (falling.dbhz(0.0, 1.0), falling.dbhz(70.0, 0.2)),
            (45.0, 40.0)
        );
        let own = power("satellite = { G07 = 33 }").unwrap();
        assert_eq!(own.dbhz(0.0, 1.0), 33.0);
        assert!((own.amplitude(0.0, 0.0).powi(2) - 10f64.powf(3.3)).abs() < 1e-9);
    }

    #[test]
    fn contradictions_are_refused() {
        assert!(power("fixed_dbhz = 45\nzenith_dbhz = 50").is_err());
        assert!(power("fixed_dbhz = 450").is_err());
        let spec: PowerSpec = toml::from_str("satellite = { G09 = 40 }").unwrap();
        assert!(spec.check(&[SatelliteId::gps(7)]).is_err());
    }
}
