//! Intermediate-frequency samples of made-up satellites, streamed in bounded memory.
//!
//! A [`Scene`](super::antenna::Scene) says what arrives and how it is sampled; a [`Synthesiser`] is a
//! [`SampleSource`](gnss_signal::sample::SampleSource) of it. From block to block:
//!
//! 1. each [`Emitter`](super::antenna::Emitter) gives code and carrier phase at the ends of the block, exact;
//!    between them both run uniformly (an acceleration of 100 m/s^2 bends them by 12 um);
//! 2. code, bits and carrier of all satellites add up at baseband, then white noise;
//! 3. a front-end filter, where there is one;
//! 4. shift to the intermediate frequency, real part where samples are real;
//! 5. quantisation at a fixed level.

mod baseband;
mod filter;
mod quantise;
mod synthesiser;

pub(super) use filter::{OVERSAMPLING, impulse_response};
pub(super) use quantise::{RMS_8_BIT, STEP_2_BIT};
pub use synthesiser::Synthesiser;
