//! Correlator sums of a scene, drawn from their joint distribution instead of made from samples.
//!
//! A [`CorrelatorLevelBank`] is a [`CorrelatorBank`](gnss_signal::CorrelatorBank) over a
//! [`Scene`](super::antenna::Scene): the receiver above it runs unchanged. For every replica
//!
//! 1. rays of the satellite are taken from parabolas through its [`Emitter`](super::antenna::Emitter)
//!    (`ray_track`);
//! 2. bit by bit they add amplitude, code correlation and rotation to the sums (`signal_sum`,
//!    `code_correlation`, `sample_grid`), coherently;
//! 3. filter, quantiser and level control set gain and noise density (`front_end`, `quantiser`,
//!    `level`), interference and the other satellites raise the latter (`interference`);
//! 4. noise that correlates over the taps as the code does is added (`noise`), always the same for
//!    the same interval of the same code.
//!
//! Searches are drawn from the distribution of their statistic (`search`).
//!
//! Limits: other satellites count as noise of their spectral overlap, spread over all Dopplers
//! (in truth a difference near a whole kilohertz concentrates it); interference as `interference`
//! says; a Doppler does not shift the signal in the filter's band.

mod bank;
mod code_correlation;
mod front_end;
mod interference;
mod level;
mod noise;
mod quantiser;
mod ray_track;
mod sample_grid;
mod search;
mod signal_sum;
#[cfg(test)]
mod tests;
mod timeline;

pub use bank::CorrelatorLevelBank;
