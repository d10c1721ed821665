//! GNSS navigation: LNAV, orbits, frames, measurements, least squares. Never sees a sample.

mod satellite;
pub mod time;
pub mod ephemeris;
mod error;

pub use ephemeris::{Ephemeris, SatelliteState};
pub use error::NavError;
pub use satellite::{SatelliteId, System};
pub use time::GpsTime;
