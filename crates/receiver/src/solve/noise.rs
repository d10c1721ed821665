//! How well another receiver measures: variances of its pseudoranges and Dopplers.

use gnss_nav::constants::L1_WAVELENGTH_M;
use gnss_nav::measurement::ErrorModel;
use gnss_nav::{GpsTime, RawMeasurement};

use super::fault::InjectedFault;
use crate::rinex_obs::ObservedSatellite;

/// What the variance of a pseudorange is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weights {
    /// The elevation alone: receivers in the open.
    Elevation,
    /// C/N0 alone.
    Cn0,
    /// Both: what blocks or bends a signal lowers its C/N0, wherever it stands.
    #[default]
    Both,
}

/// Deviation of a pseudorange of a satellite at the zenith, m: what a receiver of unknown make
/// does to it, reflections included.
const ZENITH_M: f64 = 0.3;

/// The user range accuracy of a satellite is known by the upper bound of its class (IS-GPS-200
/// 20.3.3.3.1.3), which is 1.2 times the nominal value.
const URA_FRACTION: f64 = 1.2;

/// Deviation that goes with [`REFERENCE_DBHZ`], m; it halves for every 6 dB more.
const CODE_M: f64 = 0.45;

/// The same of a range rate, m/s.
const RATE_MPS: f64 = 0.05;

/// What no C/N0 makes better: of a pseudorange, m, and a range rate, m/s.
const LEAST_CODE_M: f64 = 0.1;
const LEAST_RATE_MPS: f64 = 0.02;

/// C/N0 of a satellite in the open, dB-Hz; taken where the file states none.
const REFERENCE_DBHZ: f64 = 42.0;

impl Weights {
    /// Errors beyond those of tracking.
    #[must_use]
    pub fn errors(self) -> ErrorModel {
        let multipath_zenith_m = match self {
            Self::Elevation | Self::Both => ZENITH_M,
            Self::Cn0 => 0.0,
        };
        ErrorModel {
            ura_fraction: URA_FRACTION,
            multipath_zenith_m,
            ..ErrorModel::default()
        }
    }

    /// The measurement of `observed` at the epoch `time`, `time_s` after the first.
    #[must_use]
    pub fn measurement(
        self,
        observed: &ObservedSatellite,
        time: GpsTime,
        time_s: f64,
        faults: &[InjectedFault],
    ) -> RawMeasurement {
        let cn0_dbhz = observed.cn0_dbhz.unwrap_or(REFERENCE_DBHZ);
        let weakness = match self {
            Self::Elevation => 1.0,
            Self::Cn0 | Self::Both => 10f64.powf((REFERENCE_DBHZ - cn0_dbhz) / 20.0),
        };
        let error_m: f64 = faults
            .iter()
            .filter_map(|fault| fault.error_m(observed.satellite, time_s))
            .sum();
        let pseudorange_m = observed.pseudorange_m + error_m;
        let variance = |least: f64, nominal: f64| least.powi(2) + (nominal * weakness).powi(2);
        RawMeasurement {
            satellite: observed.satellite,
            transmit_time: time - pseudorange_m / gnss_nav::constants::SPEED_OF_LIGHT_MPS,
            pseudorange_m,
            range_rate_mps: -observed.doppler_hz.unwrap_or(0.0) * L1_WAVELENGTH_M,
            pseudorange_variance_m2: variance(LEAST_CODE_M, CODE_M),
            range_rate_variance_m2_s2: match observed.doppler_hz {
                Some(_) => variance(LEAST_RATE_MPS, RATE_MPS),
                None => f64::INFINITY,
            },
            cn0_dbhz,
        }
    }
}
