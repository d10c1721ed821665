//! Errors of the drawn run, epoch by epoch, as CSV.

use std::fmt::Write as _;

use super::receivers::Part;
use super::study::Study;

/// Errors of every receiver of the table on the first seed's signal: ECEF, m and m/s.
#[must_use]
pub fn csv(study: &Study) -> String {
    let mut text = String::from(
        "receiver,time_s,error_x_m,error_y_m,error_z_m,error_vx_mps,error_vy_mps,error_vz_mps,satellites_used,status\n",
    );
    let runs = study.runs.first().into_iter().flatten();
    for (receiver, judged) in study.receivers.iter().zip(runs) {
        if receiver.part != Part::Table {
            continue;
        }
        for epoch in &judged.epochs {
            let (r, v) = (epoch.position_ecef_m(), epoch.velocity_ecef_mps());
            let pvt = &epoch.pvt;
            let _ = writeln!(
                text,
                "{},{:.2},{:.4},{:.4},{:.4},{:.5},{:.5},{:.5},{},{}",
                receiver.key,
                pvt.time_s,
                r.x,
                r.y,
                r.z,
                v.x,
                v.y,
                v.z,
                pvt.satellites_used,
                pvt.status.name()
            );
        }
    }
    text
}
