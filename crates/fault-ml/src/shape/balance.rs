//! Where the flanks near the peak balance, against where those further out do.

use super::observable::SHAPE_TAPS_CHIPS;

/// Weight of a new shape in the mean that the slopes are taken from: some 200 shapes.
const SHAPE_WEIGHT: f64 = 0.005;

/// Weight of the newest of `count` values in their mean, but no less than `least`; divides only where it
/// has to, as divisions are most of what a step costs.
pub(super) fn newest_weight(count: f64, least: f64) -> f64 {
    if count * least < 1.0 {
        count.recip()
    } else {
        least
    }
}

/// An observable between the taps that is blind to where the replica stands.
///
/// A pair of taps balances where the peak is, if nothing distorts it. A reflection moves that point,
/// by the more the further out the pair: an inner pair (0.1 chip) then finds the signal earlier than
/// an outer one (0.3 chip), T = inner - outer above zero, and the replica, which follows a pair in between or
/// further out, is late. Both differences are divided by the slopes of the flanks beside them,
/// measured from the same taps over the last shapes: a front end's bandwidth, the signal's strength
/// and an error of the replica as a whole (its jitter, or that of navigation) cancel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlankBalance {
    inner_slope: f64,
    outer_slope: f64,
    shapes: f64,
}

impl FlankBalance {
    /// Of which no shape is known.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            inner_slope: 0.0,
            outer_slope: 0.0,
            shapes: 0.0,
        }
    }

    /// Takes the magnitudes at [`SHAPE_TAPS_CHIPS`]; returns by how much earlier the inner pair finds
    /// the signal than the outer one, chips.
    ///
    /// `None` where there is no peak, or a magnitude is no number.
    pub fn step(&mut self, magnitudes: &[f64; SHAPE_TAPS_CHIPS.len()]) -> Option<f64> {
        let [e4, e3, e2, e1, p, l1, l2, l3, l4] = *magnitudes;
        // In pairs, which do not wait for each other.
        let total = ((e4 + l4) + (e3 + l3)) + ((e2 + l2) + (e1 + l1)) + p;
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let scale = total.recip();
        // Means of both sides, per chip.
        let inner = 2.5 * scale * (p - e2 + p - l2);
        let outer = 2.5 * scale * (e2 - e4 + l2 - l4);
        self.shapes += 1.0;
        let weight = newest_weight(self.shapes, SHAPE_WEIGHT);
        self.inner_slope += weight * (inner - self.inner_slope);
        self.outer_slope += weight * (outer - self.outer_slope);
        let is_peak = self.inner_slope > 0.0 && self.outer_slope > 0.0;
        let half = 0.5 * scale;
        let slopes = self.inner_slope * self.outer_slope;
        let difference = (e1 - l1) * self.outer_slope - (e3 - l3) * self.inner_slope;
        is_peak.then(|| half * difference / slopes)
    }

    /// Forgets all shapes.
    pub const fn reset(&mut self) {
        *self = Self::new();
    }
}

impl Default for FlankBalance {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Direct signal `late` chips before prompt, and a reflection in phase or opposition.
    fn shape(late: f64, amplitude: f64, delay: f64) -> [f64; 9] {
        let peak = |x: f64| (1.0 - x.abs()).max(0.0);
        SHAPE_TAPS_CHIPS.map(|x| (peak(x + late) + amplitude * peak(x + late - delay)).abs())
    }

    #[test]
    fn a_lone_signal_has_none_wherever_the_replica_stands() {
        let mut settled = FlankBalance::new();
        (0..200).for_each(|_| _ = settled.step(&shape(0.0, 0.0, 0.0)));
        for late in [-0.09, -0.05, 0.0, 0.02, 0.08] {
            let observed = settled.step(&shape(late, 0.0, 0.0)).unwrap();
            // One shape in two hundred moves the slopes a little.
            assert!(observed.abs() < 2e-3, "{late}: {observed}");
        }
    }

    #[test]
    fn a_reflection_in_phase_is_above_zero_and_in_opposition_below() {
        for (amplitude, sign) in [(0.4, 1.0), (-0.4, -1.0)] {
            let observed = FlankBalance::new()
                .step(&shape(0.0, amplitude, 0.5))
                .unwrap();
            assert!(sign * observed > 0.02, "{amplitude}: {observed}");
        }
    }

    #[test]
    fn strength_does_not_matter_and_what_is_no_peak_is_none() {
        let weak = shape(0.03, 0.3, 0.4);
        let strong = weak.map(|m| 1e3 * m);
        let [weak, strong] = [weak, strong].map(|s| FlankBalance::new().step(&s).unwrap());
        assert!((weak - strong).abs() < 1e-12);
        let mut balance = FlankBalance::new();
        for bad in [[0.0; 9], [f64::NAN; 9], [1.0; 9]] {
            assert_eq!(balance.step(&bad), None);
            balance.reset();
        }
    }
}
