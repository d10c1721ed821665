//! GNSS navigation: LNAV, orbits, frames, measurements, least squares, Kalman filters. Never sees a sample.
//!
#![doc = include_str!("../README.md")]

pub mod atmosphere;
mod calendar;
mod chi_square;
pub mod coarse_time;
pub mod constants;
mod delay_rate;
pub mod dynamics;
pub mod ephemeris;
mod error;
pub mod filter;
pub mod geodesy;
pub mod integrity;
pub mod least_squares;
mod line_of_sight;
mod linear;
pub mod lnav;
#[cfg(test)]
mod made_up_sky;
pub mod measurement;
pub mod prediction;
mod satellite;
mod state;
pub mod time;
pub mod tracking_noise;

pub use atmosphere::{Klobuchar, saastamoinen_delay_m};
pub use calendar::Calendar;
pub use chi_square::chi_square_threshold;
pub use delay_rate::DelayRate;
pub use ephemeris::{Ephemeris, EphemerisStore, SatelliteState};
pub use error::NavError;
pub use geodesy::{Geodetic, Look};
pub use least_squares::Solution;
pub use line_of_sight::LineOfSight;
pub use measurement::{Measurement, MeasurementModel, RawMeasurement};
pub use satellite::{SatelliteId, System};
pub use state::NavState;
pub use time::GpsTime;
