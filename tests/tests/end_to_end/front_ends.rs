//! The receiver, alone, under a made-up open sky: one of the front ends that
//! `cargo xtask validate front-ends` goes through.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use xtask::scenario::command::receive;
use xtask::scenario::make::Level;
use xtask::validate::front_ends::{FrontEnd, LARGEST_RMS_M};

#[test]
fn one_bit_at_four_samples_a_chip_fixes_within_a_metre() {
    let folder = tempfile::tempdir().unwrap();
    let front_end = FrontEnd {
        sample_rate_hz: 4.092e6,
        bits: 1,
    };
    let scenario = front_end.scenario(40.0, None).unwrap();
    let summary = receive(&scenario, Level::If, folder.path(), &[]).unwrap();
    // The first frame of 30 s holds what is needed by its 18th second.
    assert!(summary.first_fix_s.unwrap() <= 20.0);
    let error = summary.error.unwrap();
    assert!(error.horizontal_rms_m <= LARGEST_RMS_M, "{error:?}");
    assert!(error.availability >= 0.99, "{error:?}");
}
