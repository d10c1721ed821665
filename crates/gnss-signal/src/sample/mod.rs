//! Samples: formats, sources, and the ring that holds the last of them.

mod format;
mod ring;
mod source;
mod unpack;
mod wide;

pub use format::SampleFormat;
pub use ring::SampleRing;
pub use source::{ReaderSource, SampleDescription, SampleSource};
