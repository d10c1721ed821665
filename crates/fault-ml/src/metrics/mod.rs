//! How good a monitor is: figures of scores against the truth, each with its uncertainty.

mod balanced;
mod rate;
mod roc;

pub use balanced::BalancedAccuracy;
pub use rate::{RateInterval, Share};
pub use roc::{Roc, RocPoint};
