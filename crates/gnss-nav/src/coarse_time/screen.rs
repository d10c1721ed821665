//! Which hypotheses cannot fit, told from one linearisation at their start.

use nalgebra::{SMatrix, SVector, Vector3};

use super::Anchor;
use super::fit::{Ranged, UNKNOWNS, see, ties};
use crate::GpsTime;
use crate::linear::Row;
use crate::measurement::MeasurementModel;

/// What a linearisation leaves out, m: the square of a distance over twice the shortest range, distance times time
/// times a satellite's speed over that range, and half the largest acceleration of a range times time squared.
const SHORTEST_RANGE_M: f64 = 2e7;
const SATELLITE_MPS: f64 = 4e3;
const RANGE_MPS2: f64 = 0.5;
/// And what measurements may be off, m.
const MEASURED_M: f64 = 1e3;

/// Sums of the normal equations: matrix, right side, squared residuals, weights.
#[derive(Debug, Clone, Copy)]
struct Sums {
    matrix: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    right: SVector<f64, UNKNOWNS>,
    square: f64,
    weight: f64,
}

impl Sums {
    fn of(row: &Row<UNKNOWNS>) -> Self {
        let weight = row.sigma.powi(-2);
        Self {
            matrix: row.gradient * row.gradient.transpose() * weight,
            right: row.gradient * (row.residual * weight),
            square: row.residual * row.residual * weight,
            weight,
        }
    }

    fn add(&mut self, other: &Self, sign: f64) {
        self.matrix += other.matrix * sign;
        self.right += other.right * sign;
        self.square += other.square * sign;
        self.weight += other.weight * sign;
    }
}

/// A hypothesis at its start.
pub(super) struct Screen {
    /// Of each channel; `None`: its satellite has no state there.
    channels: Vec<Option<Sums>>,
    whole: Sums,
    allowed_m: f64,
}

impl Screen {
    /// Of `ranged`, all channels of a hypothesis.
    pub(super) fn new(
        ranged: &[Ranged],
        anchor: &Anchor,
        model: &MeasurementModel,
        start: (Vector3<f64>, GpsTime),
        believed_sigmas: f64,
    ) -> Self {
        let (position, time) = start;
        let ties = ties(anchor, &position, time);
        let mut whole = Sums {
            matrix: SMatrix::zeros(),
            right: SVector::zeros(),
            square: 0.0,
            weight: 0.0,
        };
        ties.iter().for_each(|tie| {
            let tie = Sums::of(tie);
            whole.add(&Sums { weight: 0.0, ..tie }, 1.0);
        });
        let seen = ranged
            .iter()
            .map(|r| see(r, model, &position, time, 0.0).ok());
        let channels: Vec<_> = seen.map(|seen| Some(Sums::of(&seen?.row()))).collect();
        for sums in channels.iter().flatten() {
            whole.add(sums, 1.0);
        }
        let away_m = (position - anchor.position_ecef_m).norm();
        let reach_m = away_m + believed_sigmas * anchor.position_sigma_m;
        let reach_s = (time - anchor.time).abs() + believed_sigmas * anchor.time_sigma_s;
        Self {
            channels,
            whole,
            allowed_m: MEASURED_M
                + reach_m * reach_m / (2.0 * SHORTEST_RANGE_M)
                + reach_m * reach_s * SATELLITE_MPS / SHORTEST_RANGE_M
                + RANGE_MPS2 / 2.0 * reach_s * reach_s,
        }
    }

    /// Whether the channels but those `out` may agree anywhere near the anchor. Least squares never makes the
    /// weighted sum of what the linearisation leaves out larger: what is beyond that sum cannot.
    pub(super) fn lets_pass(&self, out: &[usize]) -> bool {
        let mut sums = self.whole;
        for (index, channel) in self.channels.iter().enumerate() {
            match (channel, out.contains(&index)) {
                (Some(channel), true) => sums.add(channel, -1.0),
                // A satellite without a state cannot be fitted.
                (None, false) => return false,
                _ => {}
            }
        }
        let Some(factor) = sums.matrix.cholesky() else {
            return true;
        };
        let left = sums.square - sums.right.dot(&factor.solve(&sums.right));
        left <= self.allowed_m * self.allowed_m * sums.weight
    }
}
