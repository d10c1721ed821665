//! One seed of the receivers that the claims rest on; all of them are the command's.

use super::checks::{AXES, below_percent};
use super::receivers::place;
use super::study::Study;
use crate::scenario::make::Level;

#[test]
fn the_vector_receiver_beats_loops_as_wide_and_passes_under_the_bridge() {
    let wanted = [place::FREQUENCY_LOOPS, place::PRODUCT];
    let study = Study::of(Level::Correlator, 1, |k| wanted.contains(&k)).unwrap();
    let below = below_percent(&study, place::PRODUCT, place::FREQUENCY_LOOPS);
    for (axis, percent) in AXES.iter().zip(below) {
        // The bound of the command.
        assert!(percent >= 50.0, "{axis}: {percent} %");
    }
    assert_eq!(study.availability(place::PRODUCT), 1.0);
    assert!(study.overpass_m(place::PRODUCT) <= 5.0);
    assert!(study.roughness_m(place::PRODUCT) < study.roughness_m(place::FREQUENCY_LOOPS));
}
