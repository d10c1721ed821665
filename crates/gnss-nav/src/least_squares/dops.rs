//! Dilution of precision.

use nalgebra::{Vector3, Vector4};

use crate::NavError;
use crate::geodesy::Geodetic;
use crate::linear::{self, Row};
use crate::measurement::Predicted;

/// Standard deviations for pseudoranges of unit variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dops {
    /// Geometry: position and time.
    pub gdop: f64,
    /// Position.
    pub pdop: f64,
    /// Horizontal.
    pub hdop: f64,
    /// Vertical.
    pub vdop: f64,
    /// Time (clock bias in metres).
    pub tdop: f64,
}

impl Dops {
    /// Of the satellites `predicted`, seen from `receiver_ecef_m`.
    pub(crate) fn new(
        receiver_ecef_m: &Vector3<f64>,
        predicted: &[Predicted],
    ) -> Result<Self, NavError> {
        let enu_from_ecef = Geodetic::from_ecef(receiver_ecef_m).enu_from_ecef();
        let rows: Vec<Row<4>> = predicted
            .iter()
            .map(|p| {
                let enu = -(enu_from_ecef * p.line_of_sight.unit_ecef);
                Row {
                    gradient: Vector4::new(enu.x, enu.y, enu.z, 1.0),
                    residual: 0.0,
                    sigma: 1.0,
                }
            })
            .collect();
        let diagonal = linear::solve(&rows)?.covariance.diagonal();
        let horizontal = diagonal.x + diagonal.y;
        Ok(Self {
            gdop: diagonal.sum().sqrt(),
            pdop: (horizontal + diagonal.z).sqrt(),
            hdop: horizontal.sqrt(),
            vdop: diagonal.z.sqrt(),
            tdop: diagonal.w.sqrt(),
        })
    }
}
