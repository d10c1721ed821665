//! What monitors find as curves: detections over false alarms, and over the time since the onset.

use anyhow::Result;
use plotters::style::RGBColor;

use super::Row;
use crate::reproduce::chart::{BLUE, Bar, Chart, GREEN, RED, Series, Stroke, picture};
use crate::train::evaluate::{Examination, OnFault};

/// By monitor, in the order of the rows.
const COLOURS: [RGBColor; 3] = [RED, GREEN, BLUE];
/// Every so many places of a ROC has a bar ...
const BARRED: usize = 5;
/// ... that those of other monitors stand beside, percent of false alarms.
const BESIDE: f64 = 0.5;
/// Time after the onset that is drawn, s, and its steps.
const DRAWN_S: f64 = 10.0;
const STEP_S: f64 = 0.05;

/// Detections over false alarms of single decisions, with bands over scenarios.
///
/// # Errors
/// Where it cannot be drawn.
pub(super) fn roc(rows: &[Row]) -> Result<String> {
    let coloured = || rows.iter().map(|row| &row.examination).zip(COLOURS);
    let bars = coloured().enumerate().flat_map(|(number, (of, colour))| {
        let beside = BESIDE * (number as f64 - 1.0);
        of.roc
            .iter()
            .skip(BARRED)
            .step_by(BARRED)
            .map(move |at| Bar {
                x: 100.0 * at.false_alarms + beside,
                ends: (100.0 * at.band.0, 100.0 * at.band.1),
                colour,
            })
    });
    let points = |of: &Examination| {
        let points = of.roc.iter();
        points
            .map(|at| (100.0 * at.false_alarms, 100.0 * at.detections))
            .collect()
    };
    let chart = Chart {
        caption: "Single decisions on windows; bars hold 95 % of draws of scenarios".to_owned(),
        x: "healthy windows above the threshold (%)",
        y: "faulty windows above it (%)",
        series: coloured()
            .map(|(of, colour)| line(of, colour, points(of)))
            .collect(),
        bars: bars.collect(),
        ceiling: Some(100.0),
        ..Chart::default()
    };
    picture("Detections over false alarms", &[chart])
}

/// Faults found over the time since their onset, at the thresholds of the rows: all, then each kind.
///
/// # Errors
/// Where it cannot be drawn.
pub(super) fn delays(rows: &[Row]) -> Result<String> {
    let chart = |caption: &str, belongs: &dyn Fn(&str) -> bool| {
        let found = |of: &Examination| {
            let of = of.faults.iter().filter(|(fault, _)| belongs(fault));
            found_by(&of.map(|(_, on)| on).collect::<Vec<_>>())
        };
        let coloured = rows.iter().map(|row| &row.examination).zip(COLOURS);
        Chart {
            caption: caption.to_owned(),
            x: "time since the onset (s)",
            y: "faults found (%)",
            series: coloured
                .map(|(of, colour)| line(of, colour, found(of)))
                .collect(),
            ceiling: Some(100.0),
            ..Chart::default()
        }
    };
    let kinds = rows
        .first()
        .map(|row| row.examination.faults.keys())
        .into_iter()
        .flatten();
    let mut charts = vec![chart("All faults", &|_| true)];
    charts.extend(kinds.map(|kind| chart(kind, &|fault| fault == kind)));
    picture("Faults found", &charts)
}

fn line(of: &Examination, colour: RGBColor, points: Vec<(f64, f64)>) -> Series {
    Series {
        label: of.name.clone(),
        colour,
        stroke: Stroke::Line,
        points,
    }
}

/// Time since the onset, s, and the part of the faults found by then, percent.
fn found_by(faults: &[&OnFault]) -> Vec<(f64, f64)> {
    let all: usize = faults.iter().map(|on| on.faults).sum();
    let found = |by_s: f64| {
        let delays = faults.iter().flat_map(|on| &on.delays_s);
        delays.filter(|delay_s| **delay_s <= by_s).count()
    };
    let steps = (DRAWN_S / STEP_S).round() as u32;
    (0..=steps)
        .map(|k| f64::from(k) * STEP_S)
        .map(|by_s| (by_s, 100.0 * found(by_s) as f64 / all as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_never_found_keeps_the_curve_below_all() {
        let on = |faults, delays_s: &[f64]| OnFault {
            faults,
            delays_s: delays_s.to_vec(),
        };
        let curve = found_by(&[&on(2, &[0.0, 1.0]), &on(2, &[0.5])]);
        let at = |s: f64| curve[(s / STEP_S).round() as usize].1;
        assert_eq!(
            [at(0.0), at(0.5), at(1.0), at(10.0)],
            [25.0, 50.0, 75.0, 75.0]
        );
    }
}
