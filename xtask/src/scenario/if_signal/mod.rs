//! Intermediate-frequency samples of a scene, streamed in bounded memory.
//!
//! A [`Scene`](super::antenna::Scene) says what arrives and how it is sampled; a [`Synthesiser`] is a
//! [`SampleSource`](gnss_signal::sample::SampleSource) of it. From block to block:
//!
//! 1. `plan` cuts time into blocks and asks each [`Emitter`](super::antenna::Emitter) for its rays
//!    every millisecond and at its edges (`segment`): plain numbers, exact at both ends, between
//!    which code and carrier run uniformly;
//! 2. `modulate` adds code, bits and carrier of all rays up at baseband; `interference` adds tones
//!    and sweeps;
//! 3. where there is a front-end `filter`, all that is made twice a sample and brought to one;
//!    `noise` is added, and both are filtered;
//! 4. `shift` turns it to the intermediate frequency; real samples take the real part;
//! 5. `gain` sets the level, lost samples are left out, and `quantise` writes bytes.
//!
//! Steps 2 to 5 of a block depend on no other block (but for an automatic gain), so that `supply` has them done
//! on all threads. Noise is a function of the tick. Inner loops are written in `lanes`.

mod carrier;
mod chips;
mod filter;
mod front_end;
mod gain;
mod grid;
mod interference;
mod lanes;
mod modulate;
mod noise;
mod plan;
mod planes;
mod quantise;
mod segment;
mod shift;
mod supply;
mod synthesiser;
#[cfg(test)]
mod tests;

pub(super) use filter::{REACH, response as filter_response};
pub(super) use quantise::{RMS_8_BIT, STEPS};
pub use synthesiser::{Options, Synthesiser, ThermalNoise};
