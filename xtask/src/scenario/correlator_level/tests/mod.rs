//! The bank against samples, against theory, and under the receiver.

mod agreement;
mod receiver;
mod support;
