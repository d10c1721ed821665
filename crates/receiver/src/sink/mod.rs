//! Writers of output files, one for each format.

mod calendar;
pub mod channels;
pub mod events;
pub mod file;
pub mod kml;
pub mod navigation;
pub mod nmea;
pub mod observations;
pub mod outputs;
pub mod position;
pub mod pvt;
pub mod report;
mod rinex_header;
#[cfg(test)]
pub(crate) mod sample_records;
pub mod taps;
mod text;

use crate::ReceiverError;
use crate::record::Record;

pub use text::Fixed;
pub(crate) use text::rounded;

/// Writes records to one place.
pub trait EventSink {
    /// Takes one record; those it has no use for are ignored.
    ///
    /// # Errors
    /// Where writing fails.
    fn record(&mut self, record: &Record) -> Result<(), ReceiverError>;

    /// Completes the output.
    ///
    /// # Errors
    /// Where writing fails.
    fn finish(&mut self) -> Result<(), ReceiverError>;
}
