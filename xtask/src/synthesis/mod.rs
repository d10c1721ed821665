//! Intermediate-frequency samples of made-up satellites, streamed in bounded memory.
//!
//! A [`Scene`] says what arrives and how it is sampled; a [`Synthesiser`] is a
//! [`SampleSource`](gnss_signal::sample::SampleSource) of it. From block to block:
//!
//! 1. each satellite's [`SignalPath`] gives code and carrier phase at the ends of the block, exact;
//!    between them both run uniformly (an acceleration of 100 m/s^2 bends them by 12 um);
//! 2. code, bits and carrier of all satellites add up at baseband, then white noise;
//! 3. a front-end filter, where there is one;
//! 4. shift to the intermediate frequency, real part where samples are real;
//! 5. quantisation at a fixed level.

mod baseband;
mod filter;
mod message;
mod path;
mod quantise;
mod scene;
mod synthesiser;

pub use message::Message;
pub use path::{Arrival, Atmosphere, OrbitPath, ReceiverMotion, SignalPath, UniformPath};
pub use scene::{Scene, SceneSignal};
pub use synthesiser::Synthesiser;
