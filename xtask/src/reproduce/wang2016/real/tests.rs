//! A few steps on the recording, where it is present.

use super::*;

// A test that checks nothing has to say so.
#[allow(clippy::print_stdout)]
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
    let noise = fit(&record).unwrap();
    // Biases of up to 4 m, a slow part of 0.2 to 0.6 m (description of the recording).
    assert!((0.5..4.0).contains(&noise.bias_sigma_m), "{noise:?}");
    assert!((0.1..1.0).contains(&noise.markov_sigma_m), "{noise:?}");
}

#[test]
fn a_step_of_30_m_is_found_and_named() {
    let Some(record) = record() else { return };
    let pf = Kind::Particle(ParticleParameters::receiver(Movement::Bootstrap));
    for (satellite, onset) in [(2, 300), (7, 600)] {
        let mut detector = Detector::start(pf, record.satellites(), 1).unwrap();
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
