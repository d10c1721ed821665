//! Drawings on a plane: the sky above the receiver, and the track on the ground.

use std::fmt::Write as _;

use super::chart::round_step;

const SIZE: f64 = 360.0;
const CENTRE: f64 = SIZE / 2.0;
const RADIUS: f64 = 150.0;

/// Points kept in bounded memory by keeping every second one whenever there are too many.
#[derive(Debug, Clone)]
pub(super) struct Path<const N: usize> {
    points: Vec<[f64; N]>,
    keep_every: u64,
    seen: u64,
    last: Option<[f64; N]>,
}

const MOST_POINTS: usize = 500;

impl<const N: usize> Default for Path<N> {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            keep_every: 1,
            seen: 0,
            last: None,
        }
    }
}

impl<const N: usize> Path<N> {
    pub(super) fn push(&mut self, point: [f64; N]) {
        if self.seen.is_multiple_of(self.keep_every) {
            self.points.push(point);
        }
        self.seen += 1;
        self.last = Some(point);
        if self.points.len() > MOST_POINTS {
            let mut index = 0;
            self.points.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.keep_every *= 2;
        }
    }

    pub(super) fn last(&self) -> Option<[f64; N]> {
        self.last
    }

    /// The points kept, and the last one in any case.
    pub(super) fn points(&self) -> impl Iterator<Item = &[f64; N]> + Clone {
        let end = self
            .last
            .as_ref()
            .filter(|last| self.points.last() != Some(*last));
        self.points.iter().chain(end)
    }
}

/// A satellite's way over the sky: azimuth and elevation, rad.
pub(super) struct SkyTrack<'a> {
    pub(super) label: String,
    pub(super) colour: String,
    pub(super) path: &'a Path<2>,
}

/// The sky as seen from below a glass ceiling: north up, east right, the zenith in the middle.
pub(super) fn sky_plot(tracks: &[SkyTrack<'_>]) -> String {
    let mut svg = format!("<svg viewBox=\"0 0 {SIZE} {SIZE}\" role=\"img\" class=\"square\">\n");
    for elevation_deg in [0.0f64, 30.0, 60.0] {
        let radius = RADIUS * (90.0 - elevation_deg) / 90.0;
        let _ = writeln!(
            svg,
            "<circle cx=\"{CENTRE}\" cy=\"{CENTRE}\" r=\"{radius:.1}\" class=\"ring\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" class=\"tick\">{elevation_deg}°</text>",
            CENTRE + 3.0,
            CENTRE - radius + 12.0
        );
    }
    for (name, x, y) in [
        ("N", CENTRE, CENTRE - RADIUS - 8.0),
        ("E", CENTRE + RADIUS + 12.0, CENTRE + 4.0),
        ("S", CENTRE, CENTRE + RADIUS + 18.0),
        ("W", CENTRE - RADIUS - 12.0, CENTRE + 4.0),
    ] {
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"label\" text-anchor=\"middle\">{name}</text>"
        );
    }
    let _ = writeln!(
        svg,
        "<line x1=\"{0}\" y1=\"{CENTRE}\" x2=\"{1}\" y2=\"{CENTRE}\" class=\"grid\"/>\
         <line x1=\"{CENTRE}\" y1=\"{0}\" x2=\"{CENTRE}\" y2=\"{1}\" class=\"grid\"/>",
        CENTRE - RADIUS,
        CENTRE + RADIUS
    );
    for track in tracks {
        svg += &draw_sky_track(track);
    }
    svg + "</svg>\n"
}

fn draw_sky_track(track: &SkyTrack<'_>) -> String {
    let place = |[azimuth_rad, elevation_rad]: [f64; 2]| {
        let radius = RADIUS * (1.0 - elevation_rad.max(-0.1) / std::f64::consts::FRAC_PI_2);
        let (sine, cosine) = azimuth_rad.sin_cos();
        (CENTRE + radius * sine, CENTRE - radius * cosine)
    };
    let Some((x, y)) = track.path.last().map(place) else {
        return String::new();
    };
    let mut points = String::new();
    for point in track.path.points() {
        let (x, y) = place(*point);
        let _ = write!(points, "{x:.1},{y:.1} ");
    }
    let (colour, label) = (&track.colour, &track.label);
    format!(
        "<polyline points=\"{points}\" stroke=\"{colour}\" class=\"line\"/>\
         <circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"12\" fill=\"{colour}\"/>\
         <text x=\"{x:.1}\" y=\"{:.1}\" class=\"badge\" text-anchor=\"middle\">{label}</text>\n",
        y + 3.5
    )
}

/// Positions east and north of the first one, m, on equal scales.
pub(super) fn ground_plot(path: &Path<2>) -> Option<String> {
    path.last()?;
    let bounds = |axis: usize| {
        let fold = |(low, high): (f64, f64), p: &[f64; 2]| (low.min(p[axis]), high.max(p[axis]));
        path.points().fold((f64::INFINITY, f64::NEG_INFINITY), fold)
    };
    let ((west, east), (south, north)) = (bounds(0), bounds(1));
    let span = (east - west).max(north - south).max(1.0);
    let (middle_e, middle_n) = (0.5 * (east + west), 0.5 * (north + south));
    let scale = 2.0 * RADIUS * 0.94 / span;
    let place = |[e, n]: [f64; 2]| {
        (
            CENTRE + (e - middle_e) * scale,
            CENTRE - (n - middle_n) * scale,
        )
    };
    let mut svg = format!("<svg viewBox=\"0 0 {SIZE} {SIZE}\" role=\"img\" class=\"square\">\n");
    let _ = writeln!(
        svg,
        "<rect x=\"{0}\" y=\"{0}\" width=\"{1}\" height=\"{1}\" class=\"ring\"/>",
        CENTRE - RADIUS,
        2.0 * RADIUS
    );
    let mut points = String::new();
    for point in path.points() {
        let (x, y) = place(*point);
        let _ = write!(points, "{x:.1},{y:.1} ");
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.6\" class=\"dot\"/>"
        );
    }
    let _ = writeln!(svg, "<polyline points=\"{points}\" class=\"faint\"/>");
    let bar_m = round_step(span / 5.0);
    let (left, y) = (CENTRE - RADIUS + 10.0, CENTRE + RADIUS - 12.0);
    let _ = writeln!(
        svg,
        "<line x1=\"{left}\" y1=\"{y}\" x2=\"{:.1}\" y2=\"{y}\" class=\"axis\"/>\
         <text x=\"{left}\" y=\"{:.1}\" class=\"tick\">{bar_m} m</text>\
         <text x=\"{CENTRE}\" y=\"{:.1}\" class=\"label\" text-anchor=\"middle\">north</text>\
         <text x=\"{:.1}\" y=\"{CENTRE}\" class=\"label\">east</text>",
        left + bar_m * scale,
        y - 5.0,
        CENTRE - RADIUS - 6.0,
        CENTRE + RADIUS + 2.0,
    );
    Some(svg + "</svg>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_bounded_and_ends_where_it_ended() {
        let mut path = Path::default();
        for i in 0..10_000 {
            path.push([f64::from(i)]);
        }
        let points: Vec<_> = path.points().collect();
        assert!(points.len() <= MOST_POINTS + 1);
        assert_eq!((points[0], points[points.len() - 1]), (&[0.0], &[9999.0]));
    }

    fn drawn(path: &Path<2>) -> String {
        draw_sky_track(&SkyTrack {
            label: "7".to_owned(),
            colour: "red".to_owned(),
            path,
        })
    }

    #[test]
    fn east_is_right_and_the_zenith_in_the_middle() {
        let mut path = Path::default();
        path.push([std::f64::consts::FRAC_PI_2, 0.0]);
        assert!(drawn(&path).contains("cx=\"330.0\" cy=\"180.0\""));
        path.push([1.0, std::f64::consts::FRAC_PI_2]);
        assert!(drawn(&path).contains("cx=\"180.0\" cy=\"180.0\""));
    }

    #[test]
    fn a_single_position_is_drawn() {
        let mut path = Path::default();
        assert!(ground_plot(&path).is_none());
        path.push([0.0, 0.0]);
        assert!(!ground_plot(&path).unwrap().contains("NaN"));
    }
}
