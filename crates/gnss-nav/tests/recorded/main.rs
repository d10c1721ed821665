//! Orbits, measurements and solutions against recorded data and independent programs.
//!
//! The data are not part of the project: they are looked for beside the workspace or where
//! `GNSS_TEST_DATA` points, and a test that does not find them says so.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test fails by panicking, and says aloud what it skips"
)]

mod data;
mod filters;
mod orbits;
mod positions;
mod rinex;
mod snapshot;
