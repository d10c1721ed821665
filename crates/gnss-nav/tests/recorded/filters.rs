//! Kalman filters on recorded pseudoranges of receivers at rest, beside least squares.

use gnss_nav::dynamics::{AccelerationNoise, ProcessNoise};
use gnss_nav::filter::{
    Advice, FaultLogic, FaultThresholds, FilterSettings, NavFilter, SequentialFilter, SkipReason,
    Skipped,
};
use gnss_nav::least_squares::solve;
use gnss_nav::measurement::form;
use gnss_nav::{Geodetic, Measurement, RawMeasurement};
use nalgebra::Vector3;

use crate::data::{number, rows};
use crate::positions::{OUTLIERS, RECORDINGS, model, raw, time};
use crate::rinex::Navigation;

/// Filter settings for a receiver at rest, which the filter is not told.
fn settings(navigation: &Navigation) -> FilterSettings {
    FilterSettings {
        model: model(navigation),
        process_noise: ProcessNoise {
            acceleration: AccelerationNoise::isotropic(0.01),
            ..ProcessNoise::default()
        },
        ..FilterSettings::default()
    }
}

/// The measurements of every epoch.
fn epochs(navigation: &Navigation, reference: &str) -> Vec<Vec<Measurement>> {
    let all: Vec<Vec<&str>> = rows(reference, 1).collect();
    let epochs = all.chunk_by(|a, b| a[1] == b[1]).map(|epoch| {
        let raws: Vec<RawMeasurement> = epoch.iter().map(|row| raw(row)).collect();
        form(time(&epoch[0]), &raws, &navigation.store).measurements
    });
    epochs.collect()
}

/// Positions of the filter and of least squares from the second epoch on, and what was skipped.
fn run(
    settings: &FilterSettings,
    epochs: &[Vec<Measurement>],
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Vec<Skipped>) {
    let fix = |epoch: &[Measurement]| solve(epoch, &settings.model, &Vector3::zeros()).unwrap();
    let mut filter = SequentialFilter::from_solution(&fix(&epochs[0]), *settings).unwrap();
    let mut faults = FaultLogic::new(FaultThresholds::default()).unwrap();
    let (mut filtered, mut single, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
    for epoch in &epochs[1..] {
        let to = filter.state().gps_time(epoch[0].receive_time);
        filter.predict(to).unwrap();
        let innovations = filter.innovations(epoch).unwrap();
        let update = filter.update(&innovations, &[]).unwrap();
        assert_eq!(faults.observe(&innovations, &update), Advice::Nothing);
        filtered.push(filter.state().position_ecef_m);
        single.push(fix(epoch).position_ecef_m);
        skipped.extend(update.skipped);
    }
    (filtered, single, skipped)
}

#[test]
fn filters_are_no_worse_than_least_squares_and_smoother() {
    for recording in &RECORDINGS {
        let Some((navigation, reference)) = recording.read() else {
            return;
        };
        let (filtered, single, _) = run(&settings(&navigation), &epochs(&navigation, &reference));
        let truth = Vector3::from(recording.truth_ecef_m);
        let (by_filter, by_fixes) = (errors(&filtered, &truth), errors(&single, &truth));
        eprintln!(
            "{}: rms and step, filter {by_filter:.3?} m, least squares {by_fixes:.3?} m",
            recording.folder
        );
        // The errors are those of orbits and air, which last: no filter takes them away, and a
        // different weighting moves them by a centimetre.
        assert!(by_filter[0] < by_fixes[0] + 0.01);
        assert!(by_filter[1] < 0.6 * by_fixes[1]);
    }
}

#[test]
fn the_gate_skips_genuine_outliers_for_their_epoch() {
    let Some((navigation, reference)) = OUTLIERS.read() else {
        return;
    };
    let outliers = rows(&reference, 1)
        // The fourth, of a satellite at 5 degrees, lies below the mask.
        .filter(|row| number(row, 11).abs() > 100.0 && number(row, 4) > 10.0)
        .count();
    let (filtered, _, skipped) = run(&settings(&navigation), &epochs(&navigation, &reference));
    let gated = skipped.iter().filter(|s| s.reason == SkipReason::Gate);
    let gated = gated.count();
    let truth = Vector3::from(OUTLIERS.truth_ecef_m);
    let [rms_m, _] = errors(&filtered, &truth);
    let worst_m = filtered
        .iter()
        .map(|p| (p - truth).norm())
        .fold(0.0, f64::max);
    eprintln!("{gated} skipped, {outliers} outliers; rms {rms_m:.3} m, worst {worst_m:.1} m");
    assert_eq!((gated, outliers), (3, 3));
    // As for least squares without them.
    assert!(rms_m < OUTLIERS.allowed_m[0] && worst_m < 5.0);
}

/// Rms of the horizontal error and of its change from epoch to epoch, m.
fn errors(positions: &[Vector3<f64>], truth: &Vector3<f64>) -> [f64; 2] {
    let enu = Geodetic::from_ecef(truth).enu_from_ecef();
    let errors: Vec<_> = positions.iter().map(|p| (enu * (p - truth)).xy()).collect();
    let rms = |squares: f64, count: usize| (squares / count as f64).sqrt();
    let total = errors.iter().map(|e| e.norm_squared()).sum();
    let steps = errors
        .windows(2)
        .map(|e| (e[1] - e[0]).norm_squared())
        .sum();
    [rms(total, errors.len()), rms(steps, errors.len() - 1)]
}
