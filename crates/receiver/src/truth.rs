//! Truth of a run, and the errors of its solutions. For judging afterwards only: the pipeline
//! never sees it.

use std::path::Path;

use gnss_nav::geodesy::Geodetic;
use nalgebra::Vector3;

use crate::ReceiverError;
use crate::csv::{Table, content};
use crate::sink::rounded;
use crate::summary::{ErrorStatistics, VelocityError};

/// Positions and velocities of a receiver over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    points: Vec<TruthPoint>,
}

/// Position and velocity of a receiver at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruthPoint {
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Position, ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// Velocity, ECEF, m/s.
    pub velocity_ecef_mps: Vector3<f64>,
}

const COLUMNS: [&str; 7] = ["time_s", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"];

impl Truth {
    /// Reads `time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps`; a single row means a static receiver.
    ///
    /// # Errors
    /// [`ReceiverError::File`], or [`ReceiverError::Content`] naming the line.
    pub fn read(path: &Path) -> Result<Self, ReceiverError> {
        let table = Table::open(path, &COLUMNS)?;
        let mut points: Vec<TruthPoint> = Vec::new();
        for row in table {
            let row = row?;
            let point = TruthPoint {
                time_s: row.number(0)?,
                position_ecef_m: Vector3::new(row.number(1)?, row.number(2)?, row.number(3)?),
                velocity_ecef_mps: Vector3::new(row.number(4)?, row.number(5)?, row.number(6)?),
            };
            if points
                .last()
                .is_some_and(|last| last.time_s >= point.time_s)
            {
                return Err(row.error("time_s does not increase"));
            }
            points.push(point);
        }
        if points.is_empty() {
            return Err(content(
                path,
                "no row: expected at least one position".to_owned(),
            ));
        }
        Ok(Self { points })
    }

    /// Position and velocity at `time_s`: between two rows the cubic that fits both positions and
    /// velocities; nothing outside the rows, except that a single row holds always.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<TruthPoint> {
        if let [only] = self.points[..] {
            return Some(TruthPoint { time_s, ..only });
        }
        // A hair of tolerance, so that the rounding of printed times loses no epoch at the ends.
        const ROUNDING_S: f64 = 1e-6;
        let (first, last) = (self.points.first()?, self.points.last()?);
        if !(first.time_s - ROUNDING_S..=last.time_s + ROUNDING_S).contains(&time_s) {
            return None;
        }
        let after = self.points.partition_point(|p| p.time_s <= time_s);
        let after = after.clamp(1, self.points.len() - 1);
        Some(hermite(
            &self.points[after - 1],
            &self.points[after],
            time_s,
        ))
    }
}

/// Cubic Hermite interpolation of position, linear of velocity.
fn hermite(a: &TruthPoint, b: &TruthPoint, time_s: f64) -> TruthPoint {
    let span_s = b.time_s - a.time_s;
    let u = (time_s - a.time_s) / span_s;
    let (u2, u3) = (u * u, u * u * u);
    TruthPoint {
        time_s,
        position_ecef_m: a.position_ecef_m
            + (b.position_ecef_m - a.position_ecef_m) * (3.0 * u2 - 2.0 * u3)
            + a.velocity_ecef_mps * (span_s * (u3 - 2.0 * u2 + u))
            + b.velocity_ecef_mps * (span_s * (u3 - u2)),
        velocity_ecef_mps: a.velocity_ecef_mps + (b.velocity_ecef_mps - a.velocity_ecef_mps) * u,
    }
}

/// Error of one solution against the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolutionError {
    /// Seconds since the first sample received.
    pub time_s: f64,
    /// Position error east, north, up, m.
    pub position_enu_m: Vector3<f64>,
    /// Velocity error east, north, up, m/s, where there is a velocity.
    pub velocity_enu_mps: Option<Vector3<f64>>,
    /// Horizontal and vertical protection level stated, m.
    pub protection_m: Option<[f64; 2]>,
}

/// When a run received which signal, for counting the epochs that were due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunSpan {
    /// Offset of the first sample received from the first sample of the recording, s.
    pub start_s: f64,
    /// Signal received, s.
    pub signal_s: f64,
    /// Navigation epochs per second.
    pub rate_hz: f64,
}

/// Compares every solution in the `pvt.csv` at `pvt` with `truth`, giving each error to `visit`.
/// Solutions with status `unreliable` count as no solution.
///
/// # Errors
/// Where the file cannot be read, or none of its solutions lies within the truth.
pub fn compare(
    pvt: &Path,
    truth: &Truth,
    span: &RunSpan,
    mut visit: impl FnMut(&SolutionError),
) -> Result<Option<ErrorStatistics>, ReceiverError> {
    let names = [
        "time_s", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "status", "hpl_m", "vpl_m",
    ];
    let mut statistics = Accumulator::default();
    for row in Table::open(pvt, &names)? {
        let row = row?;
        let time_s = row.number(0)?;
        statistics.first_s.get_or_insert(time_s);
        statistics.rows += 1;
        let (Some(true_point), false) =
            (truth.at(time_s + span.start_s), row.text(7) == "unreliable")
        else {
            continue;
        };
        let position = Vector3::new(row.number(1)?, row.number(2)?, row.number(3)?);
        let velocity = if row.text(4).is_empty() {
            None
        } else {
            Some(Vector3::new(row.number(4)?, row.number(5)?, row.number(6)?))
        };
        let place = Geodetic::from_ecef(&true_point.position_ecef_m);
        let enu = place.enu_from_ecef();
        let error = SolutionError {
            time_s,
            position_enu_m: enu * (position - true_point.position_ecef_m),
            velocity_enu_mps: velocity.map(|v| enu * (v - true_point.velocity_ecef_mps)),
            protection_m: if row.text(8).is_empty() || row.text(9).is_empty() {
                None
            } else {
                Some([row.number(8)?, row.number(9)?])
            },
        };
        statistics.add(&error);
        visit(&error);
    }
    if statistics.rows > 0 && statistics.horizontal_m.is_empty() {
        return Err(content(
            pvt,
            "no reliable solution lies within the times of the truth".to_owned(),
        ));
    }
    Ok(statistics.finish(span))
}

#[derive(Default)]
struct Accumulator {
    first_s: Option<f64>,
    rows: u64,
    horizontal_m: Vec<f32>,
    horizontal_squares_m2: f64,
    vertical_squares_m2: f64,
    largest_3d_m: f64,
    velocities: u64,
    velocity_squares: Vector3<f64>,
}

impl Accumulator {
    fn add(&mut self, error: &SolutionError) {
        let p = &error.position_enu_m;
        let horizontal_m = p.x.hypot(p.y);
        self.horizontal_m.push(horizontal_m as f32);
        self.horizontal_squares_m2 += horizontal_m * horizontal_m;
        self.vertical_squares_m2 += p.z * p.z;
        self.largest_3d_m = self.largest_3d_m.max(p.norm());
        if let Some(v) = &error.velocity_enu_mps {
            self.velocities += 1;
            self.velocity_squares += v.component_mul(v);
        }
    }

    fn finish(mut self, span: &RunSpan) -> Option<ErrorStatistics> {
        let n = self.horizontal_m.len() as f64;
        let first_s = self.first_s?;
        self.horizontal_m.sort_unstable_by(f32::total_cmp);
        let rank = ((0.95 * n).ceil() as usize).clamp(1, self.horizontal_m.len());
        let rms = |sum: f64| rounded((sum / n).sqrt(), 4);
        let velocity_rms = |sum: f64| rounded((sum / self.velocities as f64).sqrt(), 4);
        // Epochs stand on a grid; half a millisecond absorbs that a clock correction may move them.
        let due = (((span.signal_s - first_s) * span.rate_hz + 5e-4).floor() + 1.0).max(n);
        Some(ErrorStatistics {
            availability: rounded(n / due, 6),
            horizontal_rms_m: rms(self.horizontal_squares_m2),
            horizontal_p95_m: rounded(f64::from(self.horizontal_m[rank - 1]), 4),
            horizontal_max_m: rounded(f64::from(*self.horizontal_m.last()?), 4),
            vertical_rms_m: rms(self.vertical_squares_m2),
            position_3d_max_m: rounded(self.largest_3d_m, 4),
            velocity_rms_mps: (self.velocities > 0).then(|| VelocityError {
                east: velocity_rms(self.velocity_squares.x),
                north: velocity_rms(self.velocity_squares.y),
                up: velocity_rms(self.velocity_squares.z),
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Record, Status};
    use crate::sink::EventSink;
    use crate::sink::pvt::PvtCsv;
    use crate::sink::sample_records::{place, pvt};

    fn truth(text: &str) -> Result<Truth, ReceiverError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.csv");
        std::fs::write(&path, format!("{}\n{text}", COLUMNS.join(","))).unwrap();
        Truth::read(&path)
    }

    #[test]
    fn a_curved_path_is_interpolated_through_positions_and_velocities() {
        // x = t^3 is a cubic, so the interpolation is exact up to rounding.
        let truth = truth("0,0,0,0,0,0,0\n2,8,0,0,12,0,0\n4,64,0,0,48,0,0").unwrap();
        let x = truth.at(3.0).unwrap().position_ecef_m.x;
        assert!((x - 27.0).abs() < 1e-12, "{x}");
        assert!(truth.at(4.1).is_none() && truth.at(-0.1).is_none());
        assert!(truth.at(4.000_000_5).is_some());
    }

    #[test]
    fn one_row_is_a_static_receiver() {
        let truth = truth("0,1,2,3,0,0,0").unwrap();
        assert_eq!(truth.at(1e6).unwrap().position_ecef_m.z, 3.0);
    }

    #[test]
    fn damage_is_named_by_line() {
        let message = truth("0,1,2,x,0,0,0").unwrap_err().to_string();
        assert!(
            message.ends_with("line 2: z_m is 'x': expected a number"),
            "{message}"
        );
        let message = truth("1,0,0,0,0,0,0\n1,0,0,0,0,0,0")
            .unwrap_err()
            .to_string();
        assert!(
            message.ends_with("line 3: time_s does not increase"),
            "{message}"
        );
        assert!(truth("").unwrap_err().to_string().contains("no row"));
        let message = truth(&"0".repeat(1 << 20)).unwrap_err().to_string();
        assert!(message.contains("line 2 is longer than"), "{message}");
    }

    #[test]
    fn errors_are_measured_in_the_local_frame() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = PvtCsv::create(folder.path()).unwrap();
        let enu = place().enu_from_ecef();
        for (i, offset) in [[3.0, 4.0, 0.0], [0.0, 0.0, 2.0], [3.0, 4.0, 0.0]]
            .iter()
            .enumerate()
        {
            let mut solution = pvt(0.1 * i as f64);
            solution.position_ecef_m += enu.transpose() * Vector3::from(*offset);
            if let Some(velocity) = &mut solution.velocity {
                velocity.ecef_mps = enu.transpose() * Vector3::new(0.1, 0.0, 0.0);
            }
            if i == 2 {
                solution.status = Status::Unreliable;
            }
            sink.record(&Record::Pvt(solution)).unwrap();
        }
        sink.finish().unwrap();
        let true_m = place().to_ecef();
        let truth = truth(&format!("0,{},{},{},0,0,0", true_m.x, true_m.y, true_m.z)).unwrap();
        let span = RunSpan {
            start_s: 0.0,
            signal_s: 0.3,
            rate_hz: 10.0,
        };
        let mut visited = 0;
        let path = folder.path().join("pvt.csv");
        let errors = compare(&path, &truth, &span, |_| visited += 1)
            .unwrap()
            .unwrap();
        assert_eq!(visited, 2);
        // Epochs due: 0.0, 0.1, 0.2 and 0.3; positions are printed to 0.1 mm.
        assert_eq!(errors.availability, 0.5);
        assert!(
            (errors.horizontal_rms_m - (12.5f64).sqrt()).abs() < 3e-4,
            "{errors:?}"
        );
        assert!((errors.horizontal_p95_m - 5.0).abs() < 3e-4);
        assert!((errors.vertical_rms_m - (2.0f64).sqrt()).abs() < 3e-4);
        assert!((errors.velocity_rms_mps.unwrap().east - 0.1).abs() < 1e-4);
    }
}
