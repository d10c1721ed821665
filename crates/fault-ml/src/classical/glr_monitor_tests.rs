//! The likelihood ratio on pseudoranges of a receiver whose clock is anything.

use super::*;
use crate::test_sky::{TAILED, measurements, noise};
use crate::{IntegrityMonitor, SatelliteMeasurement};

/// Pseudoranges of epoch `k`: noise, a clock that drifts by 90 m/s and jumps by a millisecond, and
/// steps on satellite 4 from epoch 60 to 119 and on satellite 7 from epoch 80 on.
fn epoch(k: usize, noise: &[f64; 9]) -> Vec<SatelliteMeasurement> {
    let jump_m = if k >= 40 { 299_792.458 } else { 0.0 };
    let clock_m = 90.0 * k as f64 + jump_m;
    let fault = |id| match id {
        4 if (60..120).contains(&k) => 20.0,
        7 if k >= 80 => -25.0,
        _ => 0.0,
    };
    measurements(9, |id| noise[id as usize - 1] + clock_m + fault(id))
}

#[test]
fn two_steps_are_named_one_after_another_and_one_is_forgiven() {
    let mut monitor = GlrMonitor::new(GlrParameters::default()).unwrap();
    let mut alarmed = Vec::new();
    let mut aside = Vec::new();
    for (k, noise) in noise(&TAILED, 200, 3).iter().enumerate() {
        let report = monitor.epoch(k as f64, &epoch(k, noise)).unwrap();
        alarmed.extend(report.faulty_satellite().map(|id| (k, id)));
        aside.push(monitor.set_aside().to_vec());
    }
    // 20 m add 0.5 x (20 / 3)^2 (1 - leverage of 0.26 to 0.76) an epoch to the ratio: 5 at least.
    let named: Vec<u32> = alarmed.iter().map(|(_, id)| *id).collect();
    assert_eq!(named, [4, 7], "{alarmed:?}");
    assert!((60..70).contains(&alarmed[0].0), "{alarmed:?}");
    assert!((80..90).contains(&alarmed[1].0), "{alarmed:?}");
    assert_eq!(aside[199], [7], "satellite 4 is healthy again");
}

#[test]
fn a_receiver_that_says_how_it_moves_is_followed() {
    let mut monitor = GlrMonitor::new(GlrParameters::default()).unwrap();
    for (k, noise) in noise(&TAILED, 120, 5).iter().enumerate() {
        let mut moved = measurements(9, |id| noise[id as usize - 1]);
        for one in &mut moved {
            // The whole scene moves with the receiver: ranges stay.
            one.position_ecef_m[1] += 20.0 * k as f64;
        }
        if k > 0 {
            monitor.displace(&[0.0, 20.0, 0.0]);
        }
        let report = monitor.epoch(k as f64, &moved).unwrap();
        assert_eq!(report.faulty_satellite(), None, "at {k}");
    }
}

#[test]
fn what_cannot_be_used_leaves_no_trace() {
    let new = || GlrMonitor::new(GlrParameters::default()).unwrap();
    let (mut first, mut second) = (new(), new());
    for (k, noise) in noise(&TAILED, 40, 3).iter().enumerate() {
        let good = epoch(k, noise);
        let mut bad = good.clone();
        bad[0].variance_m2 = -1.0;
        assert!(second.epoch(k as f64, &bad).is_err());
        assert!(second.epoch(f64::NAN, &good).is_err());
        assert_eq!(first.epoch(k as f64, &good), second.epoch(k as f64, &good));
    }
    let threshold = 0.0;
    let impossible = GlrParameters {
        threshold,
        ..GlrParameters::default()
    };
    assert!(GlrMonitor::new(impossible).is_err());
    let few = measurements(4, |_| 0.0);
    assert_eq!(
        new().epoch(0.0, &few),
        Ok(crate::IntegrityReport::Unavailable)
    );
}
