//! A few steps on the recording, where it is present.
#![allow(
    clippy::print_stdout,
    reason = "a test that checks nothing has to say so"
)]

use super::*;

fn record() -> Option<Record> {
    let record = Record::read().unwrap();
    if record.is_none() {
        println!("SKIPPED: no recording (GNSS_TEST_DATA)");
    }
    record
}

#[test]
fn the_recording_has_the_satellites_in_view_throughout() {
    let Some(record) = record() else { return };
    // Ten of the eleven or twelve GPS satellites stay above 10 degrees for the quarter of an hour.
    assert_eq!((record.satellites(), record.epochs.len()), (10, 900));
}

#[test]
fn the_noise_of_other_receivers_is_smaller_than_stated() {
    let Some(shapes) = noise::shapes().unwrap() else {
        println!("SKIPPED: no recording (GNSS_TEST_DATA)");
        return;
    };
    for shape in &shapes {
        // Stated deviations take the upper bound of the broadcast accuracy.
        let sigma = shape.found.sigma_m();
        assert!((0.03..0.6).contains(&sigma), "{shape:?}");
        assert!((shape.as_stated().sigma_m() - 1.0).abs() < 1e-12);
    }
    // One satellite of the day, whose clock was poor, is far worse than the rest.
    assert!(shapes[0].found.bias_tail_share > 0.002, "{shapes:?}");
}

#[test]
fn a_step_of_30_m_is_found_and_named() {
    let Some(record) = record() else { return };
    let pf = Kind::Particle(ParticleParameters::receiver(Movement::Bootstrap));
    for (satellite, onset) in [(2, 300), (7, 600)] {
        let mut detector = Detector::start(pf, ChaCha8Rng::seed_from_u64(1)).unwrap();
        let alarm = (onset - BEFORE..onset + 10).find_map(|k| {
            let mut sights = record.epochs[k].clone();
            if k >= onset {
                sights[satellite].residual_m += 30.0;
                take_off_median(&mut sights);
            }
            let (score, named) = detector.epoch(k, &sights).unwrap();
            (score > 20.0).then_some((k, named))
        });
        let (k, named) = alarm.unwrap();
        assert!(k >= onset && named == satellite, "{k} {named}");
    }
}
