//! Where samples come from.

use std::io;

use super::SampleFormat;
use crate::FrontEnd;

/// What is needed to read a stream of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleDescription {
    /// Encoding of the samples.
    pub format: SampleFormat,
    /// Samples (I, Q pairs where complex) per second.
    pub sample_rate_hz: f64,
    /// Frequency at which a signal without Doppler appears, Hz; may be negative.
    pub intermediate_frequency_hz: f64,
    /// Whether I and Q are exchanged in the stream.
    pub swap_iq: bool,
}

impl SampleDescription {
    /// The front end these samples come from.
    #[must_use]
    pub const fn front_end(&self) -> FrontEnd {
        FrontEnd {
            sample_rate_hz: self.sample_rate_hz,
            intermediate_frequency_hz: self.intermediate_frequency_hz,
            complex: self.format.is_complex(),
        }
    }
}

/// A stream of samples.
pub trait SampleSource {
    /// How to read the bytes of this source.
    fn description(&self) -> SampleDescription;

    /// Fills some or all of `bytes` from the stream and returns how many; 0 at its end only.
    ///
    /// # Errors
    /// Where the stream cannot be read.
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize>;
}

/// Samples from anything that can be read: an open file, standard input, bytes in memory.
#[derive(Debug)]
pub struct ReaderSource<R> {
    reader: R,
    description: SampleDescription,
}

impl<R: io::Read> ReaderSource<R> {
    /// Reads samples as described from `reader`.
    #[must_use]
    pub const fn new(reader: R, description: SampleDescription) -> Self {
        Self {
            reader,
            description,
        }
    }
}

impl<R: io::Read> SampleSource for ReaderSource<R> {
    fn description(&self) -> SampleDescription {
        self.description
    }

    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.reader.read(bytes) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                result => return result,
            }
        }
    }
}
