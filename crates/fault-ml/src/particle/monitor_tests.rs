//! The monitor on pseudoranges of a receiver at rest whose clock is anything.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::test_sky::{PLACE_M, TAILED, measurements, noise};
use crate::{Health, IntegrityMonitor, IntegrityReport, SatelliteMeasurement};

fn monitor(movement: Movement) -> ParticleMonitor {
    let parameters = ParticleParameters::receiver(movement);
    ParticleMonitor::new(parameters.check().unwrap(), ChaCha8Rng::seed_from_u64(1))
}

fn swarm() -> Movement {
    Movement::Swarm(SwarmSettings::default())
}

/// Pseudoranges of epoch `k`: noise, a clock that drifts by 90 m/s and jumps by a millisecond, and
/// a fault on satellite 4 from epoch 60 to 119.
fn epoch(k: usize, noise: &[f64; 9]) -> Vec<SatelliteMeasurement> {
    let jump_m = if k >= 40 { 299_792.458 } else { 0.0 };
    let clock_m = 90.0 * k as f64 + jump_m;
    let fault = |id| {
        if id == 4 && (60..120).contains(&k) {
            35.0
        } else {
            0.0
        }
    };
    measurements(9, |id| noise[id as usize - 1] + clock_m + fault(id))
}

#[test]
fn a_fault_is_named_and_forgiven_whatever_the_clock_does() {
    for movement in [Movement::Bootstrap, swarm()] {
        let mut monitor = monitor(movement);
        let (mut alarmed, mut aside) = (Vec::new(), Vec::new());
        for (k, noise) in noise(&TAILED, 160, 3).iter().enumerate() {
            let report = monitor.epoch(k as f64, &epoch(k, noise)).unwrap();
            alarmed.extend(report.faulty_satellite().map(|id| (k, id)));
            aside.extend((!monitor.set_aside().is_empty()).then_some(k));
            let found = monitor.solution().unwrap().position_ecef_m;
            let error_m = found
                .iter()
                .zip(PLACE_M)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt();
            // An uncorrected swarm is least squares of one epoch: 3 m rms here, five times that.
            assert!(error_m < 15.0, "{error_m} m at {k}");
        }
        // 35 m is a dozen deviations: seen within three epochs.
        assert_eq!(alarmed.len(), 1, "{alarmed:?}");
        assert!(
            alarmed[0].1 == 4 && (60..63).contains(&alarmed[0].0),
            "{alarmed:?}"
        );
        let last = *aside.last().unwrap();
        // A dozen epochs of health take it back.
        assert!((122..150).contains(&last), "{last}");
    }
}

#[test]
fn names_and_states_are_those_of_the_trait() {
    assert_eq!(monitor(Movement::Bootstrap).name(), "pf");
    let mut monitor = monitor(swarm());
    assert_eq!(monitor.name(), "pso-pf");
    let few = measurements(4, |_| 0.0);
    assert_eq!(monitor.epoch(0.0, &few), Ok(IntegrityReport::Unavailable));
    let enough = measurements(9, |_| 0.0);
    assert_eq!(monitor.epoch(1.0, &enough), Ok(IntegrityReport::WarmingUp));
    for k in 2..25 {
        monitor.epoch(f64::from(k), &enough).unwrap();
    }
    assert_eq!(
        monitor.epoch(25.0, &enough).unwrap().health(),
        Health::Healthy
    );
    assert!(
        monitor
            .protection_levels(&IntegrityRisk::default())
            .unwrap()
            .is_some()
    );
    monitor.reset();
    assert_eq!(monitor.epoch(0.0, &enough), Ok(IntegrityReport::WarmingUp));
}

#[test]
fn what_cannot_be_used_leaves_no_trace() {
    let (mut first, mut second) = (monitor(swarm()), monitor(swarm()));
    for (k, noise) in noise(&TAILED, 40, 3).iter().enumerate() {
        let good = epoch(k, noise);
        let mut bad = good.clone();
        bad[0].variance_m2 = -1.0;
        assert!(second.epoch(k as f64, &bad).is_err());
        bad.clone_from(&good);
        bad[8].position_ecef_m[1] = f64::NAN;
        assert!(second.epoch(k as f64, &bad).is_err());
        assert!(second.epoch(f64::NAN, &good).is_err());
        assert_eq!(first.epoch(k as f64, &good), second.epoch(k as f64, &good));
    }
}
