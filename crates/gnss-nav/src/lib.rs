//! GNSS navigation: LNAV, orbits, frames, measurements, least squares. Never sees a sample.
//!
#![doc = include_str!("../README.md")]

pub mod atmosphere;
mod calendar;
mod chi_square;
pub mod coarse_time;
pub mod constants;
pub mod ephemeris;
mod error;
pub mod geodesy;
pub mod least_squares;
mod line_of_sight;
mod linear;
pub mod lnav;
pub mod measurement;
pub mod prediction;
mod satellite;
pub mod time;

pub use atmosphere::{Klobuchar, saastamoinen_delay_m};
pub use calendar::Calendar;
pub use chi_square::chi_square_threshold;
pub use ephemeris::{Ephemeris, EphemerisStore, SatelliteState};
pub use error::NavError;
pub use geodesy::{Geodetic, Look};
pub use least_squares::Solution;
pub use line_of_sight::LineOfSight;
pub use measurement::{Measurement, MeasurementModel, RawMeasurement};
pub use satellite::{SatelliteId, System};
pub use time::GpsTime;
