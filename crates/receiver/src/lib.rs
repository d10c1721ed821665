//! GPS software receiver: samples in, positions and verdicts out.

mod error;
pub mod record;
pub mod sink;
pub mod summary;

pub use error::ReceiverError;
