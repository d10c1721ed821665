//! Errors against protection levels: the Stanford plot.

use std::fmt::Write as _;

use super::sky::Path;

const SIZE: f64 = 360.0;
const LEFT: f64 = 52.0;
const BOTTOM: f64 = 318.0;
const TOP: f64 = 14.0;
const RIGHT: f64 = 336.0;

/// Where the axes begin, m.
const LEAST_M: f64 = 0.1;

/// Errors and the levels stated for them, m.
#[derive(Debug, Clone, Default)]
pub(super) struct Stanford {
    points: Path<2>,
    epochs: u64,
    beyond: u64,
    most_m: f64,
}

impl Stanford {
    /// Takes one epoch's error and level.
    pub(super) fn push(&mut self, error_m: f64, level_m: f64) {
        let error_m = error_m.abs();
        if !(error_m.is_finite() && level_m.is_finite()) {
            return;
        }
        self.points.push([error_m, level_m]);
        self.epochs += 1;
        self.beyond += u64::from(error_m > level_m);
        self.most_m = self.most_m.max(error_m).max(level_m);
    }

    /// The drawing; nothing where no level was stated. `name` is what the axes are of.
    pub(super) fn svg(&self, name: &str) -> Option<String> {
        if self.epochs == 0 {
            return None;
        }
        // Both axes are logarithmic: levels of a poor geometry reach kilometres.
        let decades = (self.most_m.max(1.0).log10().ceil() - LEAST_M.log10()).max(1.0);
        let share = |m: f64| (m.max(LEAST_M) / LEAST_M).log10() / decades;
        let x = |m: f64| LEFT + share(m) * (RIGHT - LEFT);
        let y = |m: f64| BOTTOM - share(m) * (BOTTOM - TOP);
        let mut svg =
            format!("<svg viewBox=\"0 0 {SIZE} {SIZE}\" role=\"img\" class=\"square\">\n");
        for decade in 0..=decades as i32 {
            let m = LEAST_M * 10f64.powi(decade);
            let (tx, ty) = (x(m), y(m));
            let text = if m < 0.99 {
                format!("{m:.1}")
            } else {
                format!("{m:.0}")
            };
            let _ = writeln!(
                svg,
                "<line x1=\"{LEFT}\" y1=\"{ty:.1}\" x2=\"{RIGHT}\" y2=\"{ty:.1}\" class=\"grid\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" class=\"tick\" text-anchor=\"end\">{text}</text>\
                 <text x=\"{tx:.1}\" y=\"{:.1}\" class=\"tick\" text-anchor=\"middle\">{text}</text>",
                LEFT - 6.0,
                ty + 4.0,
                BOTTOM + 15.0
            );
        }
        let _ = writeln!(
            svg,
            "<line x1=\"{LEFT}\" y1=\"{BOTTOM}\" x2=\"{RIGHT}\" y2=\"{TOP}\" class=\"level\"/>"
        );
        for [error_m, level_m] in self.points.points() {
            let (px, py) = (x(*error_m), y(*level_m));
            let _ = writeln!(
                svg,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"1.6\" class=\"dot\"/>"
            );
        }
        let middle = 0.5 * (LEFT + RIGHT);
        let _ = writeln!(
            svg,
            "<text x=\"{middle}\" y=\"{:.1}\" class=\"tick\" text-anchor=\"middle\">{name} error (m): \
             {} epochs, {} beyond the level</text>\
             <text x=\"14\" y=\"{middle}\" class=\"tick\" text-anchor=\"middle\" \
             transform=\"rotate(-90 14 {middle})\">protection level (m)</text>",
            BOTTOM + 34.0,
            self.epochs,
            self.beyond
        );
        Some(svg + "</svg>\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_beyond_their_level_are_counted() {
        let mut plot = Stanford::default();
        assert!(plot.svg("vertical").is_none());
        for (error_m, level_m) in [(1.0, 12.0), (-13.0, 12.0), (f64::NAN, 1.0)] {
            plot.push(error_m, level_m);
        }
        let svg = plot.svg("vertical").unwrap();
        assert!(svg.contains("vertical error (m): 2 epochs, 1 beyond the level"));
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(!svg.contains("NaN"));
    }
}
