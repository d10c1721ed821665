//! Line charts as SVG.

use std::fmt::Write as _;

use super::series::Series;

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 280.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 80.0;
const TOP: f64 = 14.0;
/// Room that the label of a mark takes, and how many rows labels that would meet are spread over.
const MARK_WIDTH: f64 = 90.0;
const MARK_ROW: f64 = 11.0;
const MARK_ROWS: usize = 4;
const BOTTOM: f64 = 40.0;

/// One line of a chart.
pub(super) struct Line<'a> {
    pub(super) label: String,
    pub(super) colour: String,
    pub(super) series: &'a Series,
}

/// Something that happened, as a vertical line.
pub(super) struct Mark {
    pub(super) time_s: f64,
    pub(super) label: String,
}

/// A chart of values over time.
pub(super) struct Chart<'a> {
    pub(super) unit: &'a str,
    pub(super) lines: Vec<Line<'a>>,
    pub(super) marks: &'a [Mark],
    /// Values to draw a dashed line at: thresholds.
    pub(super) levels: &'a [f64],
    /// Whether the vertical axis shows zero.
    pub(super) from_zero: bool,
}

/// Range of both axes.
struct Scale {
    time: [f64; 2],
    value: [f64; 2],
}

impl Scale {
    fn x(&self, time_s: f64) -> f64 {
        let [first, last] = self.time;
        LEFT + (time_s - first) / (last - first) * (WIDTH - LEFT - RIGHT)
    }

    fn y(&self, value: f64) -> f64 {
        let [least, most] = self.value;
        HEIGHT - BOTTOM - (value - least) / (most - least) * (HEIGHT - TOP - BOTTOM)
    }
}

impl Chart<'_> {
    /// The chart, or nothing where no line has a value.
    pub(super) fn svg(&self) -> Option<String> {
        let scale = self.scale()?;
        let mut svg = format!(
            "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" class=\"chart\">\n{}",
            axes(&scale, self.unit)
        );
        for level in self.levels {
            let (y, right) = (scale.y(*level), WIDTH - RIGHT);
            let _ = writeln!(
                svg,
                "<line x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{right}\" y2=\"{y:.1}\" class=\"level\"/>"
            );
        }
        for (k, mark) in self.marks.iter().enumerate() {
            let near =
                |other: &&Mark| (scale.x(other.time_s) - scale.x(mark.time_s)).abs() < MARK_WIDTH;
            let above = self.marks[..k].iter().filter(near).count() % MARK_ROWS;
            svg += &draw_mark(&scale, mark, above);
        }
        for line in &self.lines {
            svg += &draw_line(&scale, line);
        }
        svg += &self.legend(&scale);
        svg += "</svg>\n";
        Some(svg)
    }

    fn scale(&self) -> Option<Scale> {
        let buckets = || self.lines.iter().flat_map(|line| line.series.buckets());
        buckets().next()?;
        let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
        let first_s = least(&mut buckets().map(|b| b.start_s));
        let last_s = most(&mut buckets().map(|b| b.end_s));
        let mut low = least(&mut buckets().map(|b| b.least));
        let mut high = most(&mut buckets().map(|b| b.most));
        if self.from_zero {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        for level in self.levels {
            (low, high) = (low.min(*level), high.max(*level));
        }
        let margin = (0.05 * (high - low)).max(1e-6 + 1e-3 * high.abs());
        if !(self.from_zero && low == 0.0) {
            low -= margin;
        }
        Some(Scale {
            time: [first_s, last_s.max(first_s + 1e-3)],
            value: [low, high + margin],
        })
    }

    /// Labels at the right, in the order of the last values and pushed apart until they fit.
    fn legend(&self, scale: &Scale) -> String {
        const SPACING: f64 = 13.0;
        let mut labels: Vec<(f64, &Line<'_>)> = self
            .lines
            .iter()
            .filter_map(|line| {
                let last = line.series.buckets().last()?;
                Some((scale.y(last.mean()), line))
            })
            .collect();
        labels.sort_by(|a, b| a.0.total_cmp(&b.0));
        let room = HEIGHT - TOP - BOTTOM;
        let step = SPACING.min(room / labels.len().max(1) as f64);
        let mut lowest = TOP + 4.0;
        for (y, _) in &mut labels {
            *y = y.max(lowest);
            lowest = *y + step;
        }
        let mut highest = HEIGHT - BOTTOM + 4.0;
        for (y, _) in labels.iter_mut().rev() {
            *y = y.min(highest);
            highest = *y - step;
        }
        labels.iter().fold(String::new(), |mut svg, (y, line)| {
            let x = WIDTH - RIGHT + 6.0;
            let (y, colour, label) = (y + 4.0, &line.colour, &line.label);
            let _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{colour}\" class=\"label\">{label}</text>"
            );
            svg
        })
    }
}

fn draw_line(scale: &Scale, line: &Line<'_>) -> String {
    let mut svg = String::new();
    for stretch in stretches(line.series) {
        let colour = &line.colour;
        let spread = stretch.iter().any(|b| b.most > b.least);
        if spread {
            let above = stretch.iter().map(|b| (b.middle_s(), b.most));
            let below = stretch.iter().rev().map(|b| (b.middle_s(), b.least));
            let points = points(scale, above.chain(below));
            let _ = writeln!(
                svg,
                "<polygon points=\"{points}\" fill=\"{colour}\" opacity=\"0.16\"/>"
            );
        }
        if let [only] = stretch {
            let (x, y) = (scale.x(only.middle_s()), scale.y(only.mean()));
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{colour}\"/>"
            );
            continue;
        }
        let points = points(scale, stretch.iter().map(|b| (b.middle_s(), b.mean())));
        let _ = writeln!(
            svg,
            "<polyline points=\"{points}\" stroke=\"{colour}\" class=\"line\"/>"
        );
    }
    svg
}

/// The parts of a series between gaps of more than a few times its usual step.
fn stretches(series: &Series) -> Vec<&[super::series::Bucket]> {
    let buckets = series.buckets();
    let mut steps: Vec<f64> = buckets
        .windows(2)
        .map(|w| w[1].start_s - w[0].start_s)
        .collect();
    steps.sort_unstable_by(f64::total_cmp);
    let usual_s = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    buckets
        .chunk_by(|a, b| b.start_s - a.end_s <= 3.0 * usual_s)
        .collect()
}

fn points(scale: &Scale, values: impl Iterator<Item = (f64, f64)>) -> String {
    values.fold(String::new(), |mut text, (time_s, value)| {
        let _ = write!(text, "{:.1},{:.1} ", scale.x(time_s), scale.y(value));
        text
    })
}

/// A mark whose label stands `row` rows below the top.
fn draw_mark(scale: &Scale, mark: &Mark, row: usize) -> String {
    let x = scale.x(mark.time_s);
    if !(LEFT..=WIDTH - RIGHT).contains(&x) {
        return String::new();
    }
    let (bottom, label) = (HEIGHT - BOTTOM, &mark.label);
    format!(
        "<line x1=\"{x:.1}\" y1=\"{TOP}\" x2=\"{x:.1}\" y2=\"{bottom}\" class=\"mark\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" class=\"marktext\">{label}</text>\n",
        x + 3.0,
        TOP + 9.0 + MARK_ROW * row as f64
    )
}

fn axes(scale: &Scale, unit: &str) -> String {
    let mut svg = String::new();
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    for value in ticks(scale.value, 5) {
        let (y, text) = (scale.y(value), tick_text(value, scale.value));
        let _ = writeln!(
            svg,
            "<line x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{right}\" y2=\"{y:.1}\" class=\"grid\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" class=\"tick\" text-anchor=\"end\">{text}</text>",
            LEFT - 7.0,
            y + 4.0
        );
    }
    for time_s in ticks(scale.time, 8) {
        let (x, text) = (scale.x(time_s), tick_text(time_s, scale.time));
        let _ = writeln!(
            svg,
            "<line x1=\"{x:.1}\" y1=\"{bottom}\" x2=\"{x:.1}\" y2=\"{:.1}\" class=\"axis\"/>\
             <text x=\"{x:.1}\" y=\"{:.1}\" class=\"tick\" text-anchor=\"middle\">{text}</text>",
            bottom + 4.0,
            bottom + 17.0
        );
    }
    let _ = writeln!(
        svg,
        "<line x1=\"{LEFT}\" y1=\"{bottom}\" x2=\"{right}\" y2=\"{bottom}\" class=\"axis\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" class=\"tick\" text-anchor=\"middle\">time (s)</text>\
         <text x=\"14\" y=\"{:.1}\" class=\"tick\" text-anchor=\"middle\" \
         transform=\"rotate(-90 14 {:.1})\">{unit}</text>",
        0.5 * (LEFT + right),
        bottom + 33.0,
        0.5 * (TOP + bottom),
        0.5 * (TOP + bottom)
    );
    svg
}

/// About `count` round values within `range`.
pub(super) fn ticks(range: [f64; 2], count: u32) -> Vec<f64> {
    let [low, high] = range;
    let step = round_step((high - low) / f64::from(count));
    let first = (low / step).ceil();
    let last = (high / step).floor();
    // Both are small whole numbers times a round step; the cast cannot overflow for such a range.
    (0..=(last - first).clamp(0.0, 50.0) as u32)
        .map(|i| (first + f64::from(i)) * step)
        .collect()
}

/// The next of 1, 2 or 5 times a power of ten.
pub(super) fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.max(1e-12).log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|factor| factor * power >= least * 0.999)
        .unwrap_or(10.0);
    factor * power
}

/// `value` with as many decimals as the steps between ticks need.
fn tick_text(value: f64, [low, high]: [f64; 2]) -> String {
    let digits = -((high - low) / 8.0).max(1e-9).log10().floor();
    let decimals = digits.clamp(0.0, 9.0) as usize;
    format!("{:.decimals$}", value + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([0.3, 9.9], 5), [2.0, 4.0, 6.0, 8.0]);
        assert_eq!(ticks([-1.0, 1.0], 4), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(round_step(0.3), 0.5);
        assert!(ticks([f64::NAN, 1.0], 4).len() <= 51);
    }

    #[test]
    fn a_gap_interrupts_the_line_and_an_empty_chart_is_none() {
        let mut series = Series::default();
        for time_s in [0.0, 1.0, 2.0, 3.0, 20.0, 21.0] {
            series.push(time_s, 1.0);
        }
        assert_eq!(stretches(&series).len(), 2);
        let chart = |series| Chart {
            unit: "m",
            lines: vec![Line {
                label: "G07".to_owned(),
                colour: "red".to_owned(),
                series,
            }],
            marks: &[],
            levels: &[2.0],
            from_zero: true,
        };
        let svg = chart(&series).svg().unwrap();
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(chart(&Series::default()).svg().is_none());
    }
}
