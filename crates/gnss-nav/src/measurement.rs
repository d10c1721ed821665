//! Pseudoranges and range rates, and the model that predicts them.

use nalgebra::{Matrix3, Vector3};

use crate::atmosphere::{Klobuchar, saastamoinen_delay_m};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::delay_rate::{self, DelayRate};
use crate::geodesy::{Geodetic, Look};
use crate::line_of_sight::LineOfSight;
use crate::{EphemerisStore, GpsTime, NavError, SatelliteId, SatelliteState};

/// What a channel measured at one epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawMeasurement {
    /// Of which satellite.
    pub satellite: SatelliteId,
    /// Reading of the satellite's clock when it sent what arrives at the epoch.
    pub transmit_time: GpsTime,
    /// c times (epoch by the receiver's clock - `transmit_time`), m.
    pub pseudorange_m: f64,
    /// Rate of the pseudorange, m/s: minus Doppler times the wavelength of L1.
    pub range_rate_mps: f64,
    /// Variance of the pseudorange by tracking noise, m^2.
    pub pseudorange_variance_m2: f64,
    /// Variance of the range rate, (m/s)^2; infinite where no Doppler was measured.
    pub range_rate_variance_m2_s2: f64,
    /// Carrier-to-noise density, dB-Hz.
    pub cn0_dbhz: f64,
}

impl RawMeasurement {
    /// A measurement whose pseudorange is the epoch minus the transmit time.
    #[must_use]
    pub fn pseudorange_m(receive_time: GpsTime, transmit_time: GpsTime) -> f64 {
        SPEED_OF_LIGHT_MPS * (receive_time - transmit_time)
    }
}

/// A measurement with the state of its satellite at transmission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Of which satellite.
    pub satellite: SatelliteId,
    /// The epoch, by the receiver's clock.
    pub receive_time: GpsTime,
    /// Pseudorange, m.
    pub pseudorange_m: f64,
    /// Rate of the pseudorange, m/s.
    pub range_rate_mps: f64,
    /// Variance of the pseudorange by tracking noise, m^2.
    pub pseudorange_variance_m2: f64,
    /// Variance of the range rate, (m/s)^2; infinite where no Doppler was measured.
    pub range_rate_variance_m2_s2: f64,
    /// Carrier-to-noise density, dB-Hz.
    pub cn0_dbhz: f64,
    /// The satellite at transmission, in the frame of transmission.
    pub state: SatelliteState,
    /// Nominal accuracy of its ephemeris, m.
    pub user_range_accuracy_m: f64,
}

/// Measurements of one epoch, and what could not be used.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Formed {
    /// In the order given.
    pub measurements: Vec<Measurement>,
    /// Without a valid ephemeris, or with values that are not finite.
    pub rejected: Vec<(SatelliteId, Rejection)>,
}

/// Why a measurement cannot be used.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Rejection {
    /// No ephemeris of this satellite is valid at the epoch.
    NoEphemeris,
    /// The ephemeris gives no state.
    Ephemeris(NavError),
    /// Pseudorange or variance is not finite, or the variance is not positive.
    Value,
}

/// Joins `raw`, measured when the receiver's clock read `receive_time`, with satellite states.
#[must_use]
pub fn form(receive_time: GpsTime, raw: &[RawMeasurement], store: &EphemerisStore) -> Formed {
    let mut formed = Formed::default();
    for one in raw {
        match join(receive_time, one, store) {
            Ok(measurement) => formed.measurements.push(measurement),
            Err(reason) => formed.rejected.push((one.satellite, reason)),
        }
    }
    formed
}

fn join(
    receive_time: GpsTime,
    raw: &RawMeasurement,
    store: &EphemerisStore,
) -> Result<Measurement, Rejection> {
    let variance = raw.pseudorange_variance_m2;
    if !(raw.pseudorange_m.is_finite() && variance.is_finite() && variance > 0.0) {
        return Err(Rejection::Value);
    }
    let ephemeris = store
        .select(raw.satellite, raw.transmit_time)
        .ok_or(Rejection::NoEphemeris)?;
    let (_, state) = ephemeris
        .state_at_transmission(raw.transmit_time)
        .map_err(Rejection::Ephemeris)?;
    Ok(Measurement {
        satellite: raw.satellite,
        receive_time,
        pseudorange_m: raw.pseudorange_m,
        range_rate_mps: raw.range_rate_mps,
        pseudorange_variance_m2: variance,
        range_rate_variance_m2_s2: raw.range_rate_variance_m2_s2,
        cn0_dbhz: raw.cn0_dbhz,
        state,
        user_range_accuracy_m: ephemeris.user_range_accuracy_m(),
    })
}

/// Variance that tracking noise does not cover.
///
/// sigma^2 = (ura_fraction URA)^2 + (ionosphere_fraction I)^2 + (troposphere_fraction T)^2 +
/// (multipath_zenith_m / sin elevation)^2 plus, at low elevation, what the shape of the troposphere model is wrong by, where
/// I and T are the modelled delays: a delay that is switched off adds nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorModel {
    /// Error of broadcast orbit and clock over the nominal user range accuracy.
    pub ura_fraction: f64,
    /// Part of the modelled ionospheric delay left over.
    pub ionosphere_fraction: f64,
    /// Part of the modelled tropospheric delay left over.
    pub troposphere_fraction: f64,
    /// Reflections and antenna of a satellite at the zenith, m; those of low ones grow with the
    /// inverse sine of the elevation.
    pub multipath_zenith_m: f64,
}

/// Elevation below which what goes with its inverse sine grows no more, rad: 3 degrees.
pub(crate) const LOWEST_ELEVATION_RAD: f64 = 0.05;

impl ErrorModel {
    /// Tracking noise alone: for signals simulated with the modelled delays.
    pub const TRACKING_NOISE_ONLY: Self = Self {
        ura_fraction: 0.0,
        ionosphere_fraction: 0.0,
        troposphere_fraction: 0.0,
        multipath_zenith_m: 0.0,
    };

    fn multipath_variance_m2(&self, elevation_rad: f64) -> f64 {
        let sine = elevation_rad.max(LOWEST_ELEVATION_RAD).sin();
        (self.multipath_zenith_m / sine).powi(2)
    }

    /// Variance of a modelled tropospheric delay.
    ///
    /// The plane atmosphere of the model makes too much of low satellites, compared with the
    /// spherical one of Black1984: by 2 % at 10 degrees, 11 % at 5, half at 1.5.
    fn troposphere_variance_m2(&self, delay_m: f64, elevation_rad: f64) -> f64 {
        let sine = elevation_rad.sin();
        let too_much = 1.0 - 1.001 * sine / (0.002_001 + sine * sine).sqrt();
        let shape = if self.troposphere_fraction > 0.0 {
            too_much.max(0.0)
        } else {
            0.0
        };
        (self.troposphere_fraction.powi(2) + shape.powi(2)) * delay_m * delay_m
    }
}

impl Default for ErrorModel {
    /// For real signals: the user range accuracy as broadcast (it tells satellites with poor
    /// clocks apart), half the Klobuchar delay (what it leaves, by IS-GPS-200 20.3.3.5.2.5), 5 %
    /// of the troposphere (0.12 m at the zenith). No multipath: a receiver that tracks for itself
    /// states it with its tracking noise.
    fn default() -> Self {
        Self {
            ura_fraction: 1.0,
            ionosphere_fraction: 0.5,
            troposphere_fraction: 0.05,
            multipath_zenith_m: 0.0,
        }
    }
}

/// Which delays are modelled, how well, and from which elevation on satellites are used.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MeasurementModel {
    /// Ionosphere by these parameters; `None`: no ionospheric delay.
    pub ionosphere: Option<Klobuchar>,
    /// Whether Saastamoinen's troposphere is modelled.
    pub troposphere: bool,
    /// Satellites below are not used, rad.
    pub elevation_mask_rad: f64,
    /// Variance beyond tracking noise.
    pub errors: ErrorModel,
}

/// A pseudorange predicted for a position, without the receiver's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predicted {
    /// Range, minus the satellite's clock, plus modelled delays, m.
    pub pseudorange_m: f64,
    /// Modelled delay of the code by ionosphere and troposphere, m.
    pub delay_m: f64,
    /// Variance left by the modelled delays, m^2.
    pub delay_variance_m2: f64,
    /// How the modelled delay of the troposphere changes; that of the ionosphere does by millimetres a second, which are
    /// left out.
    pub delay_rate: DelayRate,
    /// Variance of that, (m/s)^2.
    pub delay_rate_variance_m2_s2: f64,
    /// Geometry.
    pub line_of_sight: LineOfSight,
    /// Where the satellite stands in the sky.
    pub look: Look,
}

impl MeasurementModel {
    /// |r_sv - r| - c dt_sv + I + T for a receiver at `receiver_ecef_m` at about `time`.
    #[must_use]
    pub fn predict(
        &self,
        state: &SatelliteState,
        receiver_ecef_m: &Vector3<f64>,
        time: GpsTime,
    ) -> Predicted {
        self.at(receiver_ecef_m, time).predict(state)
    }

    /// This model for a receiver at `receiver_ecef_m` at about `time`: what all satellites seen
    /// from there share is computed once.
    pub(crate) fn at(&self, receiver_ecef_m: &Vector3<f64>, time: GpsTime) -> ModelAt<'_> {
        let geodetic = Geodetic::from_ecef(receiver_ecef_m);
        ModelAt {
            model: self,
            receiver_ecef_m: *receiver_ecef_m,
            time,
            geodetic,
            enu_from_ecef: geodetic.enu_from_ecef(),
        }
    }

    /// Variance of a pseudorange: tracking noise `code_variance_m2`, ephemeris, delays, m^2.
    #[must_use]
    pub fn variance_m2(
        &self,
        code_variance_m2: f64,
        user_range_accuracy_m: f64,
        predicted: &Predicted,
    ) -> f64 {
        code_variance_m2
            + (self.errors.ura_fraction * user_range_accuracy_m).powi(2)
            + predicted.delay_variance_m2
            + self
                .errors
                .multipath_variance_m2(predicted.look.elevation_rad)
    }

    /// This model without delays, mask and model errors: for a position not yet known.
    #[must_use]
    pub(crate) fn geometry_only() -> Self {
        Self {
            ionosphere: None,
            troposphere: false,
            elevation_mask_rad: -std::f64::consts::FRAC_PI_2,
            errors: ErrorModel::TRACKING_NOISE_ONLY,
        }
    }
}

/// A measurement model at one place and time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ModelAt<'a> {
    model: &'a MeasurementModel,
    receiver_ecef_m: Vector3<f64>,
    time: GpsTime,
    geodetic: Geodetic,
    enu_from_ecef: Matrix3<f64>,
}

impl ModelAt<'_> {
    /// As [`MeasurementModel::predict`].
    pub(crate) fn predict(&self, state: &SatelliteState) -> Predicted {
        let line_of_sight = LineOfSight::new(state, &self.receiver_ecef_m);
        let look = Look::towards(&(self.enu_from_ecef * line_of_sight.unit_ecef));
        let ionosphere_m = self.model.ionosphere.map_or(0.0, |klobuchar| {
            klobuchar.delay_m(&self.geodetic, &look, self.time)
        });
        let troposphere_m = if self.model.troposphere {
            saastamoinen_delay_m(&self.geodetic, look.elevation_rad)
        } else {
            0.0
        };
        let errors = &self.model.errors;
        let delay_m = ionosphere_m + troposphere_m;
        Predicted {
            pseudorange_m: line_of_sight.range_m - SPEED_OF_LIGHT_MPS * state.clock_bias_s
                + delay_m,
            delay_m,
            delay_variance_m2: (errors.ionosphere_fraction * ionosphere_m).powi(2)
                + errors.troposphere_variance_m2(troposphere_m, look.elevation_rad),
            delay_rate: DelayRate::new(
                troposphere_m,
                &line_of_sight,
                &self.receiver_ecef_m,
                &self.enu_from_ecef.row(2).transpose(),
            ),
            delay_rate_variance_m2_s2: delay_rate::error_mps(troposphere_m, look.elevation_rad)
                .powi(2),
            line_of_sight,
            look,
        }
    }
}
