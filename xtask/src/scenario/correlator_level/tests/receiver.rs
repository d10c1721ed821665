//! The whole receiver on the bank; its position error against that on samples is measured by
//! [`levels`](crate::validate::levels).

use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::validate::levels::{at_rest, error_m, receive, settings};

#[test]
fn the_receiver_finds_its_place_alone() {
    let scenario = at_rest(40.0, 2).unwrap();
    let bank = CorrelatorLevelBank::new(scenario.scene()).unwrap();
    let (solutions, acquired) = receive(bank, &settings(&scenario, false)).unwrap();
    assert_eq!(acquired, scenario.heard.len());
    // 0.3 m of code noise behind a loop of 0.05 Hz, times a PDOP of two; 5 m leave room for a loop
    // that has not come to rest.
    assert!(error_m(&scenario, solutions.last().unwrap()) < 5.0);
}

#[test]
fn a_quantiser_that_is_not_modelled_is_refused() {
    let mut scene = at_rest(1.0, 0).unwrap().scene();
    scene.reception.samples.format = gnss_signal::sample::SampleFormat::Ci16Le;
    scene.reception.bits = Some(2);
    let error = CorrelatorLevelBank::new(scene).err().unwrap().to_string();
    assert!(error.starts_with("bits: "), "{error}");
}
