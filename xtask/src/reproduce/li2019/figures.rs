//! Figures 2 to 4 of the paper, satellites in use, and velocity error over noise bandwidth.

use anyhow::Result;
use gnss_nav::Geodetic;
use nalgebra::Vector3;
use plotters::style::RGBColor;

use super::checks::AXES;
use super::receivers::{Kind, place};
use super::study::{OVERPASS_S, Study};
use crate::judged::{Judged, JudgedEpoch};
use crate::reproduce::chart::{BLUE, Chart, GREEN, ORANGE, RED, Series, Stroke, picture};

/// The run that is drawn, by number.
const DRAWN: usize = 0;
/// Errors count from here, s.
const FROM_S: f64 = 1.0;
/// Larger errors are not drawn: those of single points after the overpass would hide the rest.
const LARGEST_M: f64 = 6.0;
const LARGEST_MPS: f64 = 0.4;
/// The track is drawn over these seconds.
const TRACK_S: (f64, f64) = (28.0, 35.0);
/// Points of the track off the truth by more are not drawn, m.
const ASTRAY_M: f64 = 60.0;

/// File name and SVG of every picture.
///
/// # Errors
/// Where one cannot be drawn.
pub fn pictures(study: &Study) -> Result<Vec<(String, String)>> {
    let title = format!("Figure 2, left: position errors; beyond {LARGEST_M} m not drawn");
    let positions = errors(study, "m", LARGEST_M, JudgedEpoch::position_ecef_m);
    let velocity = format!("Figure 2, right: velocity errors; beyond {LARGEST_MPS} m/s not drawn");
    let velocities = errors(study, "m/s", LARGEST_MPS, JudgedEpoch::velocity_ecef_mps);
    let drawn = [
        ("figure2-position.svg", picture(&title, &positions)?),
        ("figure2-velocity.svg", picture(&velocity, &velocities)?),
        ("figure3.svg", single_points(study)?),
        ("figure4.svg", filter(study)?),
        ("satellites.svg", satellites(study)?),
        ("bandwidth.svg", bandwidth(study)?),
    ];
    Ok(drawn.map(|(name, svg)| (name.to_owned(), svg)).into())
}

/// The receivers that errors are drawn of, and how.
const SHOWN: [(usize, &str, RGBColor, Stroke); 2] = [
    (
        place::FREQUENCY_LOOPS,
        "single points (FLL)",
        RED,
        Stroke::Dots,
    ),
    (place::PRODUCT, "vector tracking", BLUE, Stroke::Line),
];

fn drawn(study: &Study, receiver: usize) -> Option<&Judged> {
    study.of_receiver(receiver).nth(DRAWN)
}

fn errors(
    study: &Study,
    unit: &str,
    largest: f64,
    error: fn(&JudgedEpoch) -> Vector3<f64>,
) -> Vec<Chart> {
    let points = |receiver, axis: usize| {
        let epochs = drawn(study, receiver).into_iter().flat_map(|j| &j.epochs);
        let all = epochs.map(move |e| (e.pvt.time_s, error(e)[axis]));
        all.filter(|(time_s, value)| *time_s >= FROM_S && value.abs() <= largest)
            .collect()
    };
    let chart = |(axis, name): (usize, &&str)| Chart {
        caption: format!("Error in {name} (ECEF)"),
        x: "time (s)",
        y: if unit == "m" {
            "error (m)"
        } else {
            "error (m/s)"
        },
        series: SHOWN
            .iter()
            .map(|(receiver, label, colour, stroke)| Series {
                label: (*label).to_owned(),
                colour: *colour,
                stroke: *stroke,
                points: points(*receiver, axis),
            })
            .collect(),
        shaded: vec![OVERPASS_S],
        ..Chart::default()
    };
    AXES.iter().enumerate().map(chart).collect()
}

fn single_points(study: &Study) -> Result<String> {
    let title = "Figure 3: single points about the overpass";
    let note = format!("Points more than {ASTRAY_M} m off not drawn");
    let shown = [
        (place::FREQUENCY_LOOPS, "single points (FLL)", RED),
        (place::PHASE_LOOPS, "single points (PLL)", ORANGE),
    ];
    picture(title, &[track(study, note, &shown)])
}

fn filter(study: &Study) -> Result<String> {
    let title = "Figure 4: vector tracking about the overpass";
    let note = "Three satellites from 30 to 32 s".to_owned();
    picture(
        title,
        &[track(
            study,
            note,
            &[(place::PRODUCT, "vector tracking", BLUE)],
        )],
    )
}

/// North over east, from the truth at the beginning of the stretch.
fn track(study: &Study, caption: String, shown: &[(usize, &str, RGBColor)]) -> Chart {
    let epochs = |receiver| {
        let run = drawn(study, receiver).into_iter();
        run.flat_map(|j| j.between(TRACK_S.0, TRACK_S.1))
    };
    let truth = |e: &JudgedEpoch| e.pvt.position_ecef_m - e.position_ecef_m();
    let origin = epochs(place::PRODUCT)
        .next()
        .map_or_else(Vector3::zeros, truth);
    let to_enu = Geodetic::from_ecef(&origin).enu_from_ecef();
    let at = |ecef_m: Vector3<f64>| {
        let enu = to_enu * (ecef_m - origin);
        (enu.x, enu.y)
    };
    let mut series = vec![Series {
        label: "truth".to_owned(),
        colour: GREEN,
        stroke: Stroke::Line,
        points: epochs(place::PRODUCT).map(|e| at(truth(e))).collect(),
    }];
    series.extend(shown.iter().map(|(receiver, label, colour)| {
        Series {
            label: (*label).to_owned(),
            colour: *colour,
            stroke: Stroke::Dots,
            points: epochs(*receiver)
                .filter(|e| e.position_enu_m.norm() <= ASTRAY_M)
                .map(|e| at(e.pvt.position_ecef_m))
                .collect(),
        }
    }));
    Chart {
        caption,
        x: "east (m)",
        y: "north (m)",
        series,
        ..Chart::default()
    }
}

fn satellites(study: &Study) -> Result<String> {
    let series = |(receiver, label, colour, stroke): &(usize, &str, RGBColor, Stroke)| Series {
        label: (*label).to_owned(),
        colour: *colour,
        stroke: *stroke,
        points: drawn(study, *receiver)
            .into_iter()
            .flat_map(|j| &j.epochs)
            .map(|e| (e.pvt.time_s, e.pvt.satellites_used as f64))
            .collect(),
    };
    let chart = Chart {
        caption: "Seven satellites; road signs at 8, 20 and 41 s, overpass from 30 to 32 s"
            .to_owned(),
        x: "time (s)",
        y: "satellites in the solution",
        series: SHOWN.iter().map(series).collect(),
        shaded: vec![OVERPASS_S],
        ..Chart::default()
    };
    picture("Satellites in use", &[chart])
}

/// Velocity error of every receiver whose bandwidth is known, by what gives its range rates.
fn bandwidth(study: &Study) -> Result<String> {
    let series = |label: &str, colour, belongs: fn(&Kind) -> bool| Series {
        label: label.to_owned(),
        colour,
        stroke: Stroke::Line,
        points: curve(study, belongs),
    };
    let chart = Chart {
        caption: "Velocity error (3-D, rms, all seeds) over noise bandwidth (mean of the axes)"
            .to_owned(),
        x: "noise bandwidth (Hz)",
        y: "error (m/s)",
        series: vec![
            series("single points, FLL", RED, |k| {
                matches!(k, Kind::FrequencyLoops { .. })
            }),
            series(
                "vector, discriminators alone, by q_a",
                ORANGE,
                |k| matches!(k, Kind::Vector(v) if !v.carrier_phase && v.update_s == 0.02),
            ),
            series(
                "vector, carrier phase, by q_a",
                BLUE,
                |k| matches!(k, Kind::Vector(v) if v.carrier_phase && v.update_s == 0.02),
            ),
        ],
        ..Chart::default()
    };
    picture("What a noise bandwidth costs", &[chart])
}

fn curve(study: &Study, belongs: fn(&Kind) -> bool) -> Vec<(f64, f64)> {
    let all = study.receivers.iter().enumerate();
    let mut points: Vec<_> = all
        .filter(|(_, receiver)| belongs(&receiver.kind))
        .filter_map(|(place, receiver)| {
            let axes_hz = study.theory.bandwidth_of(&receiver.kind)?;
            let mean_hz = axes_hz.iter().sum::<f64>() / 3.0;
            Some((mean_hz, study.speed_mps(place)))
        })
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}
