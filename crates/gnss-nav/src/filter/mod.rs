//! Kalman filters of position, velocity and clock: eight error states in ECEF (Jiang2017, Li2019).
//!
//! An epoch is `predict`, `innovations`, `update`. Between the last two the caller may look at
//! every innovation and decide, satellite by satellite, what the filter is to do with it. The
//! filter itself skips single measurements of an epoch (its gate) and never excludes a satellite.
//!
//! ```
//! use gnss_nav::filter::{FilterSettings, NavFilter, SequentialFilter};
//! use gnss_nav::{EphemerisStore, GpsTime, NavError, NavState, RawMeasurement};
//! use gnss_nav::{least_squares, measurement};
//!
//! /// The state at each epoch after the first, which starts the filter by least squares.
//! fn track(
//!     epochs: &[(GpsTime, Vec<RawMeasurement>)],
//!     ephemerides: &EphemerisStore,
//!     settings: FilterSettings,
//! ) -> Result<Vec<NavState>, NavError> {
//!     let Some(((start, raw), rest)) = epochs.split_first() else {
//!         return Ok(Vec::new());
//!     };
//!     let first = measurement::form(*start, raw, ephemerides).measurements;
//!     let fix = least_squares::solve(&first, &settings.model, &Default::default())?;
//!     let mut filter = SequentialFilter::from_solution(&fix, settings)?;
//!     let mut track = Vec::new();
//!     for (receive_time, raw) in rest {
//!         let measurements = measurement::form(*receive_time, raw, ephemerides).measurements;
//!         filter.predict(filter.state().gps_time(*receive_time))?;
//!         let innovations = filter.innovations(&measurements)?;
//!         filter.update(&innovations, &[])?;
//!         track.push(*filter.state());
//!     }
//!     Ok(track)
//! }
//! # assert_eq!(track(&[], &EphemerisStore::new(), FilterSettings::default()), Ok(vec![]));
//! ```

mod batch;
mod correction;
mod covariance;
mod disposition;
mod ekf;
mod fault_logic;
mod geometry;
mod given_others;
mod innovation;
mod row;
mod sequential;
mod settings;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

use crate::{GpsTime, Measurement, NavError, NavState, SatelliteId};

pub use batch::Batch;
pub use covariance::{Covariance, STATES};
pub use disposition::{Disposition, SkipReason, Skipped, Update};
pub use ekf::{BatchFilter, Ekf, SequentialFilter};
pub use fault_logic::{Advice, FaultLogic, FaultThresholds};
pub use geometry::EpochGeometry;
pub use given_others::{Deviation, GivenOthers};
pub use innovation::{Innovation, Innovations, SatelliteInnovation};
pub use row::Observable;
pub use sequential::Sequential;
pub use settings::{FilterSettings, Gate};

/// A filter of the receiver's state. Where a call returns an error the filter is as before it.
pub trait NavFilter {
    /// The present estimate.
    fn state(&self) -> &NavState;

    /// Covariance of its error.
    fn covariance(&self) -> Covariance;

    /// What that covariance grows to within `interval_s` (0 or more) without a measurement.
    fn covariance_after(&self, interval_s: f64) -> Covariance;

    /// Carries state and covariance to GPS time `to`, not before the present.
    ///
    /// For an epoch of the receiver's clock `to` is [`NavState::gps_time`] of it.
    ///
    /// # Errors
    /// [`NavError::Value`] for a time before the present, [`NavError::Singular`] where the
    /// covariance overflows.
    fn predict(&mut self, to: GpsTime) -> Result<(), NavError>;

    /// Adds what an acceleration known from elsewhere, ECEF, m/s^2, did over the last `interval_s`: the
    /// control input of the model.
    ///
    /// # Errors
    /// [`NavError::Value`] where it is not finite.
    fn accelerate(
        &mut self,
        acceleration_ecef_mps2: &Vector3<f64>,
        interval_s: f64,
    ) -> Result<(), NavError>;

    /// Takes the clock's drift for less certain by `variance_m2_s2`.
    ///
    /// Range rates measure the mean frequency over an interval, not the drift: white frequency noise
    /// lies between them, with a variance of S_f over the interval, common to all.
    ///
    /// # Errors
    /// [`NavError::Value`] where it is negative or not finite.
    fn loosen_drift(&mut self, variance_m2_s2: f64) -> Result<(), NavError>;

    /// Holds `measurements`, taken at the filter's time, against the prediction; changes nothing.
    ///
    /// # Errors
    /// [`NavError::Value`] for a measurement of another time, [`NavError::Measurement`] for values
    /// that are not finite or variances not above zero.
    fn innovations(&self, measurements: &[Measurement]) -> Result<Innovations, NavError>;

    /// Takes in `innovations` as `dispositions` say (a satellite not named is used) and returns
    /// what was skipped.
    ///
    /// # Errors
    /// [`NavError::StaleInnovations`] where the filter moved since they were formed,
    /// [`NavError::Value`] for a variance factor not above zero, [`NavError::Singular`].
    fn update(
        &mut self,
        innovations: &Innovations,
        dispositions: &[(SatelliteId, Disposition)],
    ) -> Result<Update, NavError>;
}
