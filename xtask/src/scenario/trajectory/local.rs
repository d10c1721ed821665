//! From velocities in local east, north, up to a curve in ECEF.

use anyhow::Result;
use gnss_nav::Geodetic;
use nalgebra::Vector3;

use super::{Motion, Node, Trajectory};

/// Between two nodes, s. With the cubic between them, 10 m/s^3 of jerk moves a position by less
/// than a nanometre.
const STEP_S: f64 = 0.02;
/// Straight motion before the start, so that what arrives with the first sample is defined, s.
const LEAD_S: f64 = 2.0;

/// Integrates `enu_mps` (velocity in east, north, up of the present place, at a time in s) from
/// `start`, over `duration_s`.
///
/// Runge-Kutta of fourth order in ECEF: without an up component the height stays.
pub(super) fn integrate(
    start: &Geodetic,
    duration_s: f64,
    enu_mps: impl Fn(f64) -> Vector3<f64>,
) -> Result<Trajectory> {
    let velocity = |time_s: f64, position: &Vector3<f64>| {
        Geodetic::from_ecef(position).enu_from_ecef().transpose() * enu_mps(time_s)
    };
    let mut position = start.to_ecef();
    let begin = velocity(0.0, &position);
    let mut nodes = vec![Node {
        time_s: -LEAD_S,
        motion: Motion {
            position_ecef_m: position - begin * LEAD_S,
            velocity_ecef_mps: begin,
        },
    }];
    let steps = ((duration_s + LEAD_S) / STEP_S).ceil() as usize;
    for step in 0..=steps {
        let time_s = step as f64 * STEP_S;
        let k1 = velocity(time_s, &position);
        nodes.push(Node {
            time_s,
            motion: Motion {
                position_ecef_m: position,
                velocity_ecef_mps: k1,
            },
        });
        let middle_s = time_s + STEP_S / 2.0;
        let k2 = velocity(middle_s, &(position + k1 * (STEP_S / 2.0)));
        let k3 = velocity(middle_s, &(position + k2 * (STEP_S / 2.0)));
        let k4 = velocity(time_s + STEP_S, &(position + k3 * STEP_S));
        position += (k1 + (k2 + k3) * 2.0 + k4) * (STEP_S / 6.0);
    }
    Trajectory::new(nodes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_motion_keeps_its_height_and_speed() {
        let start = Geodetic::from_degrees(52.0, 10.0, 100.0);
        let curve = integrate(&start, 100.0, |_| Vector3::new(200.0, -100.0, 0.0)).unwrap();
        let (end, v) = (curve.at(100.0), 50_000f64.sqrt());
        // 22 km along the ellipsoid; the integration itself leaves micrometres.
        assert!((Geodetic::from_ecef(&end.position_ecef_m).height_m - 100.0).abs() < 1e-5);
        assert!((end.velocity_ecef_mps.norm() - v).abs() < 1e-9);
        let middle = curve.at(50.013);
        // Coordinates are rounded to a nanometre, the cubic spans 20 ms.
        assert!((middle.velocity_ecef_mps.norm() - v).abs() < 1e-6);
    }
}
