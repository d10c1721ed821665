//! Instants on the grid of samples.
//!
//! Positions count in half ticks: behind a front-end filter signals are made twice a sample.

/// Half ticks of a tick.
pub(super) const HALVES: i64 = 2;

/// Nearer than this to a half tick an instant is on it: an `f64` of seconds cannot tell them apart.
const SNAP_HALVES: f64 = 1e-6;

/// The grid of half samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    pub(super) sample_rate_hz: f64,
}

impl Grid {
    /// The first half tick at or after an instant.
    pub(super) fn first_half(self, elapsed_s: f64) -> i64 {
        let position = elapsed_s * self.sample_rate_hz * HALVES as f64;
        let nearest = position.round();
        // Resolution of the product, where that is coarser.
        let snap = SNAP_HALVES.max(2.0 * f64::EPSILON * position.abs());
        if (position - nearest).abs() <= snap {
            nearest as i64
        } else {
            position.ceil() as i64
        }
    }

    /// The first tick at or after an instant.
    pub(super) fn first_tick(self, elapsed_s: f64) -> i64 {
        let half = self.first_half(elapsed_s);
        half.div_euclid(HALVES) + half.rem_euclid(HALVES)
    }

    /// Elapsed time at a half tick, s: the nearest `f64`, and what it lacks (up to 7 ps after a
    /// day, 2 mm of range).
    pub(super) fn elapsed_s(self, half: i64) -> (f64, f64) {
        let rate_hz = self.sample_rate_hz * HALVES as f64;
        let elapsed_s = half as f64 / rate_hz;
        (
            elapsed_s,
            -elapsed_s.mul_add(rate_hz, -(half as f64)) / rate_hz,
        )
    }

    /// Phase at a half tick of an oscillation that is at 0 at half tick 0, cycles in [0, 1).
    pub(super) fn cycles(self, frequency_hz: f64, half: i64) -> f64 {
        // Whole seconds apart, so that a day leaves no more than a second does.
        let per_second = self.sample_rate_hz * HALVES as f64;
        let whole = if per_second.fract() == 0.0 {
            half.div_euclid(per_second as i64)
        } else {
            0
        };
        let rest = half - whole * per_second as i64;
        let whole_cycles = (frequency_hz * whole as f64).rem_euclid(1.0);
        let rest_cycles = (frequency_hz * rest as f64 / per_second).rem_euclid(1.0);
        (whole_cycles + rest_cycles).rem_euclid(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instant_on_a_sample_begins_with_it() {
        for sample_rate_hz in [2.6e6, 4.092e6, 16.369e6] {
            let grid = Grid { sample_rate_hz };
            for tick in [0_i64, 1, 77, 1_234_567, 987_654_321] {
                let at_s = tick as f64 / sample_rate_hz;
                assert_eq!(grid.first_tick(at_s), tick);
                assert_eq!(grid.first_tick(at_s + 0.3 / sample_rate_hz), tick + 1);
                assert_eq!(grid.first_half(at_s + 0.3 / sample_rate_hz), 2 * tick + 1);
                assert_eq!(grid.first_tick(at_s - 0.3 / sample_rate_hz), tick);
            }
        }
    }

    #[test]
    fn what_a_float_lacks_of_the_time_is_known() {
        let grid = Grid {
            sample_rate_hz: 2.6e6,
        };
        let half = 449_280_000_001;
        let (elapsed_s, rest_s) = grid.elapsed_s(half);
        // 86 400 s and 1 / 5.2 MHz.
        let exact = (elapsed_s - 86_400.0) + rest_s;
        assert!((exact - 1.0 / 5.2e6).abs() < 1e-18, "{exact}");
        assert!(rest_s.abs() < 7.3e-12);
    }

    #[test]
    fn the_phase_of_a_day_is_exact() {
        let grid = Grid {
            sample_rate_hz: 16.369e6,
        };
        // 3.996 MHz after a whole number of seconds and 5 samples.
        let half = 2 * (86_400 * 16_369_000 + 5);
        let expected = 3.996e6 * 5.0 / 16.369e6;
        assert!((grid.cycles(3.996e6, half) - f64::fract(expected)).abs() < 1e-12);
        assert!((grid.cycles(-0.25 * 16.369e6, 2) - 0.75).abs() < 1e-12);
    }
}
