//! The bank against samples, against theory, and under the receiver.

mod agreement;
mod multipath;
mod receiver;
mod search;
mod support;
