//! What the ten words of each subframe hold.

pub(super) mod almanac;
pub(super) mod ephemeris;
pub(super) mod hand_over;
pub(super) mod health;
pub(super) mod ionosphere_utc;
pub(super) mod page;
pub(super) mod week;
