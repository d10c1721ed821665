//! Scalar tracking of one signal: pull-in, loops, lock, bits, and the pre-filter.

mod bit_sum;
pub mod channel;
pub mod cn0;
pub mod discriminator;
mod epoch;
mod fade;
mod lock;
pub mod loop_filter;
mod nco;
mod noise;
mod phase_slope;
mod presence;
mod pull_in;
mod sample_grid;
mod settings;
#[cfg(test)]
mod simulated;
mod steady;
mod steered;

pub use channel::{BitSync, Channel, ChannelUpdate, NavBit};
pub use epoch::{ChannelEpoch, DopplerReach};
pub use lock::Lock;
pub use noise::NoiseFloor;
pub use settings::{Spectrum, TrackingSettings};
pub use steered::{BitsLate, FrequencyPairs, Reception, Silence, SteeredSettings, Steering};
