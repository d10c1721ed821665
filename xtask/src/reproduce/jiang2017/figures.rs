//! Figures 6 and 7: position error in X and Y over time, with and without detection.

use anyhow::Result;
use nalgebra::Vector3;

use super::receivers::Variant;
use super::study::{Case, SETTLING_S, Study};
use crate::reproduce::chart::{BLUE, Chart, GREEN, ORANGE, RED, Series, Stroke, picture};

/// The run that is drawn, by number.
const DRAWN: usize = 0;

/// File name and SVG of both figures, and of all receivers side by side.
///
/// # Errors
/// Where one cannot be drawn.
pub fn pictures(study: &Study) -> Result<Vec<(String, String)>> {
    let mut pictures = Vec::new();
    for case in &study.cases {
        let (figure, number) = (case.blockage.figure, case.blockage.number);
        let title = format!(
            "Figure {figure}: scenario {number}, G{:02} blocked from {} s on",
            case.blockage.prn, case.blockage.begin_s
        );
        let both = [(Variant::Paper, RED), (Variant::PaperExcluding, BLUE)];
        let svg = picture(&title, &axes(case, &both, "with", "without"))?;
        pictures.push((format!("figure{figure}.svg"), svg));
        let with = [
            (Variant::PaperExcluding, BLUE),
            (Variant::Product, ORANGE),
            (Variant::ProductExcluding, GREEN),
        ];
        let title = format!("Scenario {number}: what stays near the truth");
        let svg = picture(&title, &axes(case, &with, "", ""))?;
        pictures.push((format!("scenario{number}.svg"), svg));
    }
    Ok(pictures)
}

/// X and Y, a chart each.
fn axes(
    case: &Case,
    shown: &[(Variant, plotters::style::RGBColor)],
    with: &str,
    without: &str,
) -> Vec<Chart> {
    let chart = |name: &str, value: fn(&Vector3<f64>) -> f64| Chart {
        caption: format!("Position error in {name} (ECEF)"),
        x: "time (s)",
        y: "error (m)",
        series: shown
            .iter()
            .map(|(variant, colour)| Series {
                label: label(*variant, with, without),
                colour: *colour,
                stroke: Stroke::Line,
                points: points(case, *variant, value),
            })
            .collect(),
        marked: vec![case.blockage.begin_s],
        ..Chart::default()
    };
    vec![chart("X", |e| e.x), chart("Y", |e| e.y)]
}

fn label(variant: Variant, with: &str, without: &str) -> String {
    let word = if variant.excludes() { with } else { without };
    if word.is_empty() {
        variant.label().to_owned()
    } else {
        format!("{word} detection")
    }
}

fn points(case: &Case, variant: Variant, value: fn(&Vector3<f64>) -> f64) -> Vec<(f64, f64)> {
    let run = case.runs(variant).nth(DRAWN);
    let errors = run.iter().flat_map(|run| &run.errors);
    let from_s = run.and_then(|run| run.switched_s).unwrap_or(0.0) + SETTLING_S;
    let settled = errors.filter(|(time_s, _)| *time_s >= from_s);
    settled
        .map(|(time_s, error)| (*time_s, value(error)))
        .collect()
}
