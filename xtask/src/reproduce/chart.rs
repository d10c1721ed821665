//! Charts of several lines over time, one above the other.

use anyhow::{Result, anyhow};
use plotters::prelude::*;

/// Width of a picture and height of one of its charts, px.
const WIDTH: u32 = 900;
const HEIGHT: u32 = 340;
/// Height of the title, px.
const TITLE: u32 = 34;

/// Black: what is given.
pub const BLACK: RGBColor = RGBColor(0, 0, 0);
/// Red: what fails, or is compared against.
pub const RED: RGBColor = RGBColor(200, 30, 30);
/// Blue: what is proposed.
pub const BLUE: RGBColor = RGBColor(30, 90, 180);
/// Green: a third.
pub const GREEN: RGBColor = RGBColor(30, 130, 60);
/// Orange: a fourth.
pub const ORANGE: RGBColor = RGBColor(220, 130, 0);

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Joined.
    Line,
    /// Each by itself: what lies between is not known.
    Dots,
}

/// Points of one name and colour.
#[derive(Debug, Clone)]
pub struct Series {
    /// What people read.
    pub label: String,
    /// Colour.
    pub colour: RGBColor,
    /// Whether they are joined.
    pub stroke: Stroke,
    /// Points, in the order in which they are joined.
    pub points: Vec<(f64, f64)>,
}

/// How far a value may be off, across its point.
#[derive(Debug, Clone, Copy)]
pub struct Bar {
    /// Where it stands.
    pub x: f64,
    /// Its lower and its upper end.
    pub ends: (f64, f64),
    /// Colour.
    pub colour: RGBColor,
}

/// One chart.
#[derive(Debug, Clone, Default)]
pub struct Chart {
    /// Above it.
    pub caption: String,
    /// Along it, with the unit.
    pub x: &'static str,
    /// Beside it, with the unit.
    pub y: &'static str,
    /// What it shows.
    pub series: Vec<Series>,
    /// Lines across at which something happens, by x.
    pub marked: Vec<f64>,
    /// Stretches of x over which something lasts, first and last.
    pub shaded: Vec<(f64, f64)>,
    /// How far values may be off.
    pub bars: Vec<Bar>,
    /// The largest value there can be: the axis ends with it, and names stand in the lower right corner.
    pub ceiling: Option<f64>,
}

/// What drawing returns.
pub(super) type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;
/// A part of a picture.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// A chart of numbers over numbers.
pub(super) type Drawing<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// An SVG of `charts` under one title.
///
/// # Errors
/// Where it cannot be drawn.
pub fn picture(title: &str, charts: &[Chart]) -> Result<String> {
    draw(title, charts).map_err(|e| anyhow!("{title}: {e}"))
}

fn draw(title: &str, charts: &[Chart]) -> Drawn<String> {
    let mut svg = String::new();
    {
        let height = TITLE + HEIGHT * charts.len() as u32;
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        let below = root.titled(title, ("sans-serif", 20))?;
        for (area, chart) in below.split_evenly((charts.len(), 1)).iter().zip(charts) {
            draw_chart(area, chart)?;
        }
        root.present()?;
    }
    Ok(svg)
}

fn draw_chart(area: &Area<'_>, chart: &Chart) -> Drawn<()> {
    let points = || chart.series.iter().flat_map(|s| &s.points);
    let bars = chart.bars.iter().flat_map(|bar| [bar.ends.0, bar.ends.1]);
    let (x, y) = (
        range(points().map(|p| p.0)),
        range(points().map(|p| p.1).chain(bars)),
    );
    // The names of the series stand above the lines.
    let span = y.1 - y.0;
    let end = chart.ceiling.unwrap_or(y.1 + 0.35 * span);
    let across = (y.0 - 0.06 * span)..end;
    let mut drawing = ChartBuilder::on(area)
        .caption(&chart.caption, ("sans-serif", 15))
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(x.0..x.1, across.clone())?;
    let digits = digits(span);
    drawing
        .configure_mesh()
        .x_desc(chart.x)
        .y_desc(chart.y)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| without_sign_of_zero(format!("{y:.digits$}")))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    let stretches = chart.shaded.iter().map(|(from, to)| {
        let corners = [(*from, across.start), (*to, across.end)];
        Rectangle::new(corners, BLACK.mix(0.1).filled())
    });
    drawing.draw_series(stretches)?;
    for at in &chart.marked {
        let ends = [(*at, across.start), (*at, across.end)];
        drawing.draw_series(DashedLineSeries::new(ends, 6, 4, BLACK.stroke_width(1)))?;
    }
    for series in &chart.series {
        draw_series(&mut drawing, series)?;
    }
    for bar in &chart.bars {
        draw_bar(&mut drawing, bar, 0.004 * (x.1 - x.0))?;
    }
    let corner = match chart.ceiling {
        Some(_) => SeriesLabelPosition::LowerRight,
        None => SeriesLabelPosition::UpperLeft,
    };
    legend(&mut drawing, corner)
}

/// `bar` with a cross-line, `half` as far to each side, at its ends.
fn draw_bar(drawing: &mut Drawing<'_, '_>, bar: &Bar, half: f64) -> Drawn<()> {
    let (low, high) = bar.ends;
    let across = |y| vec![(bar.x - half, y), (bar.x + half, y)];
    let lines = [vec![(bar.x, low), (bar.x, high)], across(low), across(high)];
    drawing.draw_series(lines.map(|line| PathElement::new(line, bar.colour)))?;
    Ok(())
}

fn draw_series(drawing: &mut Drawing<'_, '_>, series: &Series) -> Drawn<()> {
    let colour = series.colour;
    let points = series.points.iter().copied();
    let drawn = match series.stroke {
        Stroke::Line => drawing.draw_series(LineSeries::new(points, colour.stroke_width(1)))?,
        Stroke::Dots => {
            drawing.draw_series(points.map(|at| Circle::new(at, 2, colour.filled())))?
        }
    };
    drawn
        .label(&series.label)
        .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
    Ok(())
}

/// The names of the series in a corner.
pub(super) fn legend<'a, 'b: 'a>(
    drawing: &mut Drawing<'a, 'b>,
    corner: SeriesLabelPosition,
) -> Drawn<()> {
    drawing
        .configure_series_labels()
        .position(corner)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.2))
        .label_font(("sans-serif", 13))
        .draw()?;
    Ok(())
}

/// Lowest and highest, never the same.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    if low < high {
        (low, high)
    } else if low == high {
        (low - 1.0, high + 1.0)
    } else {
        (0.0, 1.0)
    }
}

/// Decimals that tell the labels of a `span` apart.
fn digits(span: f64) -> usize {
    (1.0 - span.log10().floor()).clamp(0.0, 4.0) as usize
}

/// The text of a number, where it is zero without a minus sign that rounding left.
fn without_sign_of_zero(text: String) -> String {
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| c == '0' || c == '.') => zero.to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_names_what_it_shows() {
        let chart = Chart {
            caption: "Error".to_owned(),
            x: "time (s)",
            y: "error (m)",
            series: vec![Series {
                label: "ours".to_owned(),
                colour: BLUE,
                stroke: Stroke::Line,
                points: vec![(0.0, 1.0), (1.0, 3.0)],
            }],
            marked: vec![0.5],
            shaded: vec![(0.2, 0.4)],
            ..Chart::default()
        };
        let dots = |series: &Series| Series {
            stroke: Stroke::Dots,
            ..series.clone()
        };
        let dotted = Chart {
            series: chart.series.iter().map(dots).collect(),
            ..chart.clone()
        };
        let svg = picture("Figure 1", &[chart, dotted]).unwrap();
        assert_eq!(svg.matches("<circle").count(), 2);
        for text in ["Figure 1", "Error", "time (s)", "error (m)", "ours"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn no_axis_goes_beyond_what_can_be_and_bars_stand_on_their_points() {
        let chart = |bars| Chart {
            series: vec![Series {
                label: "part".to_owned(),
                colour: BLUE,
                stroke: Stroke::Line,
                points: vec![(0.0, 80.0), (1.0, 99.0)],
            }],
            bars,
            ceiling: Some(100.0),
            ..Chart::default()
        };
        let bar = Bar {
            x: 0.0,
            ends: (70.0, 90.0),
            colour: BLUE,
        };
        let plain = picture("Figure 1", &[chart(Vec::new())]).unwrap();
        let barred = picture("Figure 1", &[chart(vec![bar])]).unwrap();
        for svg in [&plain, &barred] {
            assert!(svg.contains("\n100\n") && !svg.contains("\n102\n"), "{svg}");
        }
        let blue = |svg: &str| svg.matches("#1E5AB4").count();
        assert_eq!(blue(&barred) - blue(&plain), 3);
        // The axis begins below the bar.
        assert!(barred.contains("\n70\n") && !plain.contains("\n70\n"));
    }

    #[test]
    fn zero_has_no_sign() {
        let labels = ["-0.00", "0.00", "-0.01"].map(|t| without_sign_of_zero(t.to_owned()));
        assert_eq!(labels, ["0.00", "0.00", "-0.01"]);
    }

    #[test]
    fn labels_tell_ticks_apart_and_ranges_are_never_empty() {
        assert_eq!([digits(250.0), digits(2.0), digits(0.03)], [0, 1, 3]);
        assert_eq!(range([2.0].into_iter()), (1.0, 3.0));
        assert_eq!(range(std::iter::empty()), (0.0, 1.0));
        assert_eq!(range([3.0, -1.0].into_iter()), (-1.0, 3.0));
    }
}
