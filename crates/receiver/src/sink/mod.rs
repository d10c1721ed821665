//! Writers of output files, one for each format.

use crate::ReceiverError;
use crate::record::Record;

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
