//! Figures 2, 3 and 4.

use anyhow::Result;
use plotters::style::RGBColor;

use super::map::Point;
use super::rays::RAYS;
use super::study::{AMPLITUDE, Study};
use crate::reproduce::chart::{BLUE, Chart, GREEN, ORANGE, RED, Series, Stroke, picture};

/// Phases drawn, degrees.
const PHASES: [(f64, RGBColor); 4] = [(0.0, BLUE), (90.0, GREEN), (135.0, ORANGE), (180.0, RED)];

/// File name and SVG of each.
///
/// # Errors
/// Where one cannot be drawn.
pub fn pictures(study: &Study) -> Result<Vec<(String, String)>> {
    let map = |title: &str, y, value: fn(&Point) -> f64| {
        let chart = Chart {
            caption: format!("Amplitude {AMPLITUDE}, by phase of the reflection"),
            x: "delay (0.01 chip)",
            y,
            series: PHASES.map(|phase| over_delay(study, phase, value)).to_vec(),
            ..Chart::default()
        };
        picture(title, &[chart])
    };
    let error = map("Figure 2: code tracking error", "error (chips)", |p| {
        p.error_chips
    })?;
    let observed = map("Figure 3: the observable T", "T (chips)", |p| {
        p.observed_chips
    })?;
    Ok(vec![
        ("figure2.svg".to_owned(), error),
        ("figure3.svg".to_owned(), observed),
        ("figure4.svg".to_owned(), figure4(study)?),
    ])
}

fn over_delay(study: &Study, (phase, colour): (f64, RGBColor), value: fn(&Point) -> f64) -> Series {
    let of_phase = study
        .map
        .iter()
        .filter(|p| (p.phase_deg - phase).abs() < 1.0);
    Series {
        label: format!("{phase} degrees"),
        colour,
        stroke: Stroke::Line,
        points: of_phase
            .map(|p| (100.0 * p.delay_chips, value(p)))
            .collect(),
    }
}

fn figure4(study: &Study) -> Result<String> {
    let line = |label: &str, colour, value: &dyn Fn(&super::channel::Seen) -> f64| Series {
        label: label.to_owned(),
        colour,
        stroke: Stroke::Line,
        points: study
            .drawn
            .iter()
            .step_by(5)
            .map(|(t, seen)| (*t, value(seen)))
            .collect(),
    };
    let chart = |caption: &str, y, series| Chart {
        caption: caption.to_owned(),
        x: "time (s)",
        y,
        series,
        shaded: RAYS.map(|ray| ray.during_s).to_vec(),
        ..Chart::default()
    };
    let error = vec![line("error", BLUE, &|s| s.late_chips)];
    let means = vec![
        line("Z", BLUE, &|s| s.mean_chips),
        line("UCL", RED, &|s| s.limit_chips),
        line("LCL", RED, &|s| -s.limit_chips),
    ];
    let charts = [
        chart("(a) Code tracking error", "error (chips)", error),
        chart("(b) Control chart", "Z (chips)", means),
    ];
    picture("Figure 4: two reflections, one after the other", &charts)
}
